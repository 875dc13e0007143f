"""Steps per second, compared with Acrobot and MuJoCo, in one run on one core: environments.py [seconds per row [rows]].

It needs gymnasium and mujoco besides the wheel (`requirements.txt` in this folder). Every row is measured in turn, in
three rounds, and the best round counts. The unit is processor time of this process, which other programs disturb less
than clock time. A step of Acrobot is one of Runge-Kutta 4 over 0.2 s in Python. A step of pendularm and of MuJoCo is
two over 0.025 s, except in the row `step(1, effort)`, where it is one. `rows` is a part of the rows' names, such as
`Batch`; other rows are left out, except the first one.
"""

import os
import sys
import time
from collections.abc import Callable

import gymnasium
import mujoco
import mujoco.rollout
import numpy as np

import pendularm
import pendularm.envs

ARMS = 1024
ROUNDS = 3

ROD = """<body pos="{at} 0 0"><joint axis="0 0 1"/><geom type="capsule" size=".01" fromto="0 0 0 1 0 0" mass="0"/>
<inertial pos=".5 0 0" mass="1" diaginertia="1e-6 .083333333333 .083333333333"/>{further}</body>"""
LINKS = ROD.format(at=0, further=ROD.format(at=1, further=""))
ARM = f"""<mujoco><option timestep=".025" integrator="RK4" gravity="0 -9.81 0"><flag contact="disable"/></option>
<worldbody>{LINKS}</worldbody></mujoco>"""


def single(env: gymnasium.Env) -> Callable[[], int]:
    """Steps of one environment, which is reset when it ends."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(64)]

    def run() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return len(actions)

    return run


def vector(env: gymnasium.vector.VectorEnv) -> Callable[[], int]:
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(8)]

    def run() -> int:
        for action in actions:
            env.step(action)
        return len(actions) * env.num_envs

    return run


def many(name: str) -> gymnasium.vector.VectorEnv:
    return gymnasium.make_vec(name, ARMS, threads=1, timestep=0.025)


def batch(take: Callable[[pendularm.Batch, np.ndarray], None]) -> Callable[[], int]:
    """Only the library, without observations and rewards: `take` takes a step with an effort per joint."""
    arms = pendularm.Batch(ARMS, threads=1)
    arms.set_integrator(timestep=0.025)
    effort = np.random.default_rng(0).uniform(-1, 1, (ARMS, 2))

    def run() -> int:
        take(arms, effort)
        return ARMS

    return run


def disturbed(arms: pendularm.Batch, effort: np.ndarray) -> None:
    arms.disturb(effort, 2 * 0.025)
    arms.step(2)


def mujoco_step() -> Callable[[], int]:
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)

    def run() -> int:
        for _ in range(64):
            mujoco.mj_step(model, data, 2)
        return 64

    return run


def mujoco_rollout() -> Callable[[], int]:
    """MuJoCo's own function for many arms, without Python between two steps."""
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.zeros((64, size))
    mujoco.mj_getState(model, data, start[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start[:] = start[0]

    def run() -> int:
        mujoco.rollout.rollout(model, data, start, nstep=100)
        return 64 * 100 // 2

    return run


def check() -> None:
    """The arm in MuJoCo is the same: a second of free fall agrees within the digits of its inertia."""
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 40)
    arm = pendularm.Simulation(timestep=0.025)
    arm.step(40)
    assert np.allclose(data.qpos, arm.position, rtol=0, atol=1e-9), (data.qpos, arm.position)


def main() -> None:
    check()
    seconds, wanted = float(sys.argv[1]) if len(sys.argv) > 1 else 1.0, " ".join(sys.argv[2:])
    rows = {
        "Acrobot-v1": single(gymnasium.make("Acrobot-v1")),
        "Acrobot-v1, 8 in a SyncVectorEnv": vector(gymnasium.make_vec("Acrobot-v1", 8, vectorization_mode="sync")),
        "MuJoCo, mj_step with nstep=2": mujoco_step(),
        "MuJoCo, rollout of 64 arms": mujoco_rollout(),
        "Pendularm-v0": single(gymnasium.make("Pendularm-v0", timestep=0.025)),
        f"Pendularm-v0, {ARMS} in its vector environment": vector(many("Pendularm-v0")),
        f"PendularmReach-v0, {ARMS} likewise": vector(many("PendularmReach-v0")),
        f"pendularm.Batch of {ARMS}": batch(disturbed),
        f"pendularm.Batch of {ARMS}, step(1, effort)": batch(lambda arms, effort: arms.step(1, effort)),
    }
    rows = {name: run for name, run in rows.items() if wanted in name or name == "Acrobot-v1"}
    print(f"load {os.getloadavg()[0]:.1f}")
    best = dict.fromkeys(rows, 0.0)
    for _ in range(ROUNDS):
        for name, run in rows.items():
            run()
            steps, began = 0, time.process_time()
            while (took := time.process_time() - began) < seconds:
                steps += run()
            best[name] = max(best[name], steps / took)
    acrobot = max(rate for name, rate in best.items() if name.startswith("Acrobot"))
    print("| one core | steps a second | times Acrobot |\n| --- | --- | --- |")
    for name, rate in best.items():
        print(f"| {name} | {rate:,.0f} | {rate / acrobot:.1f} |")


if __name__ == "__main__":
    main()

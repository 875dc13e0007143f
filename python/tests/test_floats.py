"""The same bits in a thread with another floating-point environment, which is back afterwards."""

import contextlib
import ctypes
import ctypes.util
import platform
import sys

import gymnasium
import numpy as np
import pytest

import pendularm
import pendularm.envs

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64", reason="the layout of fenv_t is that of Linux on x86-64"
)

# The last word of fenv_t is the control word of the vector registers.
FLUSH, UPWARD, DOWNWARD = 0x8040, 0x4000, 0x2000

POSES, GRAVITY = np.linspace(1e-310, 1, 6000).reshape(3000, 2), np.linspace(0, 9, 3000)
PUSH = np.full((3, 2), 0.3, np.float32)
GRID = {"kp": np.linspace(50, 500, 20)}


@contextlib.contextmanager
def environment(bits):
    libm = ctypes.CDLL(ctypes.util.find_library("m"))
    before, changed = (ctypes.c_uint32 * 8)(), (ctypes.c_uint32 * 8)()
    libm.fegetenv(before)
    libm.fegetenv(changed)
    changed[7] |= bits
    libm.fesetenv(changed)
    try:
        yield
        libm.fegetenv(changed)
        left = changed[7] & (FLUSH | UPWARD | DOWNWARD)
    finally:
        libm.fesetenv(before)
    assert left == bits


def of_an_arm():
    arm = pendularm.Simulation(pendularm.Arm(lengths=[0.9, 0.7]), timestep=0.0013)
    arm.set_state([1e-310, 0.3], [0.0, 1e-320])
    arm.disturb([2.0, 1e-315], 0.1)
    arm.step(500)
    arm.timestep = 0.0007
    arm.enable()
    arm.set_setpoint([0.3, 1e-310])
    arm.step(500)
    return [arm.time, arm.energy, *arm.position, *arm.velocity, *arm.effort, *arm.integral, *arm.end_effector]


def of_a_still_arm():
    arm = pendularm.Simulation(pendularm.Arm(gravity=0))
    arm.set_state([0, 0], [1e-310, 0])
    arm.step(10)
    return [*arm.position, *arm.velocity]


def of_a_batch(threads):
    batch = pendularm.Batch(3000, threads=threads)
    batch.set_params(gravity=GRAVITY)
    batch.set_state(POSES, np.full((3000, 2), 1e-310))
    batch.step(40)
    return [batch.position.tobytes(), batch.velocity.tobytes(), batch.time.tobytes(), batch.energy.tobytes()]


def of_the_equation():
    arm, rows = pendularm.Arm(lengths=[0.9, 0.7]), POSES[:100]
    found = [pendularm.dynamics.forward_dynamics(arm, rows, rows, rows), pendularm.dynamics.mass_matrix(arm, rows[7])]
    found += [pendularm.end_effector(arm, rows), pendularm.inverse_kinematics(arm, 0.4, 1.1), np.array(arm.reach)]
    return [one.tobytes() for one in found]


def of_the_study():
    run = pendularm.rollout(duration=0.3, q=[0.4, 1e-310], gains={}, reference=True)
    limits = pendularm.stability(setpoint=[0.3, -0.4])
    return [run.positions.tobytes(), run.error, run.energy.tobytes(), limits.timestep_limit, limits.advised_timestep]


def of_the_environments():
    one, many = gymnasium.make("PendularmReach-v0"), gymnasium.make_vec("Pendularm-v0", 3, max_episode_steps=5)
    found = [one.reset(seed=3)[0].tobytes(), many.reset(seed=3)[0].tobytes()]
    for _ in range(12):
        found += [one.step(PUSH[0])[:2], many.step(PUSH)[:2]]
    return [part if isinstance(part, bytes) else [np.asarray(x).tobytes() for x in part] for part in found]


def of_a_sweep():
    found = pendularm.sweep(GRID, "final_error", q=1e-310, duration=0.2, progress=False)
    return found["final_error"].tolist()


@pytest.mark.parametrize("bits", [FLUSH, UPWARD, DOWNWARD], ids=["flush", "upward", "downward"])
@pytest.mark.parametrize(
    "find",
    [
        of_an_arm,
        of_a_still_arm,
        lambda: of_a_batch(1),
        lambda: of_a_batch(7),
        of_the_equation,
        of_the_study,
        of_the_environments,
        of_a_sweep,
    ],
    ids=["arm", "still arm", "batch", "threads", "equation", "study", "environments", "sweep"],
)
def test_the_bits_do_not_depend_on_the_callers_environment(find, bits):
    # This comes first, because threads inherit the environment in which they start.
    with environment(bits):
        found = find()
    assert found == find()

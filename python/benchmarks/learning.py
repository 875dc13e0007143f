"""Collects rollouts and learns the swing-up with unmodified PPO: learning.py rates|sb3|rllib [seeds].

    pip install "$(ls python/target/wheels/*.whl)[gym]" stable-baselines3==2.9.2 "ray[rllib]==2.60.0"

`rates` prints the steps per second of PPO's rollout collection in stable-baselines3, and of the environments alone, with
`envs.sb3` and with the `SubprocVecEnv` of stable-baselines3. Each figure is the best of 5 rounds, by clock time.

`sb3` and `rllib` train with each of the seeds (0 1 2 3 4) until the task is solved, or for 3 million steps. Solved: in at
least 95 of 100 episodes of the policy without noise, the end effector is above 0.95 of the reach throughout the last second.
The starts of these episodes are not those of the training. Processor time and clock time exclude these episodes, imports, and
the start of RLlib's processes, whose time is printed on standard error. The processor time is that of this process, which is
one thread with stable-baselines3. RLlib has two further processes. With `RAY_worker_niceness=0` they have the priority of
this one.
"""

import datetime
import os
import platform
import secrets
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version

import gymnasium
import numpy as np
import torch

import pendularm
import pendularm.envs

TASK = "pendularm.envs:Pendularm-v0"
ROUNDS = 5
MOST_STEPS = 3_000_000
EPISODES = 100
FIRST_SEED = 10**6
"""The training begins with other seeds: those from its own to 255 above."""
SETTINGS = {"gamma": 0.97, "gae_lambda": 0.95}

Policy = Callable[[np.ndarray], np.ndarray]


def successes(policy: Policy) -> tuple[int, float]:
    """The number of episodes that end with a second above 0.95 of the reach, and the mean return."""
    env = gymnasium.make_vec(TASK, EPISODES, threads=1)
    seen, _ = env.reset(seed=FIRST_SEED)
    arm, returns = pendularm.Arm(), np.zeros(EPISODES)
    up, alive = np.zeros(EPISODES, int), np.ones(EPISODES, bool)
    # The last step returns the last observation, because the reset comes with the step after it.
    for _ in range(200):
        seen, rewards, lost, _, _ = env.step(policy(seen))
        returns += rewards * alive
        alive &= ~lost
        height = pendularm.end_effector(arm, np.arctan2(seen[:, 2:4], seen[:, :2]))[:, 1]
        up = np.where(height > 0.95 * arm.reach, up + 1, 0)
    return int((alive & (up >= 20)).sum()), float(returns.mean())


class Stopwatch:
    """Processor time and clock time, except those of `successes`."""

    def __init__(self) -> None:
        self.began = time.process_time(), time.perf_counter()

    def told(self) -> tuple[float, float]:
        return time.process_time() - self.began[0], time.perf_counter() - self.began[1]

    def solves(self, policy: Policy) -> tuple[int, float]:
        own, clock = self.told()
        found = successes(policy)
        self.began = time.process_time() - own, time.perf_counter() - clock
        return found


def with_sb3(seed: int) -> Iterator[tuple[int, Stopwatch, Policy]]:
    """Trains by rollouts of 8192 steps, and yields the steps so far after some of them."""
    from stable_baselines3 import PPO

    watch = Stopwatch()
    env = pendularm.envs.sb3(TASK, 256, threads=1)
    model = PPO(
        "MlpPolicy", env, n_steps=32, batch_size=1024, n_epochs=5, learning_rate=0.002, seed=seed, device="cpu", **SETTINGS
    )
    while True:
        model.learn(5 * 32 * 256, reset_num_timesteps=False)
        yield model.num_timesteps, watch, lambda seen: model.predict(seen, deterministic=True)[0]


def with_rllib(seed: int) -> Iterator[tuple[int, Stopwatch, Policy]]:
    """The same with two processes that collect, each with one vector environment of 128 arms."""
    from ray.rllib.algorithms.ppo import PPOConfig

    began = time.perf_counter()
    config = (
        PPOConfig()
        .environment(TASK, env_config={"threads": 1})
        .env_runners(num_env_runners=2, num_envs_per_env_runner=128, gym_env_vectorize_mode="vector_entry_point")
        .env_runners(rollout_fragment_length=32, num_cpus_per_env_runner=0.5)
        .training(train_batch_size_per_learner=8192, minibatch_size=1024, num_epochs=5, lr=0.002)
        .training(gamma=SETTINGS["gamma"], lambda_=SETTINGS["gae_lambda"])
        .rl_module(model_config={"fcnet_hiddens": [64, 64], "fcnet_activation": "tanh", "vf_share_layers": False})
        .debugging(seed=seed)
    )
    algorithm, steps = config.build_algo(), 0
    print(f"seed {seed}: RLlib started in {time.perf_counter() - began:.0f} s", file=sys.stderr)
    watch = Stopwatch()

    def policy(seen: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            out = algorithm.get_module().forward_inference({"obs": torch.from_numpy(seen)})
        # The mean of the normal distribution, then the logarithm of its deviation.
        return out["action_dist_inputs"][:, :2].numpy()

    try:
        while True:
            for _ in range(5):
                steps += int(algorithm.train()["env_runners"]["num_env_steps_sampled"])
            yield steps, watch, policy
    finally:
        algorithm.stop()


def solve(train: Callable[[int], Iterator[tuple[int, Stopwatch, Policy]]], seeds: list[int]) -> None:
    print("| seed | solved after, steps | processor time, s | clock time, s | episodes that succeed | mean return |")
    print("| --- | --- | --- | --- | --- | --- |")
    for seed in seeds:
        for steps, watch, policy in (training := train(seed)):
            held, returns = watch.solves(policy)
            own, clock = watch.told()
            if held >= 0.95 * EPISODES or steps > MOST_STEPS:
                steps_told = f"{steps:,}" if held >= 0.95 * EPISODES else f"not in {steps:,}"
                print(f"| {seed} | {steps_told} | {own:.0f} | {clock:.0f} | {held} | {returns:.1f} |", flush=True)
                break
        training.close()


def rates() -> None:
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import SubprocVecEnv

    class Rollouts(BaseCallback):
        """The time of the shortest rollout."""

        took, best = 0.0, float("inf")

        def _on_rollout_start(self) -> None:
            self.took = time.perf_counter()

        def _on_rollout_end(self) -> None:
            self.best = min(self.best, time.perf_counter() - self.took)

        def _on_step(self) -> bool:
            return True

    print("| 2 cores | rollout of PPO, steps/s | environments alone, steps/s |\n| --- | --- | --- |")
    of_processes = lambda count: make_vec_env(TASK, count, vec_env_cls=SubprocVecEnv)
    of_a_batch = lambda count: pendularm.envs.sb3(TASK, count, threads=2)
    kinds = {"SubprocVecEnv": (of_processes, [2, 4, 8, 16]), "envs.sb3": (of_a_batch, [16, 64, 256, 1024])}
    for kind, (make, counts) in kinds.items():
        for count in counts:
            env, steps = make(count), 200
            model = PPO("MlpPolicy", env, n_steps=steps, batch_size=steps * count, n_epochs=1, device="cpu")
            watch, alone = Rollouts(), float("inf")
            model.learn(ROUNDS * steps * count, callback=watch)
            env.reset()
            actions = np.random.default_rng(0).uniform(-1, 1, (count, 2)).astype(np.float32)
            for _ in range(ROUNDS):
                began = time.perf_counter()
                for _ in range(steps):
                    env.step(actions)
                alone = min(alone, time.perf_counter() - began)
            env.close()
            print(f"| {kind}, {count} | {steps * count / watch.best:,.0f} | {steps * count / alone:,.0f} |", flush=True)


def main() -> None:
    what, seeds = sys.argv[1] if len(sys.argv) > 1 else "sb3", [int(seed) for seed in sys.argv[2:]] or [0, 1, 2, 3, 4]
    torch.set_num_threads(1)
    used = ["pendularm", "torch", "gymnasium", "ray" if what == "rllib" else "stable-baselines3"]
    told = ", ".join(f"{name} {version(name)}" for name in used)
    print(f"{datetime.date.today()}, Python {platform.python_version()}, {told}")
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}", flush=True)
    if what == "rates":
        rates()
    elif what == "rllib":
        import ray

        os.environ.setdefault("RAY_AUTH_TOKEN", secrets.token_hex(32))
        here = {"include_dashboard": False, "_node_ip_address": "127.0.0.1", "log_to_driver": False}
        ray.init(num_cpus=2, object_store_memory=200_000_000, **here)
        solve(with_rllib, seeds)
    else:
        solve(with_sb3, seeds)
    print(f"load {os.getloadavg()[0]:.1f} at the end")


if __name__ == "__main__":
    main()

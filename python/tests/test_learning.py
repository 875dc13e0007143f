"""The adapters to stable-baselines3, RLlib and Ray. `make test-learning` installs them; without one its tests are skipped."""

import importlib.util
import os
import re
import secrets
import subprocess
import sys
import types
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import pendularm
import pendularm.envs

has_torch = importlib.util.find_spec("torch") is not None
FOUND = importlib.util.find_spec("stable_baselines3")


@pytest.fixture
def sb3():
    """The adapter. Without torch, the packages around `base_vec_env` are replaced by empty ones."""
    if FOUND is None:
        pytest.skip("stable-baselines3 is not installed")
    if not has_torch and "stable_baselines3" not in sys.modules:
        place, name = Path(FOUND.origin).parent, "stable_baselines3"
        for part in ["", "common", "vec_env"]:
            name, place = (f"{name}.{part}", place / part) if part else (name, place)
            sys.modules[name] = types.ModuleType(name)
            sys.modules[name].__path__ = [str(place)]
    return pendularm.envs.sb3


@pytest.fixture
def make(sb3):
    made = []

    def of(*arguments, **options):
        made.append(sb3(*arguments, **options))
        return made[-1]

    yield of
    for env in made:
        env.close()


def test_the_arms_are_those_of_the_vector_environment(make, name, links):
    ours = make(name, 5, links=links, max_episode_steps=7)
    theirs = gymnasium.make_vec(name, 5, links=links, max_episode_steps=7, autoreset_mode="SameStep")
    assert ours.num_envs == 5
    assert (ours.observation_space, ours.action_space) == (theirs.single_observation_space, theirs.single_action_space)
    assert ours.seed(7) == [7, 8, 9, 10, 11]
    assert np.array_equal(ours.reset(), theirs.reset(seed=7)[0])
    random, ends = np.random.default_rng(1), 0
    for _ in range(40):
        actions = random.uniform(-1, 1, (5, links)).astype(np.float32)
        observations, rewards, dones, infos = ours.step(actions)
        expected = theirs.step(actions)
        assert np.array_equal(observations, expected[0])
        assert np.array_equal(rewards, expected[1].astype(np.float32))
        assert rewards.dtype == np.float32
        assert np.array_equal(dones, expected[2] | expected[3])
        for arm, info in enumerate(infos):
            assert info["TimeLimit.truncated"] is bool(expected[3][arm] and not expected[2][arm])
            assert ("terminal_observation" in info) == dones[arm]
            if dones[arm]:
                assert np.array_equal(info["terminal_observation"], expected[4]["final_obs"][arm])
                ends += 1
    assert ends > 15


def test_the_end_of_an_episode_has_its_success(make):
    env = make("PendularmPendubot-v0", 2, max_episode_steps=3)
    env.reset()
    for _ in range(3):
        *_, dones, infos = env.step(np.zeros((2, 1), np.float32))
    assert dones.all()
    assert [(info["is_success"], info["held"]) for info in infos] == [(False, 0.0)] * 2


def test_attributes_and_methods_are_those_of_the_arms(make):
    env = make("Pendularm-v0", 3, render_mode="rgb_array")
    env.reset()
    assert env.get_attr("render_mode") == ["rgb_array"] * 3
    assert env.get_attr("action_space", [0, 2]) == [env.action_space] * 2
    assert env.get_attr("num_envs", 1) == [3]
    assert env.env_is_wrapped(gymnasium.Wrapper) == [False] * 3
    assert not env.has_attr("nothing")
    env.set_attr("note", 5)
    assert env.get_attr("note") == [5] * 3
    (state,) = env.env_method("get_state", indices=[0])
    before = env.step(np.ones((3, 2), np.float32))[0]
    env.env_method("set_state", state, indices=0)
    assert np.array_equal(env.step(np.ones((3, 2), np.float32))[0], before)
    assert [frame.shape for frame in env.get_images()] == [(480, 480, 3)] * 3
    assert env.render().shape == (960, 960, 3)


def test_two_seeds_differ_and_one_repeats(make):
    env = make("PendularmReach-v0", 4)
    env.seed(3)
    first = env.reset()
    assert not np.array_equal(env.reset(), first)
    env.seed(3)
    assert np.array_equal(env.reset(), first)


needs_torch = pytest.mark.skipif(not has_torch, reason="it needs torch")


@needs_torch
def test_the_arms_are_those_of_sb3s_own_vector_of_single_arms(make, name, links):
    from stable_baselines3.common.env_checker import check_env
    from stable_baselines3.common.env_util import make_vec_env

    check_env(gymnasium.make(name, links=links))
    ours = make(name, 3, links=links, max_episode_steps=7)
    theirs = make_vec_env(name, 3, env_kwargs={"links": links, "max_episode_steps": 7})
    first = [env.seed(7) and env.reset() for env in (ours, theirs)]
    assert np.array_equal(*first)
    random, ends = np.random.default_rng(1), 0
    for _ in range(40):
        actions = random.uniform(-1, 1, (3, *ours.action_space.shape)).astype(np.float32)
        found, expected = ours.step(actions), theirs.step(actions)
        for one, other in zip(found[:3], expected[:3], strict=True):
            assert one.dtype == other.dtype
            assert np.array_equal(one, other)
        for one, other, done in zip(found[3], expected[3], found[2], strict=True):
            assert one["TimeLimit.truncated"] == other["TimeLimit.truncated"]
            if done:
                assert np.array_equal(one["terminal_observation"], other["terminal_observation"])
                ends += 1
    assert ends >= 15


@needs_torch
def test_ppo_learns_through_the_wrappers_of_sb3(make, tmp_path):
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecCheckNan, VecMonitor, VecNormalize, VecVideoRecorder

    arms = make("Pendularm-v0", 16, render_mode="rgb_array", max_episode_steps=20)
    env = VecNormalize(VecMonitor(VecCheckNan(arms)))
    env = VecVideoRecorder(env, str(tmp_path), lambda step: step == 0, video_length=10)
    model = PPO("MlpPolicy", env, n_steps=64, seed=0, device="cpu").learn(2048)
    assert model.num_timesteps >= 2048
    assert {episode["l"] for episode in model.ep_info_buffer} == {20}
    assert [file.stat().st_size > 1000 for file in tmp_path.glob("*.mp4")] == [True]


@needs_torch
def test_the_script_of_the_manual_solves_the_swing_up(tmp_path):
    manual = (Path(__file__).parents[2] / "docs/python.md").read_text(encoding="utf-8")
    (script,) = (part for part in re.findall("```python\n(.*?)```", manual, re.DOTALL) if "stable_baselines3" in part)
    run = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert run.returncode == 0, run.stderr
    # The policies of the manual's tables have a mean return of 160 to 180. A hanging arm has 0.
    assert float(re.search(r"mean return ([0-9.]+)", run.stdout)[1]) > 165
    assert (tmp_path / "swing-up.zip").exists()


class Stored:
    """A reference to a value that Ray has."""

    def __init__(self, value):
        self.value = value


class Remote:
    """A remote function that is called at once."""

    def __init__(self, ray, function):
        self.ray, self.function = ray, function

    def remote(self, *args):
        from concurrent.futures import Future

        self.ray.calls.append(args)
        done = Future()
        done.set_result(self.function(*(arg.value if isinstance(arg, Stored) else arg for arg in args)))
        return types.SimpleNamespace(future=lambda: done)


def test_a_sweep_sends_its_metric_to_ray_once(monkeypatch):
    ray = types.ModuleType("ray")
    ray.calls, ray.puts = [], []
    ray.put = lambda thing: ray.puts.append(thing) or Stored(thing)
    ray.remote = lambda *function, **options: Remote(ray, *function) if function else lambda one: Remote(ray, one)
    monkeypatch.setitem(sys.modules, "ray", ray)
    ask = {"grid": {"kp": np.linspace(50, 500, 20)}, "metric": "final_error", "duration": 0.1, "piece": 3}
    for executor in [pendularm.RayExecutor(), pendularm.RayExecutor(num_cpus=1)]:
        found = pendularm.sweep(executor=executor, **ask)
        assert np.array_equal(found["final_error"], pendularm.sweep(**ask)["final_error"])
    assert len(ray.puts) == 2
    assert len(ray.calls) == 14
    assert all(isinstance(question, Stored) for question, *_ in ray.calls)


@pytest.fixture(scope="module")
def ray():
    """Ray with two workers, on loopback. It reads its token once per process."""
    ray = pytest.importorskip("ray")
    small = {"object_store_memory": 200_000_000, "include_dashboard": False, "log_to_driver": False}
    with pytest.MonkeyPatch.context() as patch:
        # Otherwise Ray writes a token to the home folder.
        patch.setenv("RAY_AUTH_TOKEN", secrets.token_hex(32))
        ray.init(num_cpus=2, _node_ip_address="127.0.0.1", **small)
        yield ray
        ray.shutdown()


def test_a_sweep_on_ray_has_the_same_bits_although_a_worker_is_lost(ray, tmp_path):
    here, mark = os.getpid(), tmp_path / "lost"

    def losing(run):
        if os.getpid() != here and not mark.exists():
            mark.touch()
            os._exit(1)
        return np.abs(run.positions[-1] - run.setpoint).max(axis=1)

    ask = {"grid": {"kp": np.linspace(50, 500, 40)}, "metric": losing, "duration": 0.2, "piece": 5}
    found = pendularm.sweep(executor=pendularm.RayExecutor(num_cpus=1), **ask)
    assert mark.exists()
    assert np.array_equal(found["metric"], pendularm.sweep(**ask)["metric"])


# Warnings of Ray and of stable-baselines3 are theirs.
@pytest.mark.filterwarnings("ignore")
@needs_torch
def test_rllib_collects_with_one_vector_environment_in_each_of_two_processes(ray):
    ppo = pytest.importorskip("ray.rllib.algorithms.ppo")
    config = (
        ppo.PPOConfig()
        .environment("pendularm.envs:Pendularm-v0", env_config={"threads": 1})
        .env_runners(num_env_runners=2, num_envs_per_env_runner=16, gym_env_vectorize_mode="vector_entry_point")
        .env_runners(rollout_fragment_length=64, num_cpus_per_env_runner=0.5)
        .training(train_batch_size_per_learner=2048, minibatch_size=512, num_epochs=2)
    )
    algorithm = config.build_algo()
    try:
        assert algorithm.train()["env_runners"]["num_env_steps_sampled"] >= 2048
        kind = lambda runner: (type(runner.env.unwrapped).__name__, runner.env.num_envs)
        kinds = algorithm.env_runner_group.foreach_env_runner(kind, local_env_runner=False)
        assert kinds == [("PendularmVectorEnv", 16)] * 2
    finally:
        algorithm.stop()

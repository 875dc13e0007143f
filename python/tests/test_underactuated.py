"""Arms with one motor: the mask is the motors' limit, and the baseline of the examples solves both tasks."""

import importlib.util
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import pendularm.envs

TASKS = {"PendularmAcrobot-v0": (1, 19.62), "PendularmPendubot-v0": (0, 19.62)}


@pytest.mark.parametrize("name", TASKS)
def test_the_other_motors_have_no_effort(name):
    joint, limit = TASKS[name]
    env = gymnasium.make(name)
    assert env.action_space.shape == (1,)
    env.reset(seed=1)
    batch = env.unwrapped._task.batch
    for action in [1.0, -0.5, 7.0]:
        env.step(np.full(1, action, np.float32))
        assert batch.effort[0, 1 - joint] == 0
        assert batch.effort[0, joint] == limit * min(action, 1.0)
    # Even an effort that is applied past the task has no effect there.
    batch.step(1, [50.0, 50.0])
    assert batch.effort[0, 1 - joint] == 0
    three = gymnasium.make(name, links=3)
    assert three.action_space.shape == ((2,) if joint else (1,))


@pytest.mark.parametrize("name", TASKS)
def test_gymnasium_accepts_them_and_an_arm_of_many_is_a_single_one(name):
    check_env(gymnasium.make(name).unwrapped, skip_render_check=True)
    one, many = gymnasium.make(name), gymnasium.make_vec(name, 3)
    assert np.array_equal(one.reset(seed=6)[0], many.reset(seed=4)[0][2])
    for action in np.random.default_rng(0).uniform(-1, 1, (50, 3, 1)).astype(np.float32):
        assert np.array_equal(one.step(action[2])[0], many.step(action)[0][2])


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_the_time_up_is_counted_and_told(mode):
    env = gymnasium.make_vec("PendularmPendubot-v0", 3, max_episode_steps=150, autoreset_mode=mode)
    env.reset(seed=0)
    task = env.unwrapped._task
    task.batch.set_params(gravity=0.0)
    task.batch.set_state([[np.pi / 2, 0.0], [0.0, 0.0], [np.pi / 2, 0.0]])
    rest = np.zeros((3, 1), np.float32)
    for step in range(1, 150):
        info = env.step(rest)[4]
        assert np.allclose(info["held"], [0.05 * step, 0, 0.05 * step])
        assert info["is_success"].tolist() == [step >= 100, False, step >= 100]
        assert info["_held"].all() and info["_is_success"].all()
    *_, truncated, info = env.step(rest)
    assert truncated.all()
    if mode == "SameStep":
        assert info["final_info"]["is_success"].tolist() == [True, False, True]
        assert info["final_info"]["_is_success"].all()
    else:
        assert info["is_success"].tolist() == [True, False, True]
        info = env.step(rest)[4]
    assert info["held"].tolist() == [0, 0, 0]


def test_a_single_arm_tells_plain_numbers():
    env = gymnasium.make("PendularmAcrobot-v0")
    env.reset(seed=0)
    info = env.step(np.zeros(1, np.float32))[4]
    assert info == {"held": 0.0, "is_success": False}
    assert type(info["held"]) is float and type(info["is_success"]) is bool


@pytest.mark.parametrize("name", TASKS)
def test_the_baseline_solves_them_from_a_hundred_starts(name):
    file = Path(__file__).parents[1] / "examples" / "underactuated.py"
    spec = importlib.util.spec_from_file_location("underactuated", file)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    assert example.solved(name, 100, example.Baseline(name)).sum() == 100

"""The environments pass Gymnasium's checks, and the vector ones are equal to single ones."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import pendularm
import pendularm.envs


def test_gymnasiums_checker_passes(name, links):
    env = gymnasium.make(name, links=links)
    check_env(env.unwrapped)
    env.reset(seed=1)
    for _ in range(env.spec.max_episode_steps - 1):
        *_, truncated, _ = env.step(np.zeros(links, np.float32))
        assert not truncated
    assert env.step(np.zeros(links, np.float32))[3]
    env.close()


def test_the_vector_environment_is_as_many_single_ones(name, links):
    """They are equal through ends and resets, exactly. Episodes of 30 steps give several of them."""
    arms = 5
    ours = gymnasium.make_vec(name, arms, links=links, max_episode_steps=30)
    theirs = gymnasium.make_vec(name, arms, vectorization_mode="sync", links=links, max_episode_steps=30)
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    assert ours.single_observation_space == theirs.single_observation_space
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    random = np.random.default_rng(5)
    found, expected = ours.reset(seed=7), theirs.reset(seed=7)
    assert np.array_equal(found[0], expected[0])
    assert found[0].dtype == expected[0].dtype
    ends = 0
    for step in range(100):
        actions = random.uniform(-1.5, 1.5, (arms, links)).astype(np.float32)
        found, expected = ours.step(actions), theirs.step(actions)
        for one, other in zip(found[:4], expected[:4], strict=True):
            assert np.array_equal(one, other), step
            assert one.dtype == other.dtype
            assert one.shape == other.shape
        assert ours.observation_space.contains(found[0])
        ends += int((found[2] | found[3]).sum())
    assert ends >= 3 * arms
    ours.close()
    theirs.close()


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, "SameStep"])
def test_an_arm_is_reset_in_the_step_of_its_end(name, links, mode):
    arms = 5
    ours = gymnasium.make_vec(name, arms, links=links, max_episode_steps=7, autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    one = lambda: gymnasium.make(name, links=links, max_episode_steps=7)
    theirs = gymnasium.vector.SyncVectorEnv([one] * arms, autoreset_mode=AutoresetMode.SAME_STEP)
    random = np.random.default_rng(5)
    assert np.array_equal(ours.reset(seed=7)[0], theirs.reset(seed=7)[0])
    ends = 0
    for step in range(40):
        if step == 10:
            mask = np.array([True, False, False, True, False])
            for env in (ours, theirs):
                env.reset(options={"reset_mask": mask})
        actions = random.uniform(-1.5, 1.5, (arms, links)).astype(np.float32)
        found, expected = ours.step(actions), theirs.step(actions)
        for part, other in zip(found[:4], expected[:4], strict=True):
            assert np.array_equal(part, other), step
            assert part.dtype == other.dtype
        assert found[4].keys() == expected[4].keys()
        for arm, last in enumerate(expected[4].get("final_obs", [])):
            assert np.array_equal(found[4]["final_obs"][arm], last)
            assert found[4]["_final_obs"][arm] == expected[4]["_final_obs"][arm] == (last is not None)
            assert found[4]["_final_info"][arm] == expected[4]["_final_info"][arm]
            assert found[4]["final_info"] == expected[4]["final_info"] == {}
            ends += last is not None
    assert ends >= 3 * arms


def test_without_automatic_resets_the_caller_resets(name):
    env = gymnasium.make_vec(name, 3, max_episode_steps=2, autoreset_mode=AutoresetMode.DISABLED)
    env.reset(seed=1)
    env.step(np.zeros((3, 2), np.float32))
    env.reset(options={"reset_mask": np.array([False, True, False])})
    last, *_, truncated, _ = env.step(np.zeros((3, 2), np.float32))
    assert truncated.tolist() == [True, False, True]
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"^step needs a reset of the ended arms \[0, 2\] before it"):
        env.step(np.zeros((3, 2), np.float32))
    after = env.reset(options={"reset_mask": truncated})[0]
    assert np.array_equal(after[1], last[1])
    assert env.step(np.zeros((3, 2), np.float32))[3].tolist() == [False, True, False]
    with pytest.raises(ValueError, match="^autoreset_mode must be one of NextStep, SameStep, Disabled, got 'never'"):
        gymnasium.make_vec(name, 3, autoreset_mode="never")
    with pytest.raises(TypeError, match="^autoreset_mode must be one of NextStep, SameStep, Disabled, got 1$"):
        gymnasium.make_vec(name, 3, autoreset_mode=1)


def by_state(env):
    other = type(env)(*([3] if hasattr(env, "num_envs") else []), links=env._task.links)
    other.set_state(env.get_state())
    return other


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env)), by_state])
@pytest.mark.parametrize("arms", [None, 3])
def test_a_copied_environment_goes_on_with_the_same_bits(name, links, arms, again):
    if arms is None:
        env = gymnasium.make(name, links=links).unwrapped
    else:
        env = gymnasium.make_vec(name, arms, links=links, max_episode_steps=12)
    random = np.random.default_rng(3)
    env.reset(seed=5)
    for _ in range(10):
        env.step(random.uniform(-1, 1, env.action_space.shape).astype(np.float32))
    other = again(env)
    actions = random.uniform(-1, 1, (10, *env.action_space.shape)).astype(np.float32)
    ours = [env.step(action) for action in actions]
    ours.append(env.reset())
    theirs = [other.step(action) for action in actions]
    theirs.append(other.reset())
    for one, two in zip(ours, theirs, strict=True):
        assert [np.asarray(part).tolist() for part in one] == [np.asarray(part).tolist() for part in two]


def test_a_wrapped_environment_is_copied_with_its_wrappers(name):
    env = gymnasium.make(name)
    env.reset(seed=5)
    for _ in range(env.spec.max_episode_steps - 1):
        env.step(np.zeros(2, np.float32))
    assert copy.deepcopy(env).step(np.zeros(2, np.float32))[3]
    assert pickle.loads(pickle.dumps(env)).step(np.zeros(2, np.float32))[3]


def test_the_state_of_another_environment_is_refused():
    env = pendularm.envs.PendularmVectorEnv(3)
    env.reset(seed=1)
    for other in [pendularm.envs.PendularmVectorEnv(2), pendularm.envs.PendularmVectorEnv(3, links=3), pendularm.envs.PendularmReachVectorEnv(3)]:
        with pytest.raises(ValueError, match="^state must be of the same kind of environment, got a Pendularm"):
            env.set_state(other.get_state())


def test_the_action_of_an_arm_that_has_ended_is_ignored(name):
    one, other = (gymnasium.make_vec(name, 3, max_episode_steps=2) for _ in range(2))
    for env in (one, other):
        env.reset(seed=1)
        env.step(np.ones((3, 2), np.float32))
        # From here on the middle arm ends one step before the others.
        env.reset(options={"reset_mask": np.array([True, False, True])})
        assert env.step(np.ones((3, 2), np.float32))[3].tolist() == [False, True, False]
    actions = np.ones((3, 2), np.float32)
    expected = other.step(actions)
    actions[1] = np.nan
    for found, known in zip(one.step(actions)[:4], expected[:4], strict=True):
        assert np.array_equal(found, known)
        assert found.dtype == known.dtype
    # Now the others have ended, and the middle one continues.
    with pytest.raises(ValueError, match=r"^actions\[1\]\[0\] must be finite, got NaN"):
        one.step(np.full((3, 2), np.nan, np.float32))


def test_some_of_the_arms_can_be_reset_alone(name):
    env = gymnasium.make_vec(name, 3)
    env.reset(seed=1)
    for _ in range(5):
        before = env.step(np.ones((3, 2), np.float32))[0]
    mask = np.array([False, True, False])
    after, _ = env.reset(options={"reset_mask": mask})
    assert np.array_equal(after[[0, 2]], before[[0, 2]])
    assert not np.array_equal(after[1], before[1])
    with pytest.raises(TypeError, match="options must be a dict or None, got 5"):
        env.reset(options=5)
    with pytest.raises(ValueError, match="reset_mask must be"):
        env.reset(options={"reset_mask": [True]})
    with pytest.raises(ValueError, match=r"^reset_mask must have no masked entries, got masked_array\(data=\[True, --"):
        env.reset(options={"reset_mask": np.ma.array([True, False, True], mask=[False, True, False])})


def test_the_first_reset_is_of_all_arms(name):
    env = gymnasium.make_vec(name, 3)
    with pytest.raises(ValueError, match=r"^reset_mask must be true of all 3 at the first reset, got array\("):
        env.reset(seed=1, options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros((3, 2), np.float32))
    found = env.reset(seed=1, options={"reset_mask": np.ones(3, bool)})[0]
    assert np.array_equal(found, gymnasium.make_vec(name, 3).reset(seed=1)[0])


def test_the_seeds_are_those_of_as_many_single_environments(name):
    ours = gymnasium.make_vec(name, 3)
    theirs = gymnasium.make_vec(name, 3, vectorization_mode="sync")
    for seed in [7, [1, 2, 3], None, [4, None, 5]]:
        found, expected = ours.reset(seed=seed), theirs.reset(seed=seed)
        if seed is not None:
            assert ours.np_random_seed == theirs.np_random_seed
            assert np.array_equal(found[0], expected[0])
    assert ours.np_random_seed == (4, 2, 5)
    ours.reset(seed=9, options={"reset_mask": np.array([False, True, False])})
    assert ours.np_random_seed == (4, 10, 5)
    # A caller that reads the seeds before the first reset gets those of the next reset.
    one, other = gymnasium.make_vec(name, 3), gymnasium.make_vec(name, 3)
    seeds = one.np_random_seed
    assert len(set(seeds)) == 3
    assert np.array_equal(one.reset()[0], other.reset(seed=list(seeds))[0])
    assert [stream.random() for stream in one.np_random] == [stream.random() for stream in other.np_random]


def test_a_seed_may_be_any_whole_number(name):
    env = gymnasium.make_vec(name, 3)
    expected = env.reset(seed=3)[0]
    for seed in [np.int64(3), np.array(3), [3, np.int8(4), 5], np.arange(3, 6), range(3, 6), (3, 4, 5)]:
        assert np.array_equal(env.reset(seed=seed)[0], expected)
        assert env.np_random_seed == (3, 4, 5)


@pytest.mark.parametrize(
    ("seed", "said"),
    [
        ([1, 2], "seed must be one number, or one for each of 3, got 2"),
        (-1, "seed must be at least 0, got -1"),
        ([1, -2, 3], "seed[1] must be at least 0, got -2"),
        (2.0, "seed must be a whole number, got 2.0"),
        ("abc", "seed must be a whole number, got 'abc'"),
        (b"abc", "seed must be a whole number, got b'abc'"),
        ([1, 2, "3"], "seed[2] must be a whole number, got '3'"),
        (np.ones(3), "seed[0] must be a whole number, got "),
        (np.ma.array([1, 2, 3], mask=[0, 0, 1]), "seed[2] must be a whole number, got masked"),
    ],
)
def test_a_seed_that_is_none_is_refused_and_changes_nothing(seed, said):
    env = pendularm.envs.PendularmVectorEnv(3)
    env.reset(seed=1)
    with pytest.raises((TypeError, ValueError)) as refusal:
        env.reset(seed=seed)
    assert str(refusal.value).startswith(said)
    assert env.np_random_seed == (1, 2, 3)


def test_an_arm_that_turns_too_fast_is_lost():
    env = gymnasium.make("PendularmReach-v0")
    env.reset(seed=0)
    for _ in range(100):
        observation, reward, terminated, *_ = env.step(np.ones(2, np.float32))
        assert env.observation_space.contains(observation)
        assert 0 <= reward <= 1
        if terminated:
            break
    assert terminated
    assert np.abs(observation[4:6]).max() == 25


def test_swinging_up_pays():
    """The reward is 1 upright and 0 hanging, and no allowed effort holds the arm stretched."""
    env = gymnasium.make("Pendularm-v0").unwrapped
    env.reset(seed=0)
    for angle, reward in [(np.pi / 2, 1.0), (-np.pi / 2, 0.0), (0.0, 0.5)]:
        env._task.batch.set_state([angle, 0.0])
        assert np.isclose(env._task.reward()[0], reward)
    load = pendularm.dynamics.gravity_load(pendularm.Arm(), [0, 0])
    assert (env._task.efforts < load).all()


@pytest.mark.parametrize("method", ["euler", "midpoint", "verlet", "rk4"])
@pytest.mark.parametrize("timestep", [0.05, 0.05 / 7, np.float32(0.0125), 0.001])
def test_method_and_timestep_can_be_set(name, method, timestep):
    """A step takes 0.05 s with every method and timestep."""
    one = gymnasium.make(name, method=method, timestep=timestep).unwrapped
    many = gymnasium.make_vec(name, 2, method=method, timestep=timestep)
    found, among = one.reset(seed=3)[0], many.reset(seed=3)[0]
    for _ in range(4):
        found = one.step(np.zeros(2, np.float32))[0]
        among = many.step(np.zeros((2, 2), np.float32))[0]
    assert np.array_equal(found, among[0])
    assert np.isclose(one._task.batch.time[0], 0.2, rtol=1e-6)


@pytest.mark.parametrize("kind", [pendularm.envs.PendularmEnv, pendularm.envs.PendularmReachVectorEnv])
@pytest.mark.parametrize("timestep", [0, -0.01, 0.03, 0.1, 1e-7, 5e-324, np.nan, np.inf, "1", None, True, [0.01, 0.02]])
def test_a_timestep_that_does_not_divide_a_step_is_refused(kind, timestep):
    with pytest.raises((TypeError, ValueError), match="^timestep must be "):
        kind(timestep=timestep)


@pytest.mark.parametrize("method", ["RK4", "", None, 4, ["rk4"]])
def test_a_method_that_is_none_is_refused(method):
    with pytest.raises((TypeError, ValueError), match="^method must be "):
        pendularm.envs.PendularmEnv(method=method)


def test_a_free_arm_keeps_its_energy(name, links):
    """The energy stays within 0.1 % of the energy between hanging and upright, from any pose, over an episode."""
    env = gymnasium.make_vec(name, 500, links=links).unwrapped
    env.reset(seed=1)
    batch, arm = env._task.batch, pendularm.Arm(links)
    batch.set_state(np.random.default_rng(1).uniform(-np.pi, np.pi, (500, links)))
    before, kept = batch.energy.copy(), np.ones(500, bool)
    hanging = np.eye(1, links)[0] * -np.pi / 2
    span = -2 * pendularm.dynamics.potential_energy(arm, hanging)
    for _ in range(env._task.most_steps):
        env._task.go_on(np.zeros((500, links), np.float32))
        kept &= ~env._task.lost()
        assert (np.abs(batch.energy - before)[kept] < 0.001 * span).all()
    assert kept.sum() > 50


@pytest.mark.parametrize(
    "actions", [np.zeros((3, 1)), np.zeros((1, 2)), 0.0, np.zeros((2, 2)), np.zeros((3, 2), complex)]
)
def test_actions_have_a_row_for_each_arm(actions):
    env = pendularm.envs.PendularmVectorEnv(3)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions must have the shape \(3, 2\)"):
        env.step(actions)
    one = pendularm.envs.PendularmEnv()
    one.reset(seed=0)
    with pytest.raises(ValueError, match=r"action must have the shape \(2,\)"):
        one.step(actions)


def test_booleans_are_not_actions():
    env, one = pendularm.envs.PendularmVectorEnv(3), pendularm.envs.PendularmEnv()
    env.reset(seed=0)
    one.reset(seed=0)
    with pytest.raises(ValueError, match=r"^actions must have the shape \(3, 2\), of numbers, got \(3, 2\) of bool"):
        env.step(np.ones((3, 2), bool))
    with pytest.raises(ValueError, match=r"^action must have the shape \(2,\), of numbers, got \(2,\) of bool"):
        one.step(np.ones(2, bool))


@pytest.mark.parametrize("kind", [pendularm.envs.PendularmEnv, pendularm.envs.PendularmReachVectorEnv])
def test_a_refused_environment_can_be_closed(kind):
    # Gymnasium 1.1 and 1.2 close it when it is collected.
    env = kind.__new__(kind)
    with pytest.raises(ValueError, match="^links must be 2 or 3, got 4"):
        env.__init__(links=4)
    env.close()


@pytest.mark.parametrize("given", [[[1, 1], [1, 2, 3]], range(2**62)])
def test_what_is_no_array_is_refused_by_its_name(given):
    env, one = pendularm.envs.PendularmVectorEnv(3), pendularm.envs.PendularmEnv()
    env.reset(seed=0)
    one.reset(seed=0)
    with pytest.raises(ValueError, match="^actions must be an array, got "):
        env.step(given)
    with pytest.raises(ValueError, match="^action must be an array, got "):
        one.step(given)
    with pytest.raises(ValueError, match="^reset_mask must be an array, got "):
        env.reset(options={"reset_mask": given})


def test_masked_actions_are_refused():
    env, one = pendularm.envs.PendularmVectorEnv(3), pendularm.envs.PendularmEnv()
    env.reset(seed=0)
    one.reset(seed=0)
    with pytest.raises(ValueError, match=r"^actions must have no masked numbers, got masked_array\("):
        env.step(np.ma.masked_equal(np.eye(3, 2, dtype=np.float32), 1))
    with pytest.raises(ValueError, match=r"^action must have no masked numbers, got masked_array\("):
        one.step(np.ma.masked_equal(np.eye(2, dtype=np.float32)[0], 1))


def test_errors_of_the_batch_have_the_callers_name(name):
    for arms in [0, 2.5, 10**7]:
        with pytest.raises((TypeError, ValueError), match=f"^num_envs must be between 1 and 1000000, got {arms}$"):
            gymnasium.make_vec(name, arms)
    one = gymnasium.make(name).unwrapped
    one.reset(seed=0)
    with pytest.raises(ValueError, match=r"^action\[1\] must be finite, got NaN$"):
        one.step(np.array([0, np.nan], np.float32))


@pytest.mark.parametrize("steps", [0, -2, 2.0, "2", np.float64(3), True])
def test_an_episode_has_a_whole_number_of_steps(steps):
    with pytest.raises((TypeError, ValueError), match="^max_episode_steps must be (a whole number|at least 1, or -1 for no limit)"):
        pendularm.envs.PendularmVectorEnv(2, max_episode_steps=steps)
    pendularm.envs.PendularmVectorEnv(2, max_episode_steps=np.int64(1))


@pytest.mark.parametrize("steps", [-1, 10**30])
def test_an_episode_may_have_no_limit(name, steps):
    env = gymnasium.make_vec(name, 2, max_episode_steps=steps)
    env.reset(seed=0)
    for _ in range(300):
        truncated = env.step(np.zeros((2, 2), np.float32))[3]
        assert truncated.dtype == np.bool_
        assert not truncated.any()


@pytest.mark.parametrize(
    ("kind", "steps"), [(pendularm.envs.PendularmVectorEnv, 200), (pendularm.envs.PendularmReachVectorEnv, 100)]
)
def test_a_vector_environment_by_itself_truncates_where_its_page_says(kind, steps):
    assert f"truncated after {steps} steps" in kind.__doc__
    env = kind(2)
    env.reset(seed=0)
    for _ in range(steps - 1):
        assert not env.step(np.zeros((2, 2), np.float32))[3].any()
    assert env.step(np.zeros((2, 2), np.float32))[3].all()

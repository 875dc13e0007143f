"""Pictures of the environments' arms, and the libraries that use them."""

import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled, ResetNeeded

import pendularm.envs


def test_a_frame_shows_the_arm(name, links):
    env = gymnasium.make(name, links=links, render_mode="rgb_array")
    assert env.metadata["render_fps"] == 20
    env.reset(seed=1)
    frames = [env.render()]
    assert np.array_equal(env.render(), frames[0])
    for _ in range(4):
        env.step(np.ones(links, np.float32))
        frames.append(env.render())
    for frame in frames:
        assert frame.shape == (480, 480, 3)
        assert frame.dtype == np.uint8
    assert all((one != other).any() for one, other in zip(frames[:-1], frames[1:], strict=True))
    env.reset(seed=1)
    assert np.array_equal(env.render(), frames[0])


def test_the_vector_environment_has_the_frames_of_the_single_ones(name):
    ours = gymnasium.make_vec(name, 3, render_mode="rgb_array", max_episode_steps=3)
    theirs = gymnasium.make_vec(name, 3, "sync", render_mode="rgb_array", max_episode_steps=3)
    ours.reset(seed=2)
    theirs.reset(seed=2)
    for _ in range(6):
        for env in (ours, theirs):
            env.step(np.ones((3, 2), np.float32))
        frames = ours.render()
        assert isinstance(frames, tuple)
        assert np.array_equal(frames, theirs.render())


@pytest.mark.parametrize(("arms", "size"), [(None, (480, 480)), (1, (480, 480)), (3, (480, 480)), (30, (960, 960))])
def test_a_window_follows_the_arms(name, arms, size):
    import pygame

    make = gymnasium.make if arms is None else lambda *given, **named: gymnasium.make_vec(*given, arms, **named)
    env = make(name, render_mode="human")
    env.reset(seed=1)
    before = pygame.surfarray.array3d(pygame.display.get_surface())
    assert before.shape == (*size, 3)
    env.step(np.ones(env.action_space.shape, np.float32))
    assert (pygame.surfarray.array3d(pygame.display.get_surface()) != before).any()
    assert env.render() is None
    env.close()
    assert pygame.display.get_surface() is None


def test_a_window_that_cannot_be_is_an_error(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "no such driver")
    env = pendularm.envs.PendularmEnv(render_mode="human")
    with pytest.raises(gymnasium.error.Error, match='^render_mode="human" needs a display .*: use render_mode="rgb_'):
        env.reset()


@pytest.mark.parametrize("mode", ["ansi", "", "rgb_array_list", 1, ["human"], True])
def test_a_mode_that_is_none_is_refused(mode):
    for kind in (pendularm.envs.PendularmEnv, pendularm.envs.PendularmReachVectorEnv):
        with pytest.raises(ValueError if isinstance(mode, str) else TypeError, match="^render_mode must be None, human or rgb_array, got "):
            kind(render_mode=mode)


def test_without_pygame_only_pictures_are_missing(name, monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    env = gymnasium.make(name, render_mode="rgb_array")
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    with pytest.raises(DependencyNotInstalled, match=r'pip install "pendularm\[render\]"'):
        env.render()
    with pytest.raises(DependencyNotInstalled, match=r'pip install "pendularm\[render\]"'):
        gymnasium.make(name, render_mode="human").reset()


def test_without_a_mode_a_picture_is_none_and_a_warning_says_so():
    env = pendularm.envs.PendularmEnv()
    env.reset()
    with pytest.warns(UserWarning, match="render does nothing"):
        assert env.render() is None


@pytest.mark.parametrize("kind", [pendularm.envs.PendularmReachEnv, pendularm.envs.PendularmVectorEnv])
def test_steps_and_pictures_need_a_reset(kind):
    env = kind(render_mode="rgb_array")
    action = np.zeros(env.action_space.shape, np.float32)
    for _ in range(2):
        for call in (lambda: env.step(action), env.render):
            with pytest.raises(ResetNeeded, match="needs a reset before it"):
                call()
        env.reset(seed=0)
        env.step(action)
        env.close()


@pytest.mark.parametrize("start", ["spawn", "forkserver"])
def test_workers_that_import_gymnasium_alone_make_environments(name, start, start_child):
    """Environments made by stable-baselines3: from the name, with pictures."""
    script = f"""
import functools, gymnasium
make = functools.partial(gymnasium.make, "pendularm.envs:{name}", render_mode="rgb_array")
if __name__ == "__main__":
    envs = gymnasium.vector.AsyncVectorEnv([make, make], context="{start}")
    print(envs.reset(seed=0)[0].shape[0])
    envs.close()
"""
    assert start_child(script).stdout.read().split() == ["2"]


def test_a_video_is_recorded(name, tmp_path):
    pytest.importorskip("moviepy")
    env = gymnasium.wrappers.RecordVideo(gymnasium.make(name, render_mode="rgb_array"), str(tmp_path / "videos"))
    env.reset(seed=0)
    for _ in range(5):
        env.step(np.zeros(2, np.float32))
    env.close()
    assert next(tmp_path.glob("videos/*.mp4")).stat().st_size > 1000

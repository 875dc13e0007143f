"""The vector environments as a `VecEnv` of stable-baselines3, which accepts no vector environment of Gymnasium."""

from collections.abc import Iterable
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

# This part of stable-baselines3 needs no torch.
from stable_baselines3.common.vec_env.base_vec_env import VecEnv

from ._render import Frame

Indices = Iterable[int] | int | None


class Sb3VecEnv(VecEnv):
    """One vector environment with `num_envs` arms, which are reset in the step of their end.

    The arms share the vector environment. So `get_attr`, `set_attr` and `env_method` use it once, and return the
    same value for each arm. Options of `set_options` have no effect, as in a single environment.
    """

    def __init__(self, name: str, num_envs: int, **kwargs: Any) -> None:
        self.arms = gymnasium.make_vec(name, num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **kwargs)
        self._actions = np.zeros(self.arms.action_space.shape or (), np.float32)
        super().__init__(num_envs, self.arms.single_observation_space, self.arms.single_action_space)

    def reset(self) -> NDArray[np.float32]:
        """The first observations, from the seeds of `seed`, if it was called since the last reset."""
        observations: NDArray[np.float32] = self.arms.reset(seed=self._seeds)[0]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keeps the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Takes a step. An ended arm has its last observation as `terminal_observation` in its info, with the task's own
        entries, such as `is_success`."""
        observations, rewards, terminated, truncated, infos = self.arms.step(self._actions)
        cut = truncated & ~terminated
        each: list[dict[str, Any]] = [{"TimeLimit.truncated": one} for one in cut.tolist()]
        for arm in np.flatnonzero(terminated | truncated).tolist():
            last = {name: values[arm].item() for name, values in infos["final_info"].items() if not name.startswith("_")}
            each[arm] |= {"terminal_observation": infos["final_obs"][arm], **last}
        return observations, rewards.astype(np.float32), terminated | truncated, each

    def close(self) -> None:
        """Closes the vector environment."""
        self.arms.close()

    def get_images(self) -> tuple[Frame, ...]:
        """A frame per arm, with `render_mode="rgb_array"`."""
        return tuple(np.asarray(frame) for frame in self.arms.render() or ())

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """An attribute, once for each arm. The spaces are those of one arm."""
        if attr_name in ("observation_space", "action_space"):
            attr_name = f"single_{attr_name}"
        return self._each(getattr(self.arms, attr_name), indices)

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Sets an attribute of the vector environment."""
        setattr(self.arms, attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any) -> list[Any]:
        """Calls a method of the vector environment once, and returns its result for each arm."""
        return self._each(getattr(self.arms, method_name)(*method_args, **method_kwargs), indices)

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Indices = None) -> list[bool]:
        """No arm has a wrapper of its own."""
        return self._each(False, indices)

    def _each(self, value: Any, indices: Indices) -> list[Any]:
        return [value for _ in self._get_indices(indices)]

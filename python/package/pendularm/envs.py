"""Environments for Gymnasium, which this module's import registers: ``gymnasium.make("Pendularm-v0")``, and for many
arms ``gymnasium.make_vec("Pendularm-v0", num_envs=1024)``; `PendularmReach-v0` likewise.

The vector environments are a `Batch`. Each of their arms is what the single environment would be, to the bit, and has
a random stream of its own: under the seed `s`, arm `i` is the single environment under `s + i`, whatever their number.
They truncate themselves, and reset an arm in the call after its end, whose action is ignored
(`AutoresetMode.NEXT_STEP`). All arrays that are returned are fresh. An environment can be neither deeply copied nor
pickled, and a process that is forked while another thread steps it must not use it.
"""

import sys
from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from . import dynamics
from ._fields import is_masked, read_seeds, shown, whole_number
from ._native import Arm, Batch

__all__ = [
    "PendularmEnv",
    "PendularmReachEnv",
    "PendularmReachVectorEnv",
    "PendularmVectorEnv",
]

Observation = NDArray[np.float32]
Action = NDArray[np.float32]
Floats = NDArray[np.float64]

SUBSTEPS = 2
TIMESTEP = 0.025
"""Steps of Runge-Kutta 4 in a step of an environment, which thus takes 0.05 s."""

FASTEST = 25.0
"""Joint rate [rad/s] at which an arm counts as lost: the method carries twice as much."""


class _Task:
    """Arms that all have the same to do: how they start, what is seen of them, and what they are rewarded for."""

    strength: ClassVar[float]
    """Efforts that an action of 1 stands for, in parts of those that hold the stretched arm."""
    most_steps: ClassVar[int]
    """Steps after which an episode is truncated, unless told otherwise."""

    def __init__(self, arms: int, links: int, threads: int | None) -> None:
        self.batch = Batch(arms, links, threads=threads)
        self.batch.set_integrator("rk4", TIMESTEP)
        arm = Arm(links)
        self.links = links
        self.reach = arm.reach
        self.efforts = self.strength * dynamics.gravity_load(arm, np.zeros(links))
        self.action_space = spaces.Box(-1.0, 1.0, (links,), np.float32)
        bounds = np.array([1.0] * (2 * links) + [FASTEST] * links + self.further_bounds(), np.float32)
        self.observation_space = spaces.Box(-bounds, bounds, dtype=np.float32)

    def further_bounds(self) -> list[float]:
        return []

    def begin(self, arms: Sequence[int], random: Sequence[np.random.Generator]) -> None:
        """Puts arms where they start, each from its own stream."""
        raise NotImplementedError

    def further(self) -> list[Floats]:
        """Observations beside the joints, a row per arm."""
        return []

    def reward(self) -> Floats:
        """From 0 to 1, one per arm: an end that comes early is never a gain."""
        raise NotImplementedError

    def go_on(self, actions: Action) -> None:
        """Takes a step with every arm under its row of `actions`, (arms, links)."""
        self.batch.step(SUBSTEPS, np.clip(actions, -1.0, 1.0) * self.efforts)

    def observe(self) -> Observation:
        position, rate = self.batch.position, self.batch.velocity
        seen = [np.cos(position), np.sin(position), np.clip(rate, -FASTEST, FASTEST), *self.further()]
        return np.concatenate(seen, axis=1, dtype=np.float32, casting="same_kind")

    def lost(self) -> NDArray[np.bool_]:
        return self.batch.diverged | (np.abs(self.batch.velocity) > FASTEST).any(axis=1)


class _SwingUp(_Task):
    strength = 0.5
    most_steps = 200

    def begin(self, arms: Sequence[int], random: Sequence[np.random.Generator]) -> None:
        off = np.array([one.uniform(-0.1, 0.1, (2, self.links)) for one in random])
        off[:, 0, 0] -= np.pi / 2
        self.batch.reset(list(arms))
        self.batch.set_state(off[:, 0], off[:, 1], list(arms))

    def reward(self) -> Floats:
        height: Floats = self.batch.end_effector[:, 1]
        return 0.5 + 0.5 * height / self.reach


class _Reach(_Task):
    strength = 2.0
    most_steps = 100

    def __init__(self, arms: int, links: int, threads: int | None) -> None:
        super().__init__(arms, links, threads)
        self.targets = np.zeros((arms, 2))
        # Target less end effector, looked at twice a step.
        self.away = np.zeros((arms, 2))

    def further_bounds(self) -> list[float]:
        reach = float(Arm(self.links).reach)
        return [reach] * 2 + [2 * reach] * 2

    def begin(self, arms: Sequence[int], random: Sequence[np.random.Generator]) -> None:
        drawn = np.array([one.uniform(0.0, 1.0, self.links + 2) for one in random])
        # Every part of the disc that is not within a twentieth of its edge is as likely as any other of the same area.
        distance = 0.95 * self.reach * np.sqrt(drawn[:, 0])
        bearing = 2 * np.pi * drawn[:, 1]
        self.targets[list(arms)] = distance[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
        self.batch.reset(list(arms))
        self.batch.set_state(np.pi * (2 * drawn[:, 2:] - 1), None, list(arms))
        self.away = self.targets - self.batch.end_effector

    def go_on(self, actions: Action) -> None:
        super().go_on(actions)
        self.away = self.targets - self.batch.end_effector

    def further(self) -> list[Floats]:
        return [self.targets, self.away]

    def reward(self) -> Floats:
        return 1.0 - np.hypot(self.away[:, 0], self.away[:, 1]) / (2 * self.reach)


def _check_render_mode(render_mode: str | None) -> None:
    if render_mode is not None:
        raise ValueError(f"render_mode must be None, got {render_mode!r}")


def _checked(name: str, actions: Action, space: spaces.Space[Action]) -> Action:
    """Actions of the space's shape; which numbers they are is left to who clips them."""
    if is_masked(actions):
        raise ValueError(f"{name} must have no masked numbers, got {shown(actions)}")
    array = np.asarray(actions)
    if array.shape != space.shape or array.dtype.kind not in "biuf":
        raise ValueError(f"{name} must have the shape {space.shape}, of numbers, got {array.shape} of {array.dtype}")
    return array


def _named(refusal: ValueError, theirs: str, ours: str) -> ValueError:
    """The batch's refusal of a field, by the name that the caller knows."""
    return ValueError(str(refusal).replace(theirs, ours, 1))


class _Single(gymnasium.Env[Observation, Action]):
    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012
    task_of: ClassVar[type[_Task]]

    def __init__(self, links: int = 2, render_mode: str | None = None) -> None:
        _check_render_mode(render_mode)
        self._task = self.task_of(1, links, 1)
        self.render_mode = render_mode
        self.observation_space = self._task.observation_space
        self.action_space = self._task.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        super().reset(seed=seed, options=options)
        self._task.begin([0], [self.np_random])
        return self._task.observe()[0], {}

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        action = _checked("action", action, self.action_space)
        try:
            self._task.go_on(action[None])
        except ValueError as refusal:
            raise _named(refusal, "effort[0]", "action") from None
        return self._task.observe()[0], float(self._task.reward()[0]), bool(self._task.lost()[0]), False, {}


class _Vector(VectorEnv[Observation, Action, Any]):
    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012
    task_of: ClassVar[type[_Task]]

    def __init__(
        self,
        num_envs: int = 1,
        links: int = 2,
        max_episode_steps: int | None = None,
        threads: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        _check_render_mode(render_mode)
        if max_episode_steps is None:
            max_episode_steps = self.task_of.most_steps
        most_steps = whole_number("max_episode_steps", max_episode_steps)
        if most_steps < 1 and most_steps != -1:
            raise ValueError(f"max_episode_steps must be at least 1, or -1 for no limit, got {shown(most_steps)}")
        try:
            self._task = self.task_of(num_envs, links, threads)
        except ValueError as refusal:
            raise _named(refusal, "n_arms", "num_envs") from None
        # No arm takes so many steps in a lifetime: the largest number is no limit.
        self._most_steps = sys.maxsize if most_steps == -1 else min(most_steps, sys.maxsize)
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.single_observation_space = self._task.observation_space
        self.single_action_space = self._task.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._streams: list[tuple[np.random.Generator, int]] = []
        self._has_begun = False
        self._elapsed = np.zeros(num_envs, np.int64)
        self._ended = np.zeros(num_envs, np.bool_)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The arms' random streams."""
        return tuple(stream for stream, _ in self._drawn())

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seeds of the arms' random streams."""
        return tuple(seed for _, seed in self._drawn())

    def _drawn(self) -> list[tuple[np.random.Generator, int]]:
        """The streams with their seeds, which chance has where nobody has given any."""
        if not self._streams:
            self._streams = [seeding.np_random() for _ in range(self.num_envs)]
        return self._streams

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        mask = np.ones(self.num_envs, np.bool_)
        if options is not None and "reset_mask" in options:
            given = options["reset_mask"]
            if is_masked(given):
                raise ValueError(f"reset_mask must have no masked entries, got {shown(given)}")
            mask = np.asarray(given)
            if mask.dtype != np.bool_ or mask.shape != (self.num_envs,) or not mask.any():
                raise ValueError(f"reset_mask must be ({self.num_envs},) of bool, one of them true, got {mask!r}")
            if not self._has_begun and not mask.all():
                raise ValueError(f"reset_mask must be true of all {self.num_envs} at the first reset, got {mask!r}")
        seeds = read_seeds("seed", seed, self.num_envs)
        if not self._streams:
            self._streams = [seeding.np_random(one) for one in seeds]
        else:
            for arm in np.flatnonzero(mask).tolist():
                if seeds[arm] is not None:
                    self._streams[arm] = seeding.np_random(seeds[arm])
        self._has_begun = True
        self._begin(mask)
        return self._task.observe(), {}

    def step(
        self, actions: Action
    ) -> tuple[Observation, Floats, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        if not self._has_begun:
            raise gymnasium.error.ResetNeeded("reset has to come before the first step")
        # Arms that have ended are stepped with the others, by no effort, and begin anew wherever that leads.
        again = self._ended
        actions = np.where(again[:, None], 0, _checked("actions", actions, self.action_space))
        try:
            self._task.go_on(actions)
        except ValueError as refusal:
            raise _named(refusal, "effort", "actions") from None
        self._elapsed += 1
        rewards, lost = self._task.reward(), self._task.lost()
        if again.any():
            self._begin(again)
            rewards[again] = 0.0
            lost[again] = False
        truncated = self._elapsed >= self._most_steps
        self._ended = lost | truncated
        return self._task.observe(), rewards, lost, truncated, {}

    def _begin(self, mask: NDArray[np.bool_]) -> None:
        arms = np.flatnonzero(mask).tolist()
        self._task.begin(arms, [self._streams[arm][0] for arm in arms])
        self._elapsed[mask] = 0
        self._ended = self._ended & ~mask


_SWING_UP = """An arm that hangs is to swing up and stay, with efforts half as strong as would hold it stretched out.

    ## Action
    (links,), from -1 to 1: the effort at each joint, for 0.05 s, in parts of half of what holds the stretched arm
    there: 9.81 and 2.4525 N m for 2 links.

    ## Observation
    | index (2 links) | meaning | bounds | unit |
    | --- | --- | --- | --- |
    | 0, 1 | cosines of the joint angles | -1, 1 | |
    | 2, 3 | sines of the joint angles | -1, 1 | |
    | 4, 5 | joint rates | -25, 25 | rad/s |

    Angles are counter-clockwise, the first from +x, the others from the link before; gravity is along -y.

    ## Reward
    `(1 + y / reach) / 2` with the height y of the end effector: 0 hanging, 1 upright.

    ## Start and end
    Hanging, each angle and rate off by up to 0.1 rad and 0.1 rad/s. Terminated when a joint turns faster than 25
    rad/s; truncated after 200 steps (10 s).

    ## Arguments
    `links`, 2 or 3; the vector environment has `threads` too, those of `Batch`, and `max_episode_steps`, -1 for no
    limit.

    ## Versions
    v0: the first.
    """

_REACH = """The end effector is to come to a target and stay, with efforts twice as strong as hold the arm stretched.

    ## Action
    (links,), from -1 to 1: the effort at each joint, for 0.05 s, in parts of twice of what holds the stretched arm
    there: 39.24 and 9.81 N m for 2 links.

    ## Observation
    | index (2 links) | meaning | bounds | unit |
    | --- | --- | --- | --- |
    | 0, 1 | cosines of the joint angles | -1, 1 | |
    | 2, 3 | sines of the joint angles | -1, 1 | |
    | 4, 5 | joint rates | -25, 25 | rad/s |
    | 6, 7 | target, x and y | -reach, reach | m |
    | 8, 9 | target less end effector, x and y | -2 reach, 2 reach | m |

    Angles are counter-clockwise, the first from +x, the others from the link before; gravity is along -y.

    ## Reward
    `1 - d / (2 reach)` with the distance d of the end effector from the target: 1 there.

    ## Start and end
    At rest in any pose; the target is anywhere within 0.95 of the reach, evenly by area. Terminated when a joint turns
    faster than 25 rad/s; truncated after 100 steps (5 s).

    ## Arguments
    `links`, 2 or 3; the vector environment has `threads` too, those of `Batch`, and `max_episode_steps`, -1 for no
    limit.

    ## Versions
    v0: the first.
    """


class PendularmEnv(_Single):
    __doc__ = _SWING_UP
    task_of = _SwingUp


class PendularmVectorEnv(_Vector):
    __doc__ = _SWING_UP
    task_of = _SwingUp


class PendularmReachEnv(_Single):
    __doc__ = _REACH
    task_of = _Reach


class PendularmReachVectorEnv(_Vector):
    __doc__ = _REACH
    task_of = _Reach


for _name, _task in [("Pendularm", _SwingUp), ("PendularmReach", _Reach)]:
    gymnasium.register(
        f"{_name}-v0",
        entry_point=f"pendularm.envs:{_name}Env",
        vector_entry_point=f"pendularm.envs:{_name}VectorEnv",
        max_episode_steps=_task.most_steps,
    )

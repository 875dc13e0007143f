"""Tasks of the environments: starts, observations and rewards."""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ._fields import Floats, Method, number, shown
from ._native import Arm, Batch, end_effector, gravity_load

Observation = NDArray[np.float32]
Action = NDArray[np.float32]

STEP = 0.05
"""Simulation time [s] of a step of an environment."""

TIMESTEP = 0.005
"""Default timestep of the method [s]. With Runge-Kutta 4 the energy of a free arm changes by less than 0.1 % per
episode."""

MOST_SUBSTEPS = 10_000

UP = 0.95
"""Least height of the end effector of an arm that is up, relative to its reach."""

HOLD = 5.0
"""Time for which an underactuated arm must stay up [s]."""

FASTEST = 25.0
"""Joint rate [rad/s] at which an arm counts as lost."""


def _substeps(timestep: float) -> int:
    ratio = STEP / timestep if timestep > 0 else 0.0
    count = round(min(ratio, 2.0 * MOST_SUBSTEPS))
    if not 1 <= count <= MOST_SUBSTEPS or abs(ratio - count) > 1e-6 * count:
        raise ValueError(f"timestep must be {STEP} s divided by a whole number up to {MOST_SUBSTEPS}, got {timestep}")
    return count


class Task:
    """Arms with the same task: starts, observations and rewards."""

    strength: ClassVar[float]
    """Efforts of an action of 1, relative to the efforts that hold the stretched arm."""
    driven: ClassVar[slice] = slice(None)
    """The joints that have a motor."""
    most_steps: ClassVar[int]
    """Default number of steps after which an episode is truncated."""

    def __init__(self, arms: int, links: int, threads: int | None, method: Method, timestep: float) -> None:
        if not isinstance(method, str):
            raise TypeError(f"method must be the name of a method, got {shown(method)}")
        self.substeps = _substeps(number("timestep", timestep))
        self.batch = Batch(arms, links, threads=threads)
        self.batch.set_integrator(method, STEP / self.substeps)
        arm = Arm(links)
        self.links = links
        self.reach = arm.reach
        self.lengths = arm.lengths
        self.efforts = self.strength * gravity_load(arm, np.zeros(links))[self.driven]
        self.action_space = spaces.Box(-1.0, 1.0, self.efforts.shape, np.float32)
        bounds = np.array([1.0] * (2 * links) + [FASTEST] * links + self.further_bounds(), np.float32)
        self.observation_space = spaces.Box(-bounds, bounds, dtype=np.float32)

    def further_bounds(self) -> list[float]:
        return []

    def begin(self, arms: Sequence[int], random: Sequence[np.random.Generator]) -> None:
        """Sets the starts of arms, each from its own random stream."""
        raise NotImplementedError

    def further(self) -> list[Floats]:
        """Observations besides the joints, one row per arm."""
        return []

    def reward(self) -> Floats:
        """Rewards from 0 to 1, one per arm. They are not negative, so an early end never pays."""
        raise NotImplementedError

    def go_on(self, actions: Action) -> None:
        """Takes a step with every arm with its row of `actions`, (arms, links)."""
        # The controllers are off. This takes less time than a step with an effort.
        self.batch.disturb(np.clip(actions, -1.0, 1.0) * self.efforts, STEP)
        self.batch.step(self.substeps)

    def observe(self) -> Observation:
        position, rate = self.batch.position, self.batch.velocity
        seen = [np.cos(position), np.sin(position), np.clip(rate, -FASTEST, FASTEST), *self.further()]
        return np.concatenate(seen, axis=1, dtype=np.float32, casting="same_kind")

    def info(self) -> dict[str, NDArray[Any]]:
        """Further results of a step, one per arm."""
        return {}

    def goals(self) -> Floats:
        """The point with the highest reward of the end effector, one row per arm."""
        raise NotImplementedError

    def lost(self) -> NDArray[np.bool_]:
        return self.batch.diverged | (np.abs(self.batch.velocity) > FASTEST).any(axis=1)


class SwingUp(Task):
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

    def goals(self) -> Floats:
        return np.tile([0.0, self.reach], (self.batch.n_arms, 1))


class Underactuated(SwingUp):
    """A swing-up in which not every joint has a motor, with the time for which the arm has been up."""

    most_steps = 2000

    def __init__(self, arms: int, *settings: Any) -> None:
        super().__init__(arms, *settings)
        self.limits = np.zeros(self.links)
        self.limits[self.driven] = self.efforts
        self.batch.set_limits(self.limits)
        self.held = np.zeros(arms)

    def begin(self, arms: Sequence[int], random: Sequence[np.random.Generator]) -> None:
        super().begin(arms, random)
        self.held[list(arms)] = 0.0

    def go_on(self, actions: Action) -> None:
        efforts = np.zeros((self.batch.n_arms, self.links))
        efforts[:, self.driven] = np.clip(actions, -1.0, 1.0) * self.efforts
        self.batch.step(self.substeps, efforts)
        is_up = self.batch.end_effector[:, 1] >= UP * self.reach
        self.held = np.where(is_up, self.held + STEP, 0.0)

    def info(self) -> dict[str, NDArray[Any]]:
        # Half of a step for the rounding of the sum.
        return {"held": self.held.copy(), "is_success": self.held > HOLD - STEP / 2}


class Acrobot(Underactuated):
    strength = 4.0
    driven = slice(1, None)


class Pendubot(Underactuated):
    strength = 1.0
    driven = slice(0, 1)


class Reach(Task):
    strength = 2.0
    most_steps = 100

    def __init__(self, arms: int, *settings: Any) -> None:
        super().__init__(arms, *settings)
        self.targets = np.zeros((arms, 2))
        # Target minus end effector, computed twice per step.
        self.away = np.zeros((arms, 2))

    def further_bounds(self) -> list[float]:
        reach = float(Arm(self.links).reach)
        return [reach] * 2 + [2 * reach] * 2

    def begin(self, arms: Sequence[int], random: Sequence[np.random.Generator]) -> None:
        drawn = np.array([one.uniform(0.0, 1.0, self.links + 2) for one in random])
        # Uniform over the disc, except the outer twentieth of its radius.
        distance = 0.95 * self.reach * np.sqrt(drawn[:, 0])
        # Twice the direction of the bearing. NumPy's own sine has other bits on other processors.
        ends = end_effector(Arm(2), np.stack([2 * np.pi * drawn[:, 1], np.zeros(len(arms))], axis=1))
        self.targets[list(arms)] = distance[:, None] * (0.5 * ends)
        self.batch.reset(list(arms))
        self.batch.set_state(np.pi * (2 * drawn[:, 2:] - 1), None, list(arms))
        self.away = self.targets - self.batch.end_effector

    def go_on(self, actions: Action) -> None:
        super().go_on(actions)
        self.away = self.targets - self.batch.end_effector

    def further(self) -> list[Floats]:
        return [self.targets, self.away]

    def reward(self) -> Floats:
        # The square root is exactly rounded everywhere, other than `np.hypot`.
        return 1.0 - np.sqrt(self.away[:, 0] ** 2 + self.away[:, 1] ** 2) / (2 * self.reach)

    def goals(self) -> Floats:
        return self.targets


TASKS: dict[str, type[Task]] = {
    "Pendularm": SwingUp,
    "PendularmReach": Reach,
    "PendularmAcrobot": Acrobot,
    "PendularmPendubot": Pendubot,
}
"""By the names of the environments, without their version."""

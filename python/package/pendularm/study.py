"""The effect of method and timestep on the arm, predicted and measured, with the members of the services ``/study/*``.

Long computations release the interpreter's lock, and Ctrl-C ends them. An answer with arrays is equal only to itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._fields import Floats, shown
from ._native import Arm

if TYPE_CHECKING:
    from .method import Method

__all__ = [
    "Critical",
    "OwnPlan",
    "Plan",
    "Rollout",
    "Stability",
    "SuggestedGains",
    "plan",
    "rollout",
    "stability",
    "suggest_gains",
]


@dataclass(frozen=True)
class Critical:
    """The motion that grows first in the worst pose, 10 % beyond the limit."""

    growth_per_step: float
    """Factor by which it grows in a step; 1 if the growth is below rounding."""
    frequency: float
    """Its frequency [Hz]; half of the steps per second if it changes its sign at every step."""
    joint: int
    """The joint with the largest motion, from 0."""


@dataclass(frozen=True, eq=False)
class Stability:
    """Limits of the timesteps and the control period of a control loop [s]: the end of the first stable range. `None`
    means that no unstable time was found, 0 that no stable one was found."""

    control_period_limit: float | None
    """The limit of the control period at `equilibrium`, of an arm that moves exactly between two runs of the law."""
    timestep_limit: float | None
    """The limit of the timestep at `equilibrium`, at the requested control period."""
    timestep_limit_held: float | None
    """At `equilibrium`, with the effort held over the step, as the live arm does."""
    timestep_limit_continuous: float | None
    """At `equilibrium`, with the control law in every stage of the method."""
    equilibrium: Floats
    """The pose in which the loop rests [rad], (links,)."""
    equilibrium_kind: str
    """`setpoint`, `sagging`, `hanging`, `saddle` or `unstable`."""
    minimum_over_poses_held: float | None
    """The smallest over all poses, effort held; 0 if a joint has an integral and the loop diverges in some pose."""
    minimum_over_poses_continuous: float | None
    """The smallest over all poses, control in every stage."""
    minimum_over_poses_bound: float | None
    """A timestep up to which every pose is stable; `None` if no useful bound is known."""
    bound_is_proven: bool
    """Whether that bound needs no estimate of gravity's effect. It holds up to rounding."""
    certified: bool
    """Whether the bound is within 1 % of `minimum_over_poses_held`."""
    worst_pose: Floats | None
    """The pose of `minimum_over_poses_held` [rad], (links,)."""
    critical: Critical | None
    """The motion that grows there first; `None` if nothing grows 10 % beyond the limit."""
    timestep_limit_motion: float | None
    """The largest timestep at which the coming motion does not overflow; `None` if nothing moves."""
    motion_speed: float
    """The speed of the fastest link in that motion [rad/s]."""
    advised_timestep: float | None
    """0.8 of the smaller of that and the minimum over poses. If the minimum is 0, the advice is only for this
    setpoint. `None` also for a control period longer than the advice."""
    advised_duration: float | None
    """Time in which a free arm's energy hardly ever doubles at that timestep [s]; `None` under control."""


@dataclass(frozen=True, eq=False)
class Rollout:
    """An offline run, sample by sample, with its cost and its error."""

    times: Floats
    """[s], (samples,)."""
    positions: Floats
    """[rad], (samples, links)."""
    velocities: Floats
    """[rad/s], (samples, links)."""
    efforts: Floats
    """Efforts of the steps that led to the samples [N m], (samples, links)."""
    energy: Floats
    """Kinetic plus potential [J], (samples,)."""
    evaluations: int
    """Number of evaluations of the dynamics in the run."""
    wall_time: float
    """Run time of the run alone [s]."""
    error: float | None
    """Largest distance of a joint from the reference [rad]; `None` without a reference, or if the uncertainty is too
    large."""
    error_uncertainty: float | None
    """Three times the largest distance of two of four references from each other, at least one last digit [rad]."""
    sampling_error: float | None
    """Largest distance of a joint from a loop whose law acts at every instant [rad]; `None` as for `error`."""
    sampling_error_uncertainty: float | None
    """Largest distance of two runs of that loop from each other [rad]."""
    divergence: tuple[int, float] | None
    """Step and time [s] of a divergence, if there was one. The samples end before it."""


class OwnPlan(NamedTuple):
    """The cheapest run found of a method of one's own within the error."""

    timestep: float
    """[s]."""
    evaluations: int
    """Number of evaluations of the dynamics."""
    error: float
    """Largest error of the end effector [m]."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The cheapest method and timestep within an allowed error, and the cost of the other methods."""

    integrator: str
    timestep: float
    """[s]."""
    control_period: float | None
    """The timestep [s], unless another period was requested; `None` for a free arm."""
    evaluations_per_second: float
    """Evaluations of the dynamics per simulated second."""
    error: float
    """Largest error of the end effector [m]."""
    error_uncertainty: float
    """Uncertainty of the reference [m]."""
    methods: list[str]
    """All methods within the error, the cheapest first. The next three members have the same order."""
    timesteps: Floats
    evaluations: NDArray[np.uint64]
    errors: Floats
    own: OwnPlan | None
    """The run by `method`; `None` without one, or if it costs over 16 times as much as the plan."""


@dataclass(frozen=True, eq=False)
class SuggestedGains:
    """Gains with which every pose is predicted stable and ten moves settle in time, with their results."""

    kp: Floats
    """[N m/rad], (links,)."""
    ki: Floats
    """[N m/(rad s)], (links,)."""
    kd: Floats
    """[N m s/rad], (links,)."""
    timestep_limit: float | None
    """A timestep up to which every pose is stable [s]; `None` if nothing limits."""
    certified: bool
    """Whether the smallest limit over all poses is within 1 % of it."""
    margin: float | None
    """This limit divided by the timestep."""
    settled_after: float
    """Settling time of the slowest of ten moves [s]."""


def _tableau(name: str, method: Any) -> dict[str, Any] | None:
    found: dict[str, Any] | None = getattr(method, "_tableau", None)
    if method is not None and found is None:
        raise ValueError(f"{name} must be a Method, got {shown(method)}")
    return found


def suggest_gains(
    arm: Arm | None = None,
    *,
    settling_time: float = 4.0,
    margin: float = 1.25,
    timestep: float = 0.001,
    integrator: str = "rk4",
) -> SuggestedGains:
    """Finds gains for an arm and a timestep [s], as ``/study/gains`` does.

    `margin`, at least 1, is the required ratio of the smallest timestep limit over all poses to the timestep. Ten
    moves must settle within `settling_time` [s]. Raises `ValueError` if there are no such gains.
    """
    return SuggestedGains(**_native.suggest_gains(locals()))


def stability(
    arm: Arm | None = None,
    *,
    integrator: str = "rk4",
    gains: Mapping[str, ArrayLike | None] | SuggestedGains | None = None,
    setpoint: ArrayLike | None = None,
    q: ArrayLike | None = None,
    qd: ArrayLike | None = None,
    control_period: float = 0.0,
) -> Stability:
    """Predicts the largest timestep at which a control loop is stable, as ``/study/stability`` does.

    `gains` are `kp`, `ki` and `kd`, (links,) each, or suggested gains. Missing ones are the default gains, and zeros
    examine a free arm.
    `setpoint` [rad] is the starting pose by default. `q` [rad] and `qd` [rad/s] are the state at the start of the
    coming motion. The law runs once per `control_period` [s], 0 for every step.
    """
    found = _native.stability(locals())
    critical = found.pop("critical")
    return Stability(**found, critical=None if critical is None else Critical(**critical))


def rollout(
    arm: Arm | None = None,
    *,
    q0: ArrayLike | None = None,
    qdot0: ArrayLike | None = None,
    duration: float = 10.0,
    timestep: float = 0.001,
    integrator: "str | Method" = "rk4",
    gains: Mapping[str, ArrayLike | None] | SuggestedGains | None = None,
    setpoint: ArrayLike | None = None,
    samples: int = 1001,
    reference: bool | np.bool_ = False,
    control_period: float = 0.0,
) -> Rollout:
    """Runs an arm offline with the live arm's own steps, as ``/study/rollout`` does.

    It begins at `q0` [rad] and `qdot0` [rad/s] (zeros by default). `duration` [s], at least one timestep, is rounded
    to the nearest number of timesteps. The result has `samples`, including start and end, or every step if there are
    fewer. Without `gains` the arm is free, and a `setpoint` is refused. With
    `reference` the run is compared with the true motion under the same held control law, and with the loop whose law
    acts at every instant. The law runs once per `control_period` [s], 0 for every step. `integrator` may be a `Method`.
    """
    arguments = locals() | {"tableau": getattr(integrator, "_tableau", None)}
    if arguments["tableau"] is not None:
        arguments["integrator"] = "rk4"
    return Rollout(**_native.rollout(arguments))


def plan(
    error: float,
    arm: Arm | None = None,
    *,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    qdot0: ArrayLike | None = None,
    gains: Mapping[str, ArrayLike | None] | SuggestedGains | None = None,
    setpoint: ArrayLike | None = None,
    control_period: float = 0.0,
    method: "Method | None" = None,
) -> Plan:
    """Finds the method and timestep that keep the end effector within `error` [m] at least cost, as ``/study/plan``
    does.

    Without `gains` the arm is free for `duration` [s] (10 by default) from `q0` [rad] and `qdot0` [rad/s], and a
    `setpoint` is refused. With `gains` it moves to `setpoint` [rad] (4 s by default), and holding the effort counts
    as error, unless the `control_period` [s] is given. Raises `ValueError` if
    the motion cannot be known that well for that long. A `method` is planned beside the arm's.
    """
    found = _native.plan(locals() | {"tableau": _tableau("method", method)})
    own = found.pop("own")
    return Plan(**found, own=own and OwnPlan(*own))

"""The effect of method and timestep on the arm, predicted and measured, with the members of the services ``/study/*``.

Long computations release the interpreter's lock, and Ctrl-C ends them. An answer with arrays is equal only to itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, SupportsIndex, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._fields import AntiWindup, Floats, Method, OwnMethod, VelocitySource, made, number, present_name, renamed, shown
from ._native import Arm, Simulation, as_doubles
from ._native import plan as _plan, rollout as _rollout, stability as _stability, suggest_gains as _suggest_gains

if TYPE_CHECKING:
    from typing_extensions import Unpack

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
    """Limits of the timesteps and the control period of a control loop [s]: the end of the first stable range. `inf`
    means that no unstable time was found, 0 that no stable one was found, and `nan` that a value is not known.

    They hold while no effort is at its limit. The steps of encoders are left out."""

    control_period_limit: float
    """The limit of the control period at `equilibrium`, of an arm that moves exactly between two runs of the law."""
    timestep_limit: float
    """The limit of the timestep at `equilibrium`, at the requested control period."""
    timestep_limit_held: float
    """At `equilibrium`, with the effort held over the step, as the live arm does."""
    timestep_limit_continuous: float
    """At `equilibrium`, with the control law in every stage of the method."""
    equilibrium: Floats
    """The pose in which the loop rests [rad], (links,)."""
    equilibrium_kind: str
    """`setpoint`, `sagging`, `hanging`, `saddle` or `unstable`."""
    minimum_over_poses_held: float
    """The smallest over all poses, effort held; 0 if a joint has an integral and the loop diverges in some pose."""
    minimum_over_poses_continuous: float
    """The smallest over all poses, control in every stage."""
    minimum_over_poses_bound: float
    """A timestep up to which every pose is stable; `nan` if no useful bound is known."""
    bound_is_proven: bool
    """Whether that bound needs no estimate of gravity's effect. It holds up to rounding."""
    certified: bool
    """Whether the bound is within 1 % of `minimum_over_poses_held`."""
    worst_pose: Floats | None
    """The pose of `minimum_over_poses_held` [rad], (links,)."""
    critical: Critical | None
    """The motion that grows there first; `None` if nothing grows 10 % beyond the limit."""
    timestep_limit_motion: float
    """The largest timestep at which the coming motion does not overflow; `inf` if nothing moves."""
    motion_speed: float
    """The speed of the fastest link in that motion [rad/s]."""
    advised_timestep: float
    """0.8 of the smaller of that and the minimum over poses. If the minimum is 0, the advice is only for this
    setpoint. `nan` for a control period longer than the advice."""
    advised_duration: float
    """Time in which a free arm's energy hardly ever doubles at that timestep [s]; `nan` under control."""


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
    error: float
    """Largest distance of a joint from the reference [rad]; `nan` without a reference, or if the uncertainty is too
    large."""
    error_uncertainty: float
    """Three times the largest distance of two of four references from each other, at least one last digit [rad]."""
    sampling_error: float
    """Largest distance of a joint from a loop whose law acts at every instant [rad]; `nan` as for `error`, and if an
    effort was at its limit."""
    sampling_error_uncertainty: float
    """Largest distance of two runs of that loop from each other [rad]."""
    divergence: tuple[int, float] | None
    """Step and time [s] of a divergence, if there was one. The samples end before it."""
    reference_positions: Floats | None
    """Positions of the reference [rad], (samples, links), if they were requested; `nan` once it is lost."""
    reference_velocities: Floats | None
    """[rad/s]."""


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

    method: Method
    timestep: float
    """[s]."""
    control_period: float
    """The timestep [s], unless another period was requested; `nan` for a free arm."""
    evaluations_per_second: float
    """Evaluations of the dynamics per simulated second."""
    error: float
    """Largest error of the end effector [m]."""
    error_uncertainty: float
    """Uncertainty of the reference [m]."""
    methods: list[Method]
    """All methods within the error, the cheapest first. The next three members have the same order."""
    timesteps: Floats
    evaluations: NDArray[np.uint64]
    errors: Floats
    own: OwnPlan | None
    """The run by `method`; `None` without one, or if it costs over 16 times as much as the plan."""

    @property
    def integrator(self) -> Method:
        """An older name of `method`."""
        present_name("integrator")
        return self.method


@dataclass(frozen=True, eq=False)
class SuggestedGains:
    """Gains with which every pose is predicted stable and ten moves settle in time, with their results."""

    kp: Floats
    """[N m/rad], (links,)."""
    ki: Floats
    """[N m/(rad s)], (links,)."""
    kd: Floats
    """[N m s/rad], (links,)."""
    timestep_limit: float
    """A timestep up to which every pose is stable [s]; `inf` if nothing limits."""
    certified: bool
    """Whether the smallest limit over all poses is within 1 % of it."""
    margin: float
    """This limit divided by the timestep."""
    settled_after: float
    """Settling time of the slowest of ten moves [s]."""


def _tableau(method: object) -> dict[str, object] | None:
    """The tableau of a method of one's own; `None` for anything else."""
    found: dict[str, object] | None = getattr(method, "_tableau", None)
    return found


GainsLike = Mapping[str, ArrayLike | None] | SuggestedGains
"""Gains by their names, or suggested ones. A missing one is that of a new arm."""


class Robot(TypedDict, total=False):
    """The motors and sensors of a robot: keyword arguments of the functions here, and of `Simulation`."""

    control_period: float
    """The time between two runs of the control law [s], 0 for every step."""
    control_delay: SupportsIndex
    """The number of control periods after which an effort is applied, 0 to 16."""
    effort_limit: ArrayLike | None
    """The largest effort of each motor [N m], (links,); `inf` is no limit, 0 no motor."""
    anti_windup: AntiWindup
    tracking_time: float
    """The time in which `back_calculation` removes an excess of effort [s]."""
    encoder_step: ArrayLike | None
    """The step of each encoder [rad], (links,); 0 is exact."""
    velocity_source: VelocitySource


_IDEAL: Robot = {
    "control_period": 0.0,
    "control_delay": 0,
    "effort_limit": None,
    "anti_windup": "clamp",
    "tracking_time": 0.2,
    "encoder_step": None,
    "velocity_source": "exact",
}


def _arguments(given: dict[str, object]) -> dict[str, object]:
    """The arguments of a function of the compiled part, from the `locals()` of one here."""
    robot = given.pop("robot")
    assert isinstance(robot, dict)
    if unknown := robot.keys() - _IDEAL.keys():
        raise TypeError(f"there is no argument {min(unknown)!r}")
    return {**given, **_IDEAL, **robot}


@renamed
def suggest_gains(
    arm: Arm | None = None,
    *,
    settling_time: float = 4.0,
    margin: float = 1.25,
    timestep: float = 0.001,
    method: Method = "rk4",
    **robot: Unpack[Robot],
) -> SuggestedGains:
    """Finds gains for an arm and a timestep [s], as ``/study/gains`` does.

    `margin`, at least 1, is the required ratio of the smallest timestep limit over all poses to the timestep. Ten
    moves must settle within `settling_time` [s]. `robot` has the motors and sensors, as `Simulation` takes them. Raises
    `ValueError` if there are no such gains.
    """
    return made(SuggestedGains, _suggest_gains(_arguments(locals())))


@renamed
def stability(
    arm: Arm | None = None,
    *,
    method: Method = "rk4",
    gains: GainsLike | None = None,
    setpoint: ArrayLike | None = None,
    q: ArrayLike | None = None,
    qd: ArrayLike | None = None,
    controller: bool | np.bool_ = True,
    **robot: Unpack[Robot],
) -> Stability:
    """Predicts the largest timestep at which a control loop is stable, as ``/study/stability`` does.

    `gains` are `kp`, `ki` and `kd`, (links,) each, or suggested gains. Missing ones are those of a new arm.
    `setpoint` [rad] is the starting pose by default. Without `controller` the arm is free, and both are refused. `q`
    [rad] and `qd` [rad/s] are the state at the start of the coming motion. `robot` has control period, delay, motors and
    sensors, as `Simulation` takes them.
    """
    found = _stability(_arguments(locals()))
    critical = found["critical"]
    return made(Stability, {**found, "critical": None if critical is None else made(Critical, critical)})


@renamed
def rollout(
    arm: Arm | None = None,
    *,
    q: ArrayLike | None = None,
    qd: ArrayLike | None = None,
    duration: float = 10.0,
    timestep: float = 0.001,
    method: Method | OwnMethod = "rk4",
    gains: GainsLike | None = None,
    setpoint: ArrayLike | None = None,
    samples: int = 1001,
    reference: bool | np.bool_ = False,
    controller: bool | np.bool_ = True,
    t_eval: ArrayLike | None = None,
    effort: ArrayLike | Callable[[float, Floats, Floats], ArrayLike] | None = None,
    return_reference: bool | np.bool_ = False,
    **robot: Unpack[Robot],
) -> Rollout:
    """Runs an arm offline with the live arm's own steps, as ``/study/rollout`` does.

    It begins at `q` [rad] and `qd` [rad/s] (zeros by default). `duration` [s], at least one timestep, is rounded
    to the nearest number of timesteps. The result has `samples`, including start and end, or every step if there are
    fewer. `gains` and `setpoint` are those of `stability`. Without `controller` the arm is free, and both are refused.
    With `reference` the run is compared with the true motion under the same held control law, and with the loop whose law
    acts at every instant. `return_reference` adds the samples of the true motion.

    `t_eval` [s] has the times of the samples, in place of `duration` and `samples`. Each sample is at the nearest step.

    `effort` [N m] acts in place of the controller: (links,) all the time, (periods, links) with a row for each control
    period, or a function `effort(t, q, qd)`, called once per control period. The last row also acts later. The reference has
    the same efforts. `robot` has control period, delay, motors and sensors, as `Simulation` takes them. An `effort` has no
    delay and no sensors. `method` may be a `Method`; an `effort` is then an array.
    """
    given = _arguments(locals())
    given["tableau"] = _tableau(method)
    if given["tableau"] is not None:
        given["method"] = "rk4"
    if effort is not None:
        for name in ("gains", "setpoint"):
            if given[name] is not None:
                raise ValueError(f"{name} has no effect with an effort, got {shown(given[name])}")
        given["controller"] = False
        if callable(effort):
            if given["tableau"] is not None:
                raise TypeError("effort must be an array with a Method")
            given["effort"] = _played(effort, given)
    return made(Rollout, _rollout(given))


def _played(effort: Callable[[float, Floats, Floats], ArrayLike], given: Mapping[str, Any]) -> list[Floats]:
    """The efforts of a function in a run, one for each control period."""
    names = ("arm", "method", "timestep", "control_period", "effort_limit")
    run = Simulation(**{name: given[name] for name in names})
    start = [np.zeros(run.links) if given[name] is None else given[name] for name in ("q", "qd")]
    run.set_state(*start)
    end = given["duration"] if given["t_eval"] is None else np.max(given["t_eval"], initial=0.0)
    most = min(number("duration", end) / run.timestep, 1e7)
    each, found = round(run.effective_control_period / run.timestep), []
    while run.steps < most and run.divergence is None:
        row = as_doubles(effort(run.time, run.position, run.velocity))
        found.append(row)
        run.step(each, row)
    return found


@renamed
def plan(
    error: float,
    arm: Arm | None = None,
    *,
    duration: float | None = None,
    q: ArrayLike | None = None,
    qd: ArrayLike | None = None,
    gains: GainsLike | None = None,
    setpoint: ArrayLike | None = None,
    controller: bool | np.bool_ = True,
    method: OwnMethod | None = None,
    **robot: Unpack[Robot],
) -> Plan:
    """Finds the method and timestep that keep the end effector within `error` [m] at least cost, as ``/study/plan``
    does.

    The arm moves from `q` [rad] and `qd` [rad/s] to `setpoint` [rad] (for `duration` 4 s by default), with `gains` as in
    `stability`. Holding the effort counts as error, unless the `control_period` [s] is given. Without `controller` it is
    free (10 s), and both are refused. `robot` has control period, delay, motors and sensors, as `Simulation` takes them.
    A `method` is planned beside the arm's. Raises `ValueError` if the motion cannot be known that well for that long.
    """
    given = _arguments(locals())
    given["tableau"] = _tableau(method)
    if method is not None and given["tableau"] is None:
        raise TypeError(f"method must be a Method, got {shown(method)}")
    found = _plan(given)
    own = found.pop("own")
    assert own is None or isinstance(own, tuple)
    return made(Plan, {**found, "own": own and OwnPlan(*own)})

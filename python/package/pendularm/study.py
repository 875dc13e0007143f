"""The effect of method and timestep on the arm, predicted and measured: the answers of the services ``/study/*``.

Long computations release the interpreter's lock, and Ctrl-C ends them. An answer with arrays is equal to
itself alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._native import Arm

__all__ = [
    "Critical",
    "Plan",
    "Rollout",
    "Stability",
    "SuggestedGains",
    "plan",
    "rollout",
    "stability",
    "suggest_gains",
]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Critical:
    """The motion that grows first in the worst pose, 10 % beyond the limit."""

    growth_per_step: float
    """Factor by which it grows in a step."""
    frequency: float
    """How often it swings [Hz]; half of the steps per second where it flips at every step."""
    joint: int
    """The joint that it moves furthest, from 0."""


@dataclass(frozen=True, eq=False)
class Stability:
    """The largest stable timesteps and control period of a control loop [s]. `None`: nothing limits; 0: unstable at every timestep."""

    control_period_limit: float | None
    """The longest stable control period at `equilibrium`, of an arm that moves exactly between two runs of the law."""
    timestep_limit: float | None
    """The longest stable timestep at `equilibrium`, at the control period that was asked about."""
    timestep_limit_held: float | None
    """At `equilibrium`, with the effort held over the step, as the live arm does."""
    timestep_limit_continuous: float | None
    """At `equilibrium`, with the control law in every stage of the method."""
    equilibrium: Floats
    """The pose in which the loop rests [rad], (links,)."""
    equilibrium_kind: str
    """`setpoint`, `sagging`, `hanging`, `saddle` or `unstable`."""
    minimum_over_poses_held: float | None
    """The smallest over all poses, effort held; 0 where a joint integrates and the loop runs away in some pose."""
    minimum_over_poses_continuous: float | None
    """The smallest over all poses, control in every stage."""
    minimum_over_poses_bound: float | None
    """A timestep up to which every pose is stable; `None` where nothing useful is known."""
    bound_is_proven: bool
    """Whether that bound is proven; otherwise an estimate of gravity's part is inside."""
    certified: bool
    """Whether the bound is within 1 % of `minimum_over_poses_held`."""
    worst_pose: Floats | None
    """The pose of `minimum_over_poses_held` [rad], (links,)."""
    critical: Critical | None
    """The motion that grows there first."""
    timestep_limit_motion: float | None
    """The largest timestep at which the coming motion does not overflow; `None` where nothing moves."""
    motion_speed: float
    """The speed of the fastest link in that motion [rad/s]."""
    advised_timestep: float | None
    """0.8 of the smaller of that and the minimum over poses; where that is 0 it is for this setpoint alone."""
    advised_duration: float | None
    """How long a free arm keeps its energy to a factor of two at that timestep [s]; `None` under control."""


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
    """How often the run evaluated the dynamics."""
    wall_time: float
    """How long the run took by itself [s]."""
    error: float | None
    """Largest distance of a joint from the reference [rad]; `None` without one, or where it is not known so well."""
    error_uncertainty: float | None
    """Largest distance of two references from each other [rad]."""
    sampling_error: float | None
    """Largest distance of a joint from a loop whose law acts at every instant [rad]; `None` as for `error`."""
    sampling_error_uncertainty: float | None
    """Largest distance of two runs of that loop from each other [rad]."""
    divergence: tuple[int, float] | None
    """Step and time [s] at which the run left the finite numbers, if it did; the samples end before."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The cheapest method and timestep within an allowed error, and what the other methods would cost."""

    integrator: str
    timestep: float
    """[s]."""
    control_period: float | None
    """The timestep too [s], unless another was asked for; `None` for an arm left to itself."""
    evaluations_per_second: float
    """Evaluations of the dynamics per simulated second."""
    error: float
    """How far the end effector was off at most [m]."""
    error_uncertainty: float
    """How far the truth may be off [m]."""
    methods: list[str]
    """All that are within the error, the cheapest first; the next three go with it."""
    timesteps: Floats
    evaluations: NDArray[np.uint64]
    errors: Floats


@dataclass(frozen=True, eq=False)
class SuggestedGains:
    """Gains that are stable in every pose and settle in time, and how they fared."""

    kp: Floats
    """[N m/rad], (links,)."""
    ki: Floats
    """[N m/(rad s)], (links,)."""
    kd: Floats
    """[N m s/rad], (links,)."""
    timestep_limit: float | None
    """The smallest stable timestep over all poses [s]; `None` where nothing limits."""
    certified: bool
    """Whether a lower bound comes within 1 % of it."""
    margin: float | None
    """How many timesteps it is."""
    settled_after: float
    """How long the slowest of ten moves took to settle [s]."""


def suggest_gains(
    arm: Arm | None = None,
    *,
    settling_time: float = 4.0,
    margin: float = 1.25,
    timestep: float = 0.001,
    integrator: str = "rk4",
) -> SuggestedGains:
    """Finds gains for an arm and a timestep [s], as ``/study/gains`` does.

    The smallest stable timestep over all poses is to be `margin` timesteps, 1 at least, and ten moves are to settle
    within `settling_time` [s]. Raises `ValueError` where there are none.
    """
    return SuggestedGains(
        **_native.suggest_gains(
            arm, settling_time=settling_time, margin=margin, timestep=timestep, integrator=integrator
        )
    )


def stability(
    arm: Arm | None = None,
    *,
    integrator: str = "rk4",
    gains: Mapping[str, ArrayLike] | None = None,
    setpoint: ArrayLike | None = None,
    q: ArrayLike | None = None,
    qd: ArrayLike | None = None,
    control_period: float = 0.0,
) -> Stability:
    """Predicts the largest timestep at which a control loop is stable, as ``/study/stability`` does.

    `gains` are `kp`, `ki` and `kd`, (links,) each; those that are left out are the default ones, and zeros ask about
    an arm left to itself. `setpoint` [rad] is the starting pose unless given. `q` [rad] and `qd` [rad/s] are the state
    from which the motion is ahead. The law runs once per `control_period` [s], 0 for every step.
    """
    found = _native.stability(
        arm, integrator=integrator, gains=gains, setpoint=setpoint, q=q, qd=qd, control_period=control_period
    )
    critical = found.pop("critical")
    return Stability(**found, critical=None if critical is None else Critical(**critical))


def rollout(
    arm: Arm | None = None,
    *,
    q0: ArrayLike | None = None,
    qdot0: ArrayLike | None = None,
    duration: float = 10.0,
    timestep: float = 0.001,
    integrator: str = "rk4",
    gains: Mapping[str, ArrayLike] | None = None,
    setpoint: ArrayLike | None = None,
    samples: int = 1001,
    reference: bool | np.bool_ = False,
    control_period: float = 0.0,
) -> Rollout:
    """Runs an arm offline with the live arm's own steps, as ``/study/rollout`` does.

    It begins at `q0` [rad] and `qdot0` [rad/s] (zeros unless given), lasts `duration` [s], a timestep at least and
    rounded to the nearest number of timesteps, and gives `samples`, start and end among them, or every step if there
    are fewer. Without `gains` nothing controls the arm, and no `setpoint` may be given; a member that is left out of
    them is zeros. With `reference` the run is compared with the true motion under the same held control law,
    and with the loop whose law acts at every instant. The law runs once per `control_period` [s], 0 for every step.
    """
    return Rollout(
        **_native.rollout(
            arm,
            q0=q0,
            qdot0=qdot0,
            duration=duration,
            timestep=timestep,
            integrator=integrator,
            gains=gains,
            setpoint=setpoint,
            samples=samples,
            reference=reference,
            control_period=control_period,
        )
    )


def plan(
    error: float,
    arm: Arm | None = None,
    *,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    qdot0: ArrayLike | None = None,
    gains: Mapping[str, ArrayLike] | None = None,
    setpoint: ArrayLike | None = None,
    control_period: float = 0.0,
) -> Plan:
    """Finds the method and timestep that keep the end effector within `error` [m] at least cost, as ``/study/plan``
    does.

    Without `gains` the arm is left to itself for `duration` [s] (10 unless given) from `q0` [rad] and `qdot0` [rad/s],
    and no `setpoint` may be given; with them it moves to `setpoint` [rad] (4 s unless given), and holding the effort
    counts as error, unless the `control_period` [s] is given. A member that is left out of them is zeros. Raises `ValueError` where the motion cannot be known so
    well for so long.
    """
    return Plan(
        **_native.plan(
            error,
            arm,
            duration=duration,
            q0=q0,
            qdot0=qdot0,
            gains=gains,
            setpoint=setpoint,
            control_period=control_period,
        )
    )

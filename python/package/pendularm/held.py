"""The largest stable control period of any robot near a pose, from its mass matrix and its gains."""

from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import ArrayLike

from ._fields import Floats, Method, made, number, shown, whole_number
from ._native import as_doubles, held_limit as _held_limit, is_masked

__all__ = ["HeldLimit", "HeldMode", "held_limit"]

_MOST_JOINTS = 64

Between = Literal["exact", "semi_implicit", "implicit"] | Method
"""The motion between two runs of the law."""


@dataclass(frozen=True, eq=False)
class HeldMode:
    """The motion that grows first, at a period 1 % beyond the limit."""

    growth_per_period: float
    """Factor by which it grows in a period."""
    frequency: float
    """Its frequency [Hz]; half of the periods per second if it reverses at every one."""
    joint: int
    """The joint that moves most, from 0."""
    mode: Floats
    """The motion of each joint relative to that of `joint`; negative if it moves against it, (joints,)."""
    reverses: bool
    """Whether it reverses at every period: `kd` is too large for the inertia. Otherwise it oscillates."""


@dataclass(frozen=True, eq=False)
class HeldLimit:
    """Limits of a sampled loop. `inf` means that there is none, 0 that a mode grows at every period, and `nan` that a value is
    not known."""

    period_limit: float
    """The largest control period up to which no mode grows [s], at the same number of steps in a period."""
    critical: HeldMode | None
    """The motion that grows just beyond it."""
    effective_inertia: Floats
    """The inertia that each joint moves while the others are free [kg m²], (joints,)."""
    stable: bool | None
    """Whether no mode grows at the given `period`. Without one this is `None`, and the following are `nan`."""
    growth_per_period: float
    """Factor by which the fastest growing mode grows in this period, or the slowest decaying one decays."""
    timestep_limit: float
    """The largest timestep at this period [s]; `inf` for exact motion."""
    kd_factor_limit: float
    """The largest factor by which `kd` may be multiplied at this period."""
    armature: float
    """The least inertia that makes this period stable if it is added to each joint [kg m²]."""
    explanation: str
    """The result in words and numbers. Joints are counted from 0."""


def _rows(name: str, value: Any) -> list[list[float]]:
    try:
        if is_masked(value):
            raise ValueError
        array = as_doubles(value)
    except (TypeError, ValueError, OverflowError) as why:
        kind = TypeError if isinstance(why, TypeError) else ValueError
        raise kind(f"{name} must be an array of numbers, got {shown(value)}") from None
    if array.ndim > 2 or any(length > _MOST_JOINTS for length in array.shape):
        raise ValueError(f"{name} must have at most {_MOST_JOINTS} rows of numbers, got the shape {array.shape}")
    rows: list[list[float]] = (array.reshape(1, -1) if array.ndim < 2 else array).tolist()
    return rows


def _time(name: str, value: Any) -> float | None:
    if value is None:
        return None
    time = number(name, value)
    if not 0.0 < time < float("inf"):
        raise ValueError(f"{name} must be finite and greater than 0, got {shown(value)}")
    return time


def held_limit(
    M: ArrayLike,  # noqa: N803
    *,
    kp: ArrayLike | None = None,
    kd: ArrayLike | None = None,
    ki: ArrayLike | None = None,
    damping: ArrayLike | None = None,
    stiffness: ArrayLike | None = None,
    period: float | None = None,
    delay: int = 0,
    between: Between = "exact",
    timestep: float | None = None,
    steps: int = 1,
) -> HeldLimit:
    """The limits of a law ``u = -kp x - kd v - ki ∫x`` that runs once a `period` [s] and whose effort is held until the
    next run, `delay` periods later, on a robot ``M v' = u - damping v - stiffness x`` of up to 64 joints near a pose.

    `M` is the mass matrix at the pose [kg m²]. Each other matrix is one number for all joints, one for each, or n×n.
    `stiffness` is the gradient of gravity and springs.

    `between` is the motion between two runs: `exact`; `semi_implicit` Euler, as game engines use it; `implicit`, which
    is implicit in `damping` as MuJoCo's `Euler` and `implicitfast` are; or one of the four methods of the arm. A method
    takes `steps` steps in a period, or steps of `timestep` [s].
    """
    length, step = _time("period", period), _time("timestep", timestep)
    count = whole_number("steps", steps)
    if step is not None:
        if length is None:
            raise ValueError("timestep needs a period")
        count = round(length / step)
        if count < 1 or abs(count * step - length) > 1e-6 * length:
            raise ValueError(f"period must be a whole number of timesteps, got {shown(period)} and {shown(timestep)}")
    numbers = {"delay": whole_number("delay", delay), "steps": count}
    for name, given in numbers.items():
        if not 0 <= given < 2**63:
            raise ValueError(f"{name} must be at least 0 and less than 2^63, got {shown(given)}")
    if not isinstance(between, str):
        raise TypeError(f"between must be a name, got {shown(between)}")
    matrices = {"kp": kp, "kd": kd, "ki": ki, "damping": damping, "stiffness": stiffness}
    arguments: dict[str, Any] = {"M": _rows("M", M)}
    arguments |= {name: [] if value is None else _rows(name, value) for name, value in matrices.items()}
    answer = _held_limit(arguments | numbers | {"period": length, "between": between})
    critical = answer["critical"]
    return made(HeldLimit, answer | {"critical": None if critical is None else made(HeldMode, critical)})

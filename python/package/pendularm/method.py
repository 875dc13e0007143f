"""A method of one's own by its tableau: order, faults, stability, and its cost on the arm."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._fields import Floats, made, shown
from ._native import Arm, amplification, analyse_method, is_masked, is_too_long, tableau as _checked
from .study import SuggestedGains

__all__ = ["Method", "MethodAnalysis"]


@dataclass(frozen=True, eq=False)
class MethodAnalysis:
    """What is known about a method. A limit of `inf` is beyond the search."""

    stages: int
    evaluations: int
    """Evaluations of the dynamics in a step."""
    order: int
    """The order by the conditions of rooted trees, at most 6."""
    failing_condition: str | None
    """The first condition that fails, in words."""
    embedded_order: int | None
    """The order of `b_hat`."""
    faults: list[str]
    """Sums that are inconsistent, in words."""
    measured_order: float
    """The order on a free swing of the arm; `nan` if the errors are not finite."""
    real_limit: float
    """The largest `x` with stability on `[-x, 0]`."""
    imaginary_limit: float
    """The largest `y` with stability on `[-iy, iy]`."""
    symplectic: bool
    """Whether it is symplectic, for a constant mass matrix and forces that depend on positions only."""
    region_extent: Floats
    """The left end, the right end and the upper end of `region`. Its lower end is 0, (3,)."""
    region: list[str]
    """The upper half of the region of stability, drawn in rows from the top: `#` where no mode grows."""
    timestep_limit_held: float
    """The largest timestep of the arm's loop if the law runs in every step [s]."""
    timestep_limit: float
    """The largest timestep of the arm's loop at the requested control period [s]; 0 if none was found."""
    swing_evaluations: int | None
    """The fewest evaluations found with an error of 1e-6 rad on the swing; `None` if too many are needed."""
    methods: list[str]
    """The arm's methods."""
    swing_evaluations_of_methods: list[int | None]
    """The same number for each of `methods`."""

    @property
    def picture(self) -> str:
        """`region` with its ends."""
        left, right, top = self.region_extent
        lines = [f"|{row}|" for row in self.region]
        return "\n".join([f"{top:.2f} i", *lines, f"{left:<.2f}{right:>{len(self.region[0]) - 3}.2f}"])


def _entry(name: str, value: Any) -> str:
    if isinstance(value, str | int | float | Fraction | np.integer | np.floating) and not isinstance(value, bool):
        # Python does not print integers with thousands of digits.
        with suppress(ValueError):
            return str(value)
    raise TypeError(f'{name} must be a number or a fraction such as "1/3", got {shown(value)}')


def _entries(name: str, value: Any) -> list[Any]:
    if isinstance(value, np.ndarray) and value.ndim and not is_masked(value):
        value = value.tolist()
    if not isinstance(value, Sequence) or isinstance(value, str | bytes | bytearray | range):
        raise TypeError(f"{name} must be a list, got {shown(value)}")
    return list(value)


def _row(name: str, value: Any) -> list[str] | None:
    if value is None:
        return None
    return [_entry(f"{name}[{index}]", one) for index, one in enumerate(_entries(name, value))]


def _rows(name: str, value: Any) -> list[list[str] | None] | None:
    if value is None:
        return None
    return [_row(f"{name}[{index}]", [] if one is None else one) for index, one in enumerate(_entries(name, value))]


class Method:
    """An explicit Runge-Kutta method of at most 12 stages, by its tableau.

    Coefficients are numbers, fractions, or texts such as ``"1/3"``. Row `i` of `a` has at least `i` entries, and those
    on and right of the diagonal are 0. `b` has the weights. `c`, the times of the stages, is compared with the rows of
    `a`. `b_hat` has the weights of an embedded method. `a_q` and `b_q` are for positions, if they differ from those of
    velocities: a partitioned pair, such as Störmer's method.
    """

    def __init__(
        self,
        a: Sequence[Any] | ArrayLike,
        b: Sequence[Any] | ArrayLike,
        *,
        c: Sequence[Any] | ArrayLike | None = None,
        b_hat: Sequence[Any] | ArrayLike | None = None,
        a_q: Sequence[Any] | ArrayLike | None = None,
        b_q: Sequence[Any] | ArrayLike | None = None,
    ) -> None:
        tableau: dict[str, Any] = {"name": None, "a": _rows("a", a), "a_q": _rows("a_q", a_q)}
        lists = {"b": b, "c": c, "b_hat": b_hat, "b_q": b_q}
        self._set(tableau | {name: _row(name, value) for name, value in lists.items()})

    def _set(self, tableau: dict[str, Any]) -> None:
        self.stages, self.evaluations = _checked(tableau)
        self._tableau = tableau

    @classmethod
    def named(cls, name: str) -> "Method":
        """A method of textbooks, such as ``"dormand_prince5"``. A wrong name is refused with the list of all."""
        if not isinstance(name, str):
            raise TypeError(f"name must be a text, got {shown(name)}")
        found = cls.__new__(cls)
        found._set(dict.fromkeys(("a", "b", "c", "b_hat", "a_q", "b_q")) | {"name": name})
        return found

    def analyse(
        self,
        arm: Arm | None = None,
        *,
        gains: Mapping[str, ArrayLike | None] | SuggestedGains | None = None,
        setpoint: ArrayLike | None = None,
        control_period: float = 0.0,
    ) -> MethodAnalysis:
        """What is known about the method, on this arm and its loop, as ``/study/method`` does.

        `gains`, `setpoint` [rad] and `control_period` [s] are those of `stability`.
        """
        loop = {"arm": arm, "gains": gains, "setpoint": setpoint, "control_period": control_period}
        return made(MethodAnalysis, analyse_method(loop | {"tableau": self._tableau}))

    def amplification(self, z: Any) -> Floats:
        """The factor of a mode in a step, for each `z`: its eigenvalue times the timestep. It has the shape of `z`.

        No mode grows where it is at most 1. `z` and its conjugate have the same factor.
        """
        try:
            if is_too_long(z) or is_masked(z):
                raise ValueError
            points = np.asarray(z)
            if points.dtype.kind not in "iufc":
                raise TypeError
            points = points.astype(complex)
        except (TypeError, ValueError, OverflowError) as why:
            kind = TypeError if isinstance(why, TypeError) else ValueError
            raise kind(f"z must be an array of numbers, got {shown(z)}") from None
        factors = amplification(self._tableau, points.real.ravel().tolist(), points.imag.ravel().tolist())
        return np.array(factors).reshape(points.shape)

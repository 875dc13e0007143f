"""Readers of arguments by field name. A wrong value raises a `ValueError`, and a wrong type a `TypeError`, that names
the field."""

import operator
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, Literal, ParamSpec, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ._native import PromisedFloats, as_doubles, is_masked, is_too_long

Floats = NDArray[np.float64]

Method = Literal["euler", "midpoint", "verlet", "rk4"]
"""The name of a method."""


class OwnMethod(Protocol):
    """A `Method` of one's own, for the functions of the study, which `Method` imports."""

    _tableau: dict[str, Any]


AntiWindup = Literal["clamp", "none", "conditional", "back_calculation"]
"""What the integral does while an effort is at its limit."""

VelocitySource = Literal["exact", "difference"]
"""How the controller measures velocities."""

P = ParamSpec("P")
T = TypeVar("T")


def promised(function: Callable[P, T]) -> Callable[P, T]:
    """The function in the floating-point environment of the results, for example without flush-to-zero."""

    @wraps(function)
    def inside(*args: P.args, **kwargs: P.kwargs) -> T:
        with PromisedFloats():
            return function(*args, **kwargs)

    return inside


OLDER = {"integrator": "method", "q0": "q", "qdot0": "qd"}
"""Older names of arguments, which a later version will not have."""


def present_name(name: str) -> str:
    """The present name of an argument of the calling function. An older one is warned of in the line that called it."""
    if name in OLDER:
        warnings.warn(f"{name} is an older name of {OLDER[name]}", DeprecationWarning, 3)
    return OLDER.get(name, name)


def renamed(function: Callable[P, T]) -> Callable[P, T]:
    """The function, which also takes the older names of its arguments."""

    @wraps(function)
    def inside(*args: P.args, **kwargs: P.kwargs) -> T:
        for name in OLDER.keys() & kwargs.keys():
            present = present_name(name)
            if present in kwargs:
                raise TypeError(f"{name} is an older name of {present}: pass one of them")
            kwargs[present] = kwargs.pop(name)
        return function(*args, **kwargs)

    return inside


def made(kind: Callable[..., T], found: object) -> T:
    """A result of the compiled part, whose names are those of the members."""
    assert isinstance(found, dict)
    return kind(**found)


class Arrays(Mapping[str, NDArray[Any]]):
    """Arrays by name: a mapping that is read-only, and equal only to itself."""

    def __init__(self, found: Mapping[str, NDArray[Any]]) -> None:
        self._found = dict(found)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._found})"


class Gains(Arrays):
    """The gains `kp` [N m/rad], `ki` [N m/(rad s)] and `kd` [N m s/rad], (links,) each."""


def shown(value: Any) -> str:
    """A value as shown in an error. Python does not print integers with thousands of digits, and some objects raise."""
    try:
        return f"{value!r:.60}"
    except Exception:
        return f"an object of {type(value)}"


def whole_number(name: str, value: Any) -> int:
    try:
        if not isinstance(value, bool) and not is_masked(value):
            return operator.index(value)
    except TypeError:
        pass
    raise TypeError(f"{name} must be a whole number, got {shown(value)}")


def read_seeds(name: str, value: Any, arms: int) -> list[int | None]:
    """One seed for each arm. A single seed is for the first arm, and the others get the following ones."""

    def seed(part: str, one: Any) -> int:
        found = whole_number(part, one)
        if found < 0:
            raise ValueError(f"{part} must be at least 0, got {shown(found)}")
        return found

    if value is None:
        return [None] * arms
    is_one = value.ndim == 0 if isinstance(value, np.ndarray) else not isinstance(value, Sequence)
    if is_one or isinstance(value, str | bytes | bytearray):
        first = seed(name, value)
        return [first + arm for arm in range(arms)]
    if len(value) != arms:
        raise ValueError(f"{name} must be one number, or one for each of {arms}, got {len(value)}")
    return [None if one is None else seed(f"{name}[{arm}]", one) for arm, one in enumerate(value)]


def flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name} must be True or False, got {shown(value)}")
    return bool(value)


def as_array(name: str, value: Any) -> NDArray[Any]:
    """The value as an array of any type."""
    try:
        if not is_too_long(value):
            return np.asarray(value)
    except ValueError:
        pass
    raise ValueError(f"{name} must be an array, got {shown(value)}")


def number(name: str, value: Any) -> float:
    if is_masked(value):
        raise ValueError(f"{name} must have no masked numbers, got {shown(value)}")
    try:
        return float(numbers(value))
    except OverflowError:
        raise ValueError(f"{name} must be finite, got a number that no double holds") from None
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a number, got {shown(value)}") from None


def numbers(value: Any) -> Floats:
    """The value as doubles. Texts, `None`, complex numbers and endless sequences are refused."""
    if is_too_long(value):
        raise ValueError
    return as_doubles(value)


def path(name: str, value: str | os.PathLike[str]) -> Path:
    try:
        found = Path(value)
    except TypeError:
        raise TypeError(f"{name} must be a path, got {shown(value)}") from None
    if "\0" in str(found):
        raise ValueError(f"{name} must be a path, got {shown(value)}")
    return found

"""Readers of arguments by field name. A wrong value raises a `ValueError` that names the field."""

import operator
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Floats",
    "as_array",
    "flag",
    "is_masked",
    "number",
    "numbers",
    "path",
    "read_seeds",
    "shown",
    "whole_number",
]

Floats = NDArray[np.float64]

MOST_LISTED = 10_000_000
"""Most entries of a sequence that is not a NumPy array."""


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
    raise ValueError(f"{name} must be a whole number, got {shown(value)}")


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
        raise ValueError(f"{name} must be True or False, got {shown(value)}")
    return bool(value)


def is_masked(value: Any, depth: int = 2) -> bool:
    """Whether some of the numbers are masked. NumPy reads masked numbers also inside lists, down to this depth."""
    if isinstance(value, np.ma.MaskedArray):
        return bool(np.ma.is_masked(value))
    parts: Iterable[Any] = ()
    if isinstance(value, list | tuple):
        parts = value
    elif isinstance(value, np.ndarray) and value.dtype.hasobject:
        parts = value.flat
    return depth > 0 and any(is_masked(one, depth - 1) for one in parts)


def is_too_long(value: Any, depth: int = 2) -> bool:
    """Whether NumPy would allocate more than `MOST_LISTED` entries for it, for example for a range."""
    if hasattr(value, "__array__") or not hasattr(value, "__len__"):
        return False
    try:
        if len(value) > MOST_LISTED:
            return True
    except OverflowError:
        return True
    return depth > 0 and isinstance(value, list | tuple) and any(is_too_long(one, depth - 1) for one in value)


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
        raise ValueError(f"{name} must be a number, got {shown(value)}") from None


def numbers(value: Any) -> Floats:
    """The value as doubles. Texts, `None`, complex numbers and endless sequences are refused."""
    if is_too_long(value):
        raise ValueError
    array = np.asarray(value)
    if array.dtype.kind == "O":
        # NumPy would read texts, convert None to NaN, and drop imaginary parts.
        if any(one is None or isinstance(one, str | bytes | np.complexfloating) for one in array.flat):
            raise TypeError
        return array.astype(np.float64)
    return array.astype(np.float64, casting="same_kind")


def path(name: str, value: str | os.PathLike[str]) -> Path:
    try:
        found = Path(value)
    except TypeError:
        raise ValueError(f"{name} must be a path, got {shown(value)}") from None
    if "\0" in str(found):
        raise ValueError(f"{name} must be a path, got {shown(value)}")
    return found

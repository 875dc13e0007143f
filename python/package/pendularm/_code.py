"""A text of a function's code that is the same in every process of one version of Python."""

import hashlib
from collections.abc import Callable
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np


def fingerprint(name: str, function: Callable[..., Any]) -> str:
    """A hash of the function's code, with its defaults and its closure.

    Global functions and values are not included. Raises `ValueError`, by `name`, for a callable that is not a plain
    function, and for one whose closure has a value without a stable text.
    """
    if not isinstance(function, FunctionType):
        raise ValueError(
            f"{name} must be a plain function, because a folder identifies it by its code, got {function!r:.60}"
        )
    return hashlib.sha256(_told(name, function, ()).encode()).hexdigest()


def _told(name: str, value: Any, around: tuple[int, ...]) -> str:
    """A value as a text. `around` are the values that contain it."""
    if id(value) in around:
        return f"around {around.index(id(value))}"
    around = (*around, id(value))

    def each(values: Any) -> str:
        return ", ".join(_told(name, one, around) for one in values)

    match value:
        case None | bool() | int() | float() | complex() | str() | bytes() | np.generic():
            return f"{type(value).__name__} {value!r}"
        case _ if value is Ellipsis:
            return "..."
        case tuple() | list():
            return f"{type(value).__name__} ({each(value)})"
        case set() | frozenset():
            return f"{type(value).__name__} ({', '.join(sorted(_told(name, one, around) for one in value))})"
        case dict():
            return f"dict ({each(value.items())})"
        case np.ma.MaskedArray():
            return f"masked ({each([value.data, np.ma.getmaskarray(value)])})"
        case np.ndarray() if not value.dtype.hasobject:
            return f"array {value.dtype.str} {value.shape} {value.tobytes().hex()}"
        case ModuleType():
            return f"module {value.__name__}"
        case type():
            return f"type {value.__module__}.{value.__qualname__}"
        case CodeType():
            names = (value.co_names, value.co_varnames, value.co_freevars, value.co_cellvars)
            return f"code {value.co_code.hex()} {value.co_flags} {names} ({each(value.co_consts)})"
        case FunctionType():
            held = [cell.cell_contents for cell in value.__closure__ or ()]
            return f"function ({each([value.__code__, value.__defaults__, value.__kwdefaults__, held])})"
    raise ValueError(
        f"{name} must be a function that holds only plain values: a folder identifies it by them, got {value!r:.60}"
    )

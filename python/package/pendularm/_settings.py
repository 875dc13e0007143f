"""The settings of a sweep: their names, their values as arrays, and arms with these values."""

import re
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from ._fields import numbers, shown, whole_number
from ._native import Batch, is_masked

TRIED_AT_ONCE = 16_384
"""Values of a setting that one `Batch` checks before the sweep begins."""

STATES = ("setpoint", "q", "qd")
LIMITS = ("effort_limit", "anti_windup", "tracking_time")
SENSORS = ("encoder_step", "velocity_source")
PER_JOINT = ("lengths", "masses", "viscous", "kp", "ki", "kd", *STATES, "effort_limit", "encoder_step")
NAMES = ("method", "anti_windup", "velocity_source")
SETTINGS = (*PER_JOINT, "gravity", "timestep", *NAMES, "tracking_time", "control_period", "control_delay")


def column(name: str, values: list[Any], links: int) -> Any:
    """Values of a setting, one row each."""
    if name not in SETTINGS:
        raise ValueError(f"there is no setting {name!r}; the settings are {', '.join(SETTINGS)}")
    if name in NAMES:
        if not all(isinstance(value, str) for value in values):
            raise TypeError(f"every {name} must be a name, got {shown(values)}")
        return np.array([str(value) for value in values])
    if name == "control_delay":
        return np.array([whole_number(f"every {name}", value) for value in values])
    if is_masked(values):
        raise ValueError(f"every {name} must have no masked numbers, got {shown(values)}")
    try:
        if name in PER_JOINT:
            array = np.array([np.broadcast_to(numbers(value), (links,)) for value in values])
        else:
            array = np.array([float(numbers(value)) for value in values])
    except OverflowError:
        raise ValueError(f"every {name} must be finite, got a number that no double holds") from None
    except (TypeError, ValueError) as why:
        each = f" or an array of {links}" if name in PER_JOINT else ""
        kind = TypeError if isinstance(why, TypeError) else ValueError
        raise kind(f"every {name} must be a number{each}, got {shown(values)}") from None
    # Other faults are refused by the same names when the values are tried.
    if name in STATES and not np.isfinite(array).all():
        row, joint = np.argwhere(~np.isfinite(array))[0]
        raise ValueError(f"{name}[{row}][{joint}] must be finite, got {array[row, joint]}")
    return array


def present_values(name: str, values: list[Any]) -> list[Any]:
    """The values of a setting. Booleans are an older form of delays, and warned of as in `present_name`."""
    is_flag = [name == "control_delay" and isinstance(value, bool | np.bool_) for value in values]
    if any(is_flag):
        text = "control_delay is a number of control periods: 1 for True and 0 for False"
        warnings.warn(text, DeprecationWarning, 3)
    return [int(value) if older else value for value, older in zip(values, is_flag, strict=True)]


def begin(settings: Mapping[str, Any], arms: int, links: int) -> Batch:
    """Arms with these settings, one row per arm."""
    batch = Batch(arms, links, threads=1)

    def of(*names: str) -> dict[str, Any]:
        return {name: settings[name] for name in names if name in settings}

    settings = {**settings, **{name: settings[name].tolist() for name in NAMES if name in settings}}
    batch.set_params(**of("gravity", "masses", "lengths", "viscous"))
    batch.set_integrator(**of("method", "timestep"))
    batch.set_limits(**of(*LIMITS))
    batch.set_sensors(**of(*SENSORS))
    batch.set_control_period(**of("control_period", "control_delay"))
    batch.set_gains(**of("kp", "ki", "kd"))
    if "setpoint" in settings:
        batch.set_setpoint(settings["setpoint"])
    still = np.zeros((arms, links))
    batch.set_state(settings.get("q", still), settings.get("qd", still))
    return batch


def try_values(name: str, values: Any, links: int) -> None:
    """Sets the values on arms, several at once, so a bad one is refused with its name and index."""
    for start in range(0, len(values), TRIED_AT_ONCE):
        some = values[start : start + TRIED_AT_ONCE]
        try:
            begin({name: some}, len(some), links)
        except ValueError as refusal:
            said = str(refusal)
            # The batch counts from the first of these.
            row = re.match(rf"{name}\[(\d+)\]", said)
            if row:
                said = f"{name}[{start + int(row[1])}]{said[row.end() :]}"
            raise ValueError(said) from None

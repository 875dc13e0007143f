"""The settings of a sweep: their names, their values as arrays, and arms with these values."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ._fields import flag, numbers, shown
from ._native import Batch, is_masked

TRIED_AT_ONCE = 16_384
"""Values of a setting that one `Batch` checks before the sweep begins."""

PER_JOINT = ("lengths", "masses", "kp", "ki", "kd", "setpoint", "q0", "qdot0")
STATES = ("setpoint", "q0", "qdot0")
SETTINGS = (*PER_JOINT, "gravity", "timestep", "method", "control_period", "control_delay")


def column(name: str, values: list[Any], links: int) -> Any:
    """Values of a setting, one row each."""
    if name not in SETTINGS:
        raise ValueError(f"there is no setting {name!r}; the settings are {', '.join(SETTINGS)}")
    if name == "method":
        if not all(isinstance(value, str) for value in values):
            raise ValueError(f"every method must be a name, got {shown(values)}")
        return np.array([str(value) for value in values])
    if name == "control_delay":
        return np.array([flag(f"every {name}", value) for value in values])
    if is_masked(values):
        raise ValueError(f"every {name} must have no masked numbers, got {shown(values)}")
    try:
        if name in PER_JOINT:
            array = np.array([np.broadcast_to(numbers(value), (links,)) for value in values])
        else:
            array = np.array([float(numbers(value)) for value in values])
    except OverflowError:
        raise ValueError(f"every {name} must be finite, got a number that no double holds") from None
    except (TypeError, ValueError):
        each = f" or an array of {links}" if name in PER_JOINT else ""
        raise ValueError(f"every {name} must be a number{each}, got {shown(values)}") from None
    # Other faults are refused by the same names when the values are tried.
    if name in STATES and not np.isfinite(array).all():
        row, joint = np.argwhere(~np.isfinite(array))[0]
        raise ValueError(f"{name}[{row}][{joint}] must be finite, got {array[row, joint]}")
    return array


def begin(settings: Mapping[str, Any], arms: int, links: int) -> Batch:
    """Arms with these settings, one row per arm."""
    batch = Batch(arms, links, threads=1)

    def of(*names: str) -> dict[str, Any]:
        return {name: settings[name] for name in names if name in settings}

    batch.set_params(**of("gravity", "masses", "lengths"))
    if "method" in settings:
        batch.set_integrator(settings["method"].tolist())
    batch.set_integrator(**of("timestep"))
    batch.set_control_period(**of("control_period", "control_delay"))
    batch.set_gains(**of("kp", "ki", "kd"))
    if "setpoint" in settings:
        batch.set_setpoint(settings["setpoint"])
    still = np.zeros((arms, links))
    batch.set_state(settings.get("q0", still), settings.get("qdot0", still))
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

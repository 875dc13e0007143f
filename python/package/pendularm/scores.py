"""Scores of the environments that anyone can recompute, bit for bit, here and by the command ``pendularm score``.

A submission is a mapping, or a JSON file of it: `version`, `task`, `seed`, `actions`, `trail` and `score`. `actions` has
a row per step, or is the name of a policy: `rest`, no effort, or `pump`, full effort in the direction of each joint's
motion. `trail` has a hash after each step, over all bits so far. Doubles are 16 hexadecimal digits of their bits.

It needs Gymnasium, as `pendularm.envs` does.
"""

import json
import os
import struct
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._fields import Floats, numbers, path, promised, shown, whole_number

if TYPE_CHECKING:
    from ._tasks import Task

__all__ = ["score", "submission"]

Submission = dict[str, str | int | list[str] | list[list[str]]]

POLICIES = {"rest": 0.0, "pump": 1.0}

MOST_BYTES = 1 << 20
"""Most bytes of a submission. The longest episode has some 80,000."""


def submission(task: str, seed: int, actions: ArrayLike | str) -> Submission:
    """The submission of an episode of a single environment: `task` is the name of one of the four, reset with `seed`, below
    2^32, and then stepped with each row of `actions`, (steps, motors), or by a policy. `json.dump` writes it.

    The episode ends with the actions, or when the task ends it. Raises `ValueError` for further actions.
    """
    played = _task(task)
    rows = actions if isinstance(actions, str) else _rows(actions, played.efforts.size)
    found, steps = _played(task, played, seed, rows)
    if not isinstance(rows, str) and len(rows) > steps:
        raise ValueError(f"actions must end with the episode, after {steps} steps, got {len(rows)}")
    return found


def score(file: str | os.PathLike[str] | Mapping[str, object]) -> float:
    """Recomputes a submission, and returns its score, the sum of the rewards.

    Raises `ValueError` for a submission that differs, with the first step at which it does. Step 0 is the start.
    """
    given = file if isinstance(file, Mapping) else _parsed(path("file", file))
    if set(given) != {"version", "task", "seed", "actions", "trail", "score"}:
        raise ValueError(f"not a submission: it has the names {', '.join(map(str, given))}")
    if given["version"] != version("pendularm"):
        raise ValueError(f"made by another version, {given['version']!r}")
    actions, trail, task, seed = given["actions"], given["trail"], given["task"], given["seed"]
    if not isinstance(task, str) or not isinstance(seed, int) or not isinstance(trail, list):
        raise ValueError("not a submission: task must be a text, seed a whole number, and trail a list")
    played = _task(task)
    rows: Floats | str = actions if isinstance(actions, str) else _doubles(actions, played.efforts.size)
    found, steps = _played(task, played, seed, rows)
    expected = found["trail"]
    assert isinstance(expected, list)
    departs = next((step for step, one in enumerate(expected) if trail[step : step + 1] != [one]), None)
    if departs is None and (found["score"] != given["score"] or trail != expected or found["actions"] != actions):
        departs = steps
    if departs is not None:
        raise ValueError(f"{task}, seed {seed}: refused, departs at step {departs}")
    return float(_double(found["score"]))


def _parsed(file: Path) -> Mapping[str, object]:
    with file.open("rb") as opened:
        text = opened.read(MOST_BYTES)
    try:
        given = json.loads(text)
    except (ValueError, RecursionError) as why:
        raise ValueError(f"not a submission: {why}") from None
    if not isinstance(given, dict):
        raise ValueError(f"not a submission: {shown(given)}")
    return given


def _rows(actions: ArrayLike, motors: int) -> Floats:
    try:
        rows = numbers(actions)
    except (TypeError, ValueError, OverflowError) as why:
        kind = TypeError if isinstance(why, TypeError) else ValueError
        raise kind(f"actions must be an array of numbers, or a policy, got {shown(actions)}") from None
    if rows.ndim != 2 or rows.shape[1] != motors or not np.isfinite(rows).all():
        raise ValueError(f"actions must be finite, with the shape (steps, {motors}), got {shown(actions)}")
    return rows


def _doubles(actions: object, motors: int) -> Floats:
    is_listed = isinstance(actions, list) and all(isinstance(row, list) and len(row) == motors for row in actions)
    if not isinstance(actions, list) or not is_listed:
        raise ValueError(f"not a submission: actions must be rows of {motors} texts, or a policy, got {shown(actions)}")
    return np.array([[_double(one) for one in row] for row in actions])


def _digits(number: float) -> str:
    return struct.pack(">d", number).hex()


def _double(text: object) -> float:
    try:
        number: float = struct.unpack(">d", bytes.fromhex(text))[0] if isinstance(text, str) else np.nan
    except (ValueError, struct.error):
        number = np.nan
    if not np.isfinite(number) or _digits(number) != text:
        raise ValueError(f"an action must be 16 hexadecimal digits of a finite double, got {shown(text)}")
    return number


def _chained(link: int, *numbers: NDArray[np.float64]) -> int:
    """FNV-1a by words. Each factor is odd, so no later word hides a changed one."""
    for one in numbers:
        for word in one.ravel().view(np.uint64).tolist():
            link = (link ^ word) * 0x100000001B3 % 2**64
    return link


def _task(name: str) -> "Task":
    """One arm with a task."""
    from ._tasks import TASKS, TIMESTEP

    if not isinstance(name, str):
        raise TypeError(f"task must be a text, got {shown(name)}")
    tasks = {f"{name}-v0": task for name, task in TASKS.items()}
    if name not in tasks:
        raise ValueError(f"no task {name!r}")
    return tasks[name](1, 2, 1, "rk4", TIMESTEP)


@promised
def _played(task: str, played: "Task", seed: int, actions: Floats | str) -> tuple[Submission, int]:
    """The submission of an episode with these actions, until its end, and its steps."""
    seed = whole_number("seed", seed)
    if not 0 <= seed < 2**32:
        raise ValueError(f"seed must be at least 0 and less than 2^32, got {shown(seed)}")
    if isinstance(actions, str) and actions not in POLICIES:
        raise ValueError(f"no policy {actions!r}")
    batch, most = played.batch, played.most_steps
    if not isinstance(actions, str) and len(actions) > most:
        raise ValueError(f"more than {most} actions")
    played.begin([0], [np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))])
    target = getattr(played, "targets", np.empty(0))
    link = _chained(0xCBF29CE484222325, target, batch.position, batch.velocity)
    trail, total, steps = [f"{link:016x}"], 0.0, 0
    while steps < (most if isinstance(actions, str) else len(actions)) and not played.lost()[0]:
        if isinstance(actions, str):
            action = np.where(batch.velocity[:, played.driven] >= 0, POLICIES[actions], -POLICIES[actions])
        else:
            action = actions[steps : steps + 1]
        played.go_on(action)
        reward = played.reward()
        link = _chained(link, action, batch.position, batch.velocity, reward)
        trail.append(f"{link:016x}")
        total += float(reward[0])
        steps += 1
    return {
        "version": version("pendularm"),
        "task": task,
        "seed": seed,
        "actions": actions if isinstance(actions, str) else [[_digits(one) for one in row] for row in actions[:steps]],
        "trail": trail,
        "score": _digits(total),
    }, steps

"""One metric for many settings: on this machine's cores, or on a cluster through an executor.

A sweep is divided into pieces, each a `Batch`. The results do not depend on the number of workers or the size of a
piece.
"""

import errno
import math
import os
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from itertools import islice
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ._code import fingerprint
from ._fields import Arrays, Floats, as_array, flag, number, path, present_name, promised, shown, whole_number
from ._native import BUILD, Batch, is_masked
from ._pieces import Folder, PieceResults, hand_out
from ._settings import begin, column, present_values, try_values

__all__ = ["Executor", "Metric", "Run", "Sweep", "sweep"]

TIMESTEP = 0.001
"""Default timestep [s]."""

SETTLED = 0.02
"""Largest distance of a joint from its setpoint at which an arm counts as settled [rad]."""

MOST_SETTINGS = 10_000_000
"""Most combinations of one sweep. Their results are kept in memory, about 100 MB per metric."""

MOST_SAMPLES = 100_000
"""Most samples of a run, as in a rollout."""

MOST_STEPS = 10_000_000
"""Most steps of a run, as in a rollout."""

AT_ONCE = 1_000_000
"""Steps of all arms together between two checks whether the sweep was stopped: some tens of milliseconds."""

MOST_ROWS = 10_000_000
"""Most samples times settings of a piece: about 1 GB on the worker."""

MOST_ARMS = 1_000_000
"""Most settings of a piece, which are the arms of a `Batch`."""


@dataclass(frozen=True, eq=False)
class Run:
    """The motion of a piece's arms, for a metric."""

    times: Floats
    """[s], (samples, arms): the nearest whole step of each arm."""
    positions: Floats
    """[rad], (samples, arms, links). A diverged arm keeps its last finite positions."""
    velocities: Floats
    """[rad/s], (samples, arms, links)."""
    efforts: Floats
    """Efforts of the steps that led to the samples [N m], (samples, arms, links)."""
    energy: Floats
    """Kinetic plus potential [J], (samples, arms)."""
    setpoint: Floats
    """[rad], (arms, links)."""
    diverged: NDArray[np.bool_]
    """(arms,)."""


Columns = dict[str, NDArray[Any]]
"""Values of settings by their names, each with a row per value."""

Metric = Callable[[Run], NDArray[Any] | Mapping[str, NDArray[Any]]]
"""One number per arm, or several by name. It must not mix the arms."""


class Executor(Protocol):
    """An object that returns futures as in `concurrent.futures`."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]: ...


class Sweep(Arrays):
    """The results: a mapping from the metrics' names to arrays with the shape of the grid."""

    def __init__(self, grid: dict[str, list[Any]], found: Mapping[str, NDArray[Any]]) -> None:
        super().__init__(found)
        self.grid = grid
        """The values of each axis by the names of the grid, in its order."""


def final_error(run: Run) -> Floats:
    """Largest distance of a joint from its setpoint at the end [rad]; infinite if the arm diverged."""
    away: Floats = np.abs(run.positions[-1] - run.setpoint).max(axis=1)
    return np.where(run.diverged, np.inf, away)


def settling_time(run: Run) -> Floats:
    """Time after which every joint stays within 0.02 rad of its setpoint [s]; infinite if one does not at the end."""
    away: NDArray[np.bool_] = np.any(np.abs(run.positions - run.setpoint) > SETTLED, axis=2)
    still = np.cumsum(away[::-1], axis=0)[::-1] == 0
    first = np.argmax(still, axis=0)
    time = np.take_along_axis(run.times, first[None], axis=0)[0]
    return np.where(still[-1] & ~run.diverged, time, np.inf)


def largest_effort(run: Run) -> Floats:
    """Largest effort of a joint at the samples [N m]."""
    largest: Floats = np.abs(run.efforts).max(axis=(0, 2))
    return largest


def energy_drift(run: Run) -> Floats:
    """Largest distance of the energy at the samples from that at the start [J]; infinite if the arm diverged."""
    drift: Floats = np.abs(run.energy - run.energy[0]).max(axis=0)
    return np.where(run.diverged, np.inf, drift)


METRICS: dict[str, Metric] = {
    one.__name__: one for one in (final_error, settling_time, largest_effort, energy_drift)
}


def sweep(
    grid: Mapping[str, Iterable[Any]],
    metric: str | Metric = "settling_time",
    *,
    links: int = 2,
    duration: float = 4.0,
    samples: int = 401,
    controller: bool = True,
    executor: Executor | None = None,
    folder: str | os.PathLike[str] | None = None,
    piece: int | None = None,
    progress: bool = True,
    **settings: Any,
) -> Sweep:
    """Runs an arm for every combination of the settings in `grid`, and returns the `metric` of each run.

    Settings are `lengths` [m], `masses` [kg], `viscous` [N m s/rad], `kp` [N m/rad], `ki` [N m/(rad s)], `kd`
    [N m s/rad], `setpoint` [rad], `q` [rad], `qd` [rad/s], `effort_limit` [N m] and `encoder_step` [rad], a number for all
    joints or one for each; `gravity` [m/s²], `timestep` [s], `method`, `control_period` [s], `control_delay`,
    `anti_windup`, `tracking_time` [s] and `velocity_source`. `grid` has a sequence for each setting that varies. Others are
    keyword arguments, and a missing one has the value of a fresh runtime. Without `controller` the controller is off.
    Every run lasts `duration` [s], at least one timestep, rounded to the nearest number of timesteps. It has `samples`,
    including start and end.

    `metric` is `settling_time` [s], `final_error` [rad], `largest_effort` [N m], `energy_drift` [J], or a function of
    a `Run`, which an executor must be able to send.

    Pieces of `piece` settings (1024 by default, fewer with many samples) are submitted to `executor`, an object that
    returns futures as in `concurrent.futures` (for example Dask's `Client.get_executor()`). Without one, they run on
    as many threads as there are cores, or fewer if the system refuses some. Every finished piece is stored in
    `folder`, and a stopped sweep continues there. The folder identifies a function by its code, without global names,
    so it must be a plain function. Ctrl-C ends a sweep on threads soon. Raises `ValueError` for an invalid setting,
    and if the folder has another sweep.
    """
    if not isinstance(grid, Mapping):
        raise TypeError(f"grid must be a mapping from settings to their values, got {shown(grid)}")
    axes = {}
    for name, values in grid.items():
        try:
            # The parts of a text would be characters or numbers.
            if isinstance(values, str | bytes | bytearray):
                raise TypeError
            name = present_name(name)
            axes[name] = present_values(name, list(islice(values, MOST_SETTINGS + 1)))
        except TypeError:
            raise TypeError(f"grid[{name!r}] must be a sequence of values, got {shown(values)}") from None
    for name in list(settings):
        value = settings.pop(name)
        name = present_name(name)
        (settings[name],) = present_values(name, [value])
    for name, choices in axes.items():
        if name in settings:
            raise ValueError(f"{name} is both in the grid and fixed")
        if not choices:
            raise ValueError(f"grid[{name!r}] must have at least one value")
    if not axes:
        raise ValueError("grid must have at least one setting")
    total = math.prod(len(choices) for choices in axes.values())
    if total > MOST_SETTINGS:
        raise ValueError(f"grid must have at most {MOST_SETTINGS} combinations, got {total}")
    links, samples = whole_number("links", links), whole_number("samples", samples)
    duration = number("duration", duration)
    if links not in (2, 3):
        raise ValueError(f"links must be 2 or 3, got {shown(links)}")
    if not 2 <= samples <= MOST_SAMPLES:
        raise ValueError(f"samples must be between 2 and {MOST_SAMPLES}, got {shown(samples)}")
    if piece is None:
        piece = max(1, min(1024, MOST_ROWS // 10 // samples))
    piece, most = whole_number("piece", piece), min(MOST_ARMS, MOST_ROWS // samples)
    if not 1 <= piece <= most:
        raise ValueError(f"piece must be between 1 and {most} with {samples} samples, got {shown(piece)}")
    if not (np.isfinite(duration) and duration > 0):
        raise ValueError(f"duration must be finite and greater than 0, got {duration}")
    if metric not in METRICS if isinstance(metric, str) else not callable(metric):
        kind = ValueError if isinstance(metric, str) else TypeError
        raise kind(f"metric must be one of {', '.join(METRICS)} or a function, got {metric!r}")
    if isinstance(executor, type) or (executor is not None and not callable(getattr(executor, "submit", None))):
        raise TypeError(f"executor must be an object with submit, as in concurrent.futures, got {shown(executor)}")
    folder = None if folder is None else path("folder", folder)
    progress = flag("progress", progress)
    columns = {name: column(name, values, links) for name, values in axes.items()}
    question = _Question(
        shape=tuple(len(values) for values in axes.values()),
        fixed={name: column(name, [value], links) for name, value in settings.items()},
        metric=metric,
        links=links,
        duration=duration,
        samples=samples,
        controller=flag("controller", controller),
    )
    question.check(columns)
    kept = None
    if folder is not None:
        kept = Folder(folder, question.to_keep(columns), total, piece, metric if isinstance(metric, str) else None)
    starts = range(0, total, piece)
    done = {} if kept is None else kept.read(starts)
    left = [start for start in starts if start not in done]
    cut = partial(_cut, columns, question.shape)
    if executor is not None:
        hand_out(question, cut, total, left, piece, executor, _solve, done, kept, progress)
    else:
        stopped = threading.Event()
        with _Threads(_cores()) as threads:
            try:
                solve = partial(_solve, stopped=stopped)
                hand_out(question, cut, total, left, piece, threads, solve, done, kept, progress)
            finally:
                # A caller that stops early, for example by Ctrl-C, does not wait for running
                # pieces.
                stopped.set()
    for start in starts:
        if done[start].keys() != done[0].keys():
            names = " and ".join(", ".join(one) for one in (done[0], done[start]))
            raise ValueError(f"metric must return the same names for all arms, got {names}")
    whole = {name: np.concatenate([done[start][name] for start in starts]) for name in done[0]}
    return Sweep(axes, {name: values.reshape(question.shape) for name, values in whole.items()})


class _Threads(ThreadPoolExecutor):
    """Threads, or fewer than requested if the system refuses some."""

    def _adjust_thread_count(self) -> None:
        try:
            super()._adjust_thread_count()
        except RuntimeError:
            if not self._threads:
                raise OSError(errno.EAGAIN, "no thread can be started") from None


def _cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class _Question:
    """The task for every setting, which is sent to the workers. A piece has its own values of the axes."""

    shape: tuple[int, ...]
    fixed: Columns
    metric: str | Metric
    links: int
    duration: float
    samples: int
    controller: bool

    def check(self, axes: Columns) -> None:
        """Tries every value once, so a bad one is refused here by its name."""
        settings = {**axes, **self.fixed}
        for name, values in settings.items():
            try_values(name, values, self.links)
        timesteps = settings.get("timestep", [TIMESTEP])
        longest = float(max(timesteps))
        if _steps_in(self.duration, longest) < 1:
            raise ValueError(f"duration must be at least the timestep {longest}, got {self.duration}")
        steps = np.rint(_steps_in(self.duration, float(min(timesteps))))
        if steps > MOST_STEPS:
            raise ValueError(f"duration / timestep must be at most {MOST_STEPS} steps, got {steps:g}")

    def to_keep(self, axes: Columns) -> dict[str, Any]:
        """The description of the sweep in the folder."""
        metric = self.metric
        if not isinstance(metric, str):
            code = fingerprint("metric", metric)
            metric = f"{metric.__module__}.{metric.__qualname__} {code}"
        return {
            "version": version("pendularm"),
            # A list, because the order counts: the axes of the results have the order of the grid.
            "grid": [[name, values.tolist()] for name, values in axes.items()],
            "settings": {name: values.tolist() for name, values in self.fixed.items()},
            "metric": metric,
            "links": self.links,
            "duration": self.duration,
            "samples": self.samples,
            "controller": self.controller,
        }


def _steps_in(duration: float, timestep: Any) -> Any:
    """As `steps_in` of the Rust library: rounded, with half a step upwards, it is the number of steps of a run."""
    return duration / timestep * (1 + 4 * sys.float_info.epsilon)


def _advance(batch: Batch, steps: NDArray[np.int64], stopped: threading.Event | None) -> None:
    """Takes this number of steps with each arm, in several parts if they are many."""
    at_once = max(1, AT_ONCE // len(batch))
    while True:
        if stopped is not None and stopped.is_set():
            raise CancelledError
        batch.step(np.minimum(steps, at_once))
        steps = np.maximum(steps - at_once, 0)
        if not steps.any():
            return


def _cut(axes: Columns, shape: tuple[int, ...], start: int, stop: int) -> Columns:
    """The values of each axis that a piece uses, each once, in their order."""
    places = np.unravel_index(np.arange(start, stop), shape)
    return {name: values[np.unique(place)] for (name, values), place in zip(axes.items(), places, strict=True)}


@promised
def _solve(
    question: _Question, axes: Columns, start: int, stop: int, stopped: threading.Event | None = None
) -> tuple[str, PieceResults]:
    """Computes one piece on any worker, and names the worker's wheel. In this process it ends soon after `stopped` is
    set."""
    return BUILD, _values(question, axes, start, stop, stopped)


def _values(
    question: _Question, axes: Columns, start: int, stop: int, stopped: threading.Event | None
) -> PieceResults:
    places = np.unravel_index(np.arange(start, stop), question.shape)
    arms = stop - start
    # The axes have each used value once (`_cut`).
    rows = [np.unique(place, return_inverse=True)[1] for place in places]
    settings = {name: values[row] for (name, values), row in zip(axes.items(), rows, strict=True)}
    settings |= {name: np.repeat(values, arms, axis=0) for name, values in question.fixed.items()}
    batch = begin(settings, arms, question.links)
    batch.enable(question.controller)
    timestep = settings.get("timestep", np.full(arms, TIMESTEP))
    shape = (question.samples, arms, question.links)
    positions, velocities, efforts = np.empty(shape), np.empty(shape), np.empty(shape)
    times, energy = np.empty(shape[:2]), np.empty(shape[:2])
    taken = np.zeros(arms, np.int64)
    steps, intervals = np.floor(_steps_in(question.duration, timestep) + 0.5).astype(np.int64), question.samples - 1
    for sample in range(question.samples):
        # The nearest step, as in a rollout.
        due = (2 * sample * steps + intervals) // (2 * intervals)
        _advance(batch, due - taken, stopped)
        taken = due
        positions[sample], velocities[sample], efforts[sample] = batch.position, batch.velocity, batch.effort
        times[sample], energy[sample] = taken * timestep, batch.energy
    setpoint = settings.get("setpoint", np.zeros((arms, question.links)))
    run = Run(times, positions, velocities, efforts, energy, setpoint, batch.diverged.copy())
    metric = METRICS[question.metric] if isinstance(question.metric, str) else question.metric
    name = question.metric if isinstance(question.metric, str) else "metric"
    found = metric(run)
    named = found if isinstance(found, Mapping) else {name: found}
    if hidden := [key for key, one in named.items() if is_masked(one)]:
        raise ValueError(f"metric must return no masked numbers, got some in {hidden[0]!r}")
    values = {key: as_array(f"metric[{key!r}]", one) for key, one in named.items()}
    for key, one in values.items():
        if not isinstance(key, str):
            raise ValueError(f"metric must name its numbers by text, got {key!r}")
        if one.dtype.hasobject:
            raise ValueError(f"metric must return numbers or text, got objects in {key!r}")
        if one.shape != (arms,):
            raise ValueError(f"metric must return one number for each of {arms} arms, got the shape {one.shape} in {key!r}")
    return values

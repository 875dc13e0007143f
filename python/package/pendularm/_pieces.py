"""The pieces of a sweep: submission to workers, progress, and storage in a folder."""

import json
import os
import secrets
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager, nullcontext, suppress
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ._native import BUILD

PieceResults = dict[str, NDArray[Any]]
"""The results of a piece by the metrics' names, each (arms,)."""

IN_FLIGHT = 256
"""Pieces submitted to an executor before the first one is done."""


def hand_out(
    question: object,
    cut: Callable[[int, int], object],
    total: int,
    starts: Sequence[int],
    piece: int,
    executor: Any,
    solve: Callable[..., tuple[str, PieceResults]],
    done: dict[int, PieceResults],
    kept: "Folder | None",
    progress: bool,
) -> None:
    """Submits the pieces that begin at `starts`, each a `solve` of the question for a range of settings, with the values
    that `cut` returns for this range. Collects each result on arrival. A worker with another wheel is refused."""
    left = iter(starts)
    under_way: dict[Future[Any], int] = {}
    already = total - sum(min(piece, total - start) for start in starts)
    with _progress_bar(total, already) if progress else nullcontext() as bar:
        try:
            while True:
                while len(under_way) < IN_FLIGHT and (start := next(left, None)) is not None:
                    stop = min(start + piece, total)
                    under_way[executor.submit(solve, question, cut(start, stop), start, stop)] = start
                if not under_way:
                    return
                ended = wait(under_way, return_when=FIRST_COMPLETED).done
                # Failed ones come last, so all finished ones are kept.
                for future in sorted(ended, key=lambda one: one.cancelled() or one.exception() is not None):
                    start = under_way.pop(future)
                    done[start] = _of_this_wheel(future.result())
                    if kept is not None:
                        kept.keep(start, done[start])
                    if bar is not None:
                        bar.update(min(piece, total - start))
        finally:
            for future in under_way:
                future.cancel()


def _of_this_wheel(answer: Any) -> PieceResults:
    """The results of a piece, if the worker has the same wheel. An old one returns the results alone."""
    build, values = answer if isinstance(answer, tuple) else ("of an older version", None)
    if build != BUILD:
        raise ValueError(f"a worker has another wheel of pendularm ({build}) than this process ({BUILD})")
    return cast(PieceResults, values)


def _in_notebook() -> bool:
    """Whether this runs in a Jupyter kernel, whose output is visible although it is not a terminal."""
    interactive = sys.modules.get("IPython")
    return interactive is not None and hasattr(interactive.get_ipython(), "kernel")


def _progress_bar(total: int, already: int) -> AbstractContextManager[Any]:
    """A progress bar, if the output is visible, or `None` if tqdm is not installed."""
    # `None` means only on a terminal.
    hidden = None
    try:
        from tqdm import tqdm

        if _in_notebook():
            from tqdm import notebook

            hidden = False
            # Without ipywidgets the bar is a text, because `tqdm.auto` would warn.
            if notebook.IProgress is not None:
                tqdm = notebook.tqdm
    except ImportError:
        return nullcontext()
    bar: AbstractContextManager[Any] = tqdm(total=total, initial=already, unit=" settings", disable=hidden)
    return bar


def _publish(part: Path, file: Path) -> None:
    """Writes a whole file, unless it exists already."""
    try:
        os.link(part, file)
    except FileExistsError:
        pass
    except OSError:
        # Without hard links, another process may read the file half written, and then reports that it cannot be
        # read.
        with suppress(FileExistsError), file.open("xb") as new:
            new.write(part.read_bytes())


class Folder:
    """The finished pieces of one sweep, each in its own file, which is complete or missing."""

    def __init__(self, path: Path, told: Mapping[str, Any], total: int, piece: int, name: str | None) -> None:
        """The pieces of the sweep with the description `told`: the number of settings in all and per piece, and the
        name of its one metric, if known."""
        self._path = path
        self._total = total
        self._piece = piece
        self._name = name
        try:
            path.mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError):
            raise ValueError(f"folder {path} must be a folder") from None
        # Converted through JSON, so it can be compared with the file.
        told = json.loads(json.dumps({**told, "piece": piece}))
        file = path / "sweep.json"
        # Pieces are listed first, because another process may run the same sweep and writes its sweep.json
        # before its pieces.
        pieces = any(path.glob("[0-9]*.npz"))
        if not file.exists():
            if pieces:
                raise ValueError(f"folder {path} holds pieces of a sweep without their sweep.json")
            self._write("sweep.json", lambda part: part.write_text(json.dumps(told), encoding="utf-8"), _publish)
        # The file is read even if it was just written, because another sweep may have written it
        # first.
        try:
            kept = dict(json.loads(file.read_bytes()))
        except (TypeError, ValueError):
            raise ValueError(f"folder {path} holds a sweep.json that cannot be read") from None
        other = [name for name, value in told.items() if kept.get(name) != value]
        if other:
            raise ValueError(f"folder {path} holds another sweep: it differs in {', '.join(other)}")

    def _write(self, name: str, write: Callable[[Path], Any], put: Callable[[Path, Path], Any] = Path.replace) -> None:
        # Other processes may write the same file at once, from hosts or containers with the same
        # process numbers.
        part = self._path / f"part-{secrets.token_hex(8)}-{name}"
        try:
            write(part)
            put(part, self._path / name)
        finally:
            part.unlink(missing_ok=True)

    def keep(self, start: int, values: PieceResults) -> None:
        # The names are stored first, as a separate array, because NumPy and zip files change or confuse some
        # names.
        self._write(f"{start:012}.npz", lambda part: np.savez(part, json.dumps(list(values)), *values.values()))

    def read(self, starts: Iterable[int]) -> dict[int, PieceResults]:
        found = {}
        for start in starts:
            try:
                # Read in memory, because NumPy does not close a file that it cannot read.
                kept = BytesIO((self._path / f"{start:012}.npz").read_bytes())
                with np.load(kept, allow_pickle=False) as file:
                    names, *arrays = (file[f"arr_{place}"] for place in range(len(file.files)))
                values = dict(zip(json.loads(str(names)), arrays, strict=True))
            except Exception:
                # A missing or damaged piece is computed again.
                continue
            arms = min(self._piece, self._total - start)
            known = self._name is None or list(values) == [self._name]
            if known and values and all(one.shape == (arms,) for one in values.values()):
                found[start] = values
        return found

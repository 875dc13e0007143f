"""The tables of a report of ``pendularm report``."""

import csv
import os
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ._fields import path

__all__ = ["read_report"]

Column = NDArray[np.float64] | NDArray[np.str_]


def read_report(folder: str | os.PathLike[str] = "report") -> dict[str, dict[str, Column]]:
    """Reads every table of the report in `folder`: a mapping from the stem of the file to its columns by name.

    A column has doubles with the measured bits, and NaN for a missing one; or it has texts. `pandas.DataFrame`
    accepts a table directly. Raises `FileNotFoundError` if there is no report. Raises `ValueError`, with the file's
    name, for a table that cannot be read, that ends in the middle of a line, or that has a row with too few or too
    many cells.
    """
    files = sorted(path("folder", folder).glob("*.csv"))
    if not files:
        name = os.fspath(folder)
        raise FileNotFoundError(f"{name} holds no report: `pendularm report --out {name}` makes one")
    return {file.stem: _table(file) for file in files}


def _table(file: Path) -> dict[str, Column]:
    try:
        # Some programs add a byte order mark at the start, which does not belong to a name.
        text = file.read_bytes().decode("utf-8-sig")
        if "\0" in text:
            # Python 3.10 reports this, and later versions accept it.
            raise csv.Error("line contains NUL")
        rows = list(csv.reader(StringIO(text, newline=""), strict=True))
    except (UnicodeDecodeError, csv.Error) as why:
        raise ValueError(f"{file} cannot be read: {why}") from None
    if not rows or not rows[0]:
        raise ValueError(f"{file} has no head")
    # A truncated number may still be a valid number.
    if not text.endswith("\n"):
        raise ValueError(f"{file} ends amid a line")
    head, *cells = rows
    if repeated := [name for at, name in enumerate(head) if name in head[:at]]:
        raise ValueError(f"{file} has two columns of the name {repeated[0]!r}")
    for number, row in enumerate(cells, 1):
        if len(row) != len(head):
            raise ValueError(f"{file} has {len(row)} cells in row {number}, and {len(head)} in its head")
    return {name: _column([row[at] for row in cells]) for at, name in enumerate(head)}


def _column(cells: list[str]) -> Column:
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64)
    except ValueError:
        return np.array(cells, dtype=np.str_)

"""The programs that the page copies run with the wheel as it is, and print the rows of the page's tables.

`KEEP=1 FORM=file make test-browser ARGS="-k test_copy"` writes both.
"""

import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

KEPT = Path(__file__).with_name("copied")
#: No other run has this column.
ONLY_THERE = {"run time [s]"}


def number(text: str) -> float | str | None:
    """A cell. The page leaves out what Python calls `None`, and a number that is not finite."""
    try:
        return None if text in ("", "None", "inf", "nan") else float(text)
    except ValueError:
        return text


def rows_of(text: str) -> list[list[str]]:
    return [line.split("\t") for line in text.rstrip("\n").split("\n")]


@pytest.mark.parametrize("program", sorted(KEPT.glob("*.txt")), ids=lambda path: path.stem)
def test_the_python_of_a_chart_prints_its_table(program: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-"], input=program.read_text("utf-8"), capture_output=True, text=True, timeout=60, check=False
    )
    assert ran.returncode == 0, ran.stderr
    head, *printed = rows_of(ran.stdout)
    columns, *table = rows_of(program.with_suffix(".tsv").read_text("utf-8"))
    if program.stem == "responses":
        close_in_time(table, printed)
        return
    if program.stem == "motion":
        # It was recorded at other times than the samples, but ends with the same state.
        end = dict(zip(columns, table[-1], strict=True))
        computed = dict(zip(head, printed[-1], strict=True))
        assert {name: float(end[name]) for name in head} == pytest.approx({name: float(computed[name]) for name in head}, abs=1e-12)
        return
    assert head == columns
    assert len(printed) == len(table)
    for shown, computed in zip(table, printed, strict=True):
        for name, one, other in zip(head, shown, computed, strict=True):
            assert name in ONLY_THERE or number(one) == number(other), (name, shown, computed)


def close_in_time(table: list[list[str]], printed: list[list[str]]) -> None:
    """The page records at other times. Between two samples of 1/60 s the angle is nearly straight."""
    assert {name for name, _, _ in table} == {name for name, _, _ in printed}
    samples = [(float(time), float(angle)) for _, time, angle in printed]
    for _, time, angle in table:
        (before, low), (after, high) = next(pair for pair in pairwise(samples) if pair[1][0] >= float(time) - 1e-9)
        part = (float(time) - before) / (after - before)
        assert float(angle) == pytest.approx(low + part * (high - low), abs=1e-3), time

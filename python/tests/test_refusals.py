"""A wrong value is refused by the name of its field, and changes nothing: the rows of refusals.txt."""

import math
import pathlib

import numpy as np
import pytest

import pendularm

HIDDEN = np.ma.array([1.0, 2.0], mask=[True, False])
ROWS = (pathlib.Path(__file__).parent / "refusals.txt").read_text(encoding="utf-8").splitlines()
NAMES = {**vars(pendularm), "HIDDEN": HIDDEN, "math": math, "np": np, "pathlib": pathlib}


def state(arm, batch):
    arrays = [arm.position, arm.effort_limit, arm.encoder_step, *arm.gains.values(), batch.position, batch.effort, batch.time]
    names = ["timestep", "method", "control_period", "control_delay", "anti_windup", "tracking_time", "enabled"]
    return [*(getattr(arm, name) for name in names), *(array.tolist() for array in arrays)]


@pytest.mark.parametrize("row", [row for row in ROWS if row and not row.startswith("#")])
def test_a_bad_value_is_refused_by_the_name_of_its_field(row):
    wrong, said = row.split(" => ")
    kind = TypeError if said.startswith("TypeError: ") else ValueError
    said = said.removeprefix("TypeError: ")
    arm, batch = pendularm.Simulation(), pendularm.Batch(3)
    before = state(arm, batch)
    names = {**NAMES, "arm": arm, "batch": batch}
    with pytest.raises((TypeError, ValueError)) as refusal:
        eval(wrong, names)
    assert refusal.type is kind
    found = str(refusal.value)
    assert found.startswith(said[:-1]) if said.endswith("…") else found == said
    assert state(arm, batch) == before
    batch.step()
    assert batch.time.tolist() == [0.001] * 3


def test_an_axis_may_be_longer_than_a_batch():
    # The last value is refused by its index in the axis. The others are accepted.
    with pytest.raises(ValueError, match=r"^gravity\[1000000\] must be finite and at least 0, got -1$"):
        pendularm.sweep({"gravity": [9.81] * 1_000_000 + [-1.0]})

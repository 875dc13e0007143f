"""Sweeps: a bad value is refused by the name of its field."""

import pathlib

import numpy as np
import pytest

import pendularm

HIDDEN = np.ma.array([1.0, 2.0], mask=[True, False])


def among_objects(*values):
    """The values as they are, in an array."""
    array = np.empty(len(values), object)
    array[:] = values
    return array


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda: pendularm.sweep({}), "grid must have at least one setting"),
        (lambda: pendularm.sweep({"kp": []}), "grid['kp'] must have at least one value"),
        (
            lambda: pendularm.sweep({"control_period": [0.01, -1]}),
            "control_period[1] must be finite and at least 0, got -1",
        ),
        (lambda: pendularm.sweep({"control_delay": [1]}), "every control_delay must be True or False, got 1"),
        (lambda: pendularm.sweep({"kq": [1]}), "there is no setting 'kq'; there are lengths, masses, kp"),
        (lambda: pendularm.sweep({"kp": [1]}, kp=2), "kp is both in the grid and fixed"),
        (lambda: pendularm.sweep({"kp": [1, -2]}), "kp[1][0] must be finite and at least 0, got -2"),
        (lambda: pendularm.sweep({"kp": [[1, 2, 3]]}), "every kp must be a number or an array of 2, got [[1, 2, 3]]"),
        (lambda: pendularm.sweep({"timestep": ["x"]}), "every timestep must be a number, got ['x']"),
        (lambda: pendularm.sweep({"method": ["leapfrog"]}), "method must be one of euler, midpoint, verlet, rk4"),
        (lambda: pendularm.sweep({"method": [None]}), "every method must be a name, got [None]"),
        (lambda: pendularm.sweep({"kp": [1]}, method=pathlib.PurePosixPath("rk4")), "every method must be a name"),
        (lambda: pendularm.sweep({"kp": [1]}, "speed"), "metric must be one of final_error, settling_time"),
        (lambda: pendularm.sweep({"kp": [1]}, 5), "metric must be one of final_error, settling_time"),
        (lambda: pendularm.sweep({"q0": [[0, 0], [np.nan, 0]]}), "q0[1][0] must be finite, got nan"),
        (lambda: pendularm.sweep({"kp": [1]}, qdot0=np.inf), "qdot0[0][0] must be finite, got inf"),
        (lambda: pendularm.sweep({"setpoint": [0, [1, np.nan]]}), "setpoint[1][1] must be finite, got nan"),
        (lambda: pendularm.sweep({"masses": [1, np.array(1j)]}), "every masses must be a number or an array of 2, got"),
        (lambda: pendularm.sweep({"gravity": ["9"]}), "every gravity must be a number, got ['9']"),
        (lambda: pendularm.sweep({"kp": ["9"]}), "every kp must be a number or an array of 2, got ['9']"),
        (lambda: pendularm.sweep({"kp": HIDDEN}), "every kp must have no masked numbers, got [masked, "),
        (lambda: pendularm.sweep({"kp": [HIDDEN]}), "every kp must have no masked numbers, got [masked_array(data=[--"),
        (lambda: pendularm.sweep({"q0": [[0, np.ma.masked]]}), "every q0 must have no masked numbers, got [[0, "),
        (lambda: pendularm.sweep({"kp": [1]}, gravity=np.ma.masked), "every gravity must have no masked numbers"),
        (lambda: pendularm.sweep({"kp": [1]}, masses=HIDDEN), "every masses must have no masked numbers, got ["),
        (
            lambda: pendularm.sweep({"kp": [1]}, masses=HIDDEN.astype(object)),
            "every masses must have no masked numbers, got [masked_a",
        ),
        (
            lambda: pendularm.sweep({"kp": [1]}, masses=among_objects(np.ma.masked, 1)),
            "every masses must have no masked",
        ),
        (lambda: pendularm.sweep({"kp": [1]}, duration=np.ma.masked), "duration must have no masked numbers, got"),
        (
            lambda: pendularm.sweep({"kp": [1]}, samples=np.ma.array(5, mask=True)),
            "samples must be a whole number, got masked_array(data=--",
        ),
        (
            lambda: pendularm.sweep({"kp": [1]}, lambda run: {"a": [np.ma.masked]}, duration=0.1),
            "metric must answer no masked numbers, got a of them",
        ),
        (lambda: pendularm.sweep({"kp": [["1", None]]}), "every kp must be a number or an array of 2, got [["),
        (lambda: pendularm.sweep({"timestep": [None]}), "every timestep must be a number, got [None]"),
        (lambda: pendularm.sweep({"q0": [among_objects(b"1", 0)]}), "every q0 must be a number or an array of 2"),
        (lambda: pendularm.sweep({"q0": among_objects("1", 0)}), "every q0 must be a number or an array of 2, got ["),
        (
            lambda: pendularm.sweep({"kd": [among_objects(np.complex128(1j), 1)]}),
            "every kd must be a number or an array of 2, got [array([",
        ),
        (lambda: pendularm.sweep({"kp": [1]}, duration=None), "duration must be a number, got None"),
        (lambda: pendularm.sweep({"kp": b"ab"}), "grid['kp'] must be a sequence of values, got b'ab'"),
        (lambda: pendularm.sweep({"method": "rk4"}), "grid['method'] must be a sequence of values, got 'rk4'"),
        (lambda: pendularm.sweep([1]), "grid must be a mapping from settings to their values, got [1]"),
        (lambda: pendularm.sweep({"kp": 5}), "grid['kp'] must be a sequence of values, got 5"),
        (lambda: pendularm.sweep({"kp": [1]}, links=-1), "links must be 2 or 3, got -1"),
        (lambda: pendularm.sweep({"kp": [1]}, links="2"), "links must be a whole number, got '2'"),
        (lambda: pendularm.sweep({"kp": [1]}, samples=11.0), "samples must be a whole number, got 11.0"),
        (lambda: pendularm.sweep({"kp": [1]}, executor=5), "executor must have submit, as those of concurrent.futures"),
        (lambda: pendularm.sweep({"kp": [1]}, folder=5), "folder must be a path, got 5"),
        (lambda: pendularm.sweep({"kp": [1]}, folder=b"a"), "folder must be a path, got b'a'"),
        (lambda: pendularm.sweep({"kp": [1]}, folder="a\0b"), "folder must be a path, got 'a\\x00b'"),
        (lambda: pendularm.sweep({"kp": [1]}, progress="no"), "progress must be True or False, got 'no'"),
        (lambda: pendularm.sweep({"kp": [1]}, links=10**5000), "links must be 2 or 3, got an object of <class 'int'>"),
        (
            lambda: pendularm.sweep({"kp": [1]}, samples=10**5000),
            "samples must be between 2 and 100000, got an object of <class 'int'>",
        ),
        (
            lambda: pendularm.sweep({"kp": [1]}, piece=10**5000),
            "piece must be between 1 and 24937 with 401 samples, got an object of <class 'int'>",
        ),
        (lambda: pendularm.sweep({"kp": [1]}, samples=True), "samples must be a whole number, got True"),
        (lambda: pendularm.sweep({"kp": [1]}, piece=True, samples=2), "piece must be a whole number, got True"),
        (lambda: pendularm.sweep({"kp": [1]}, piece="1"), "piece must be a whole number, got '1'"),
        (lambda: pendularm.sweep({"kp": [1]}, duration="1"), "duration must be a number, got '1'"),
        (lambda: pendularm.sweep({"kp": [1]}, duration=10**400), "duration must be finite, got a number that no"),
        (lambda: pendularm.sweep({"kp": [1, 10**400]}), "every kp must be finite, got a number that no double holds"),
        (lambda: pendularm.sweep({"gravity": [-(10**400)]}), "every gravity must be finite, got a number that no"),
        (lambda: pendularm.sweep({"kp": [1]}, servo="no"), "servo must be True or False, got 'no'"),
        (
            lambda: pendularm.sweep({"kp": [1]}, lambda run: {1: run.energy[-1]}, duration=0.1),
            "metric must name its numbers by text, got 1",
        ),
        (
            lambda: pendularm.sweep({"kp": [1]}, lambda run: [None], duration=0.1),
            "metric must answer numbers or text, got metric of objects",
        ),
        (
            lambda: pendularm.sweep(
                {"setpoint": [0, 1]}, lambda run: {str(run.setpoint[0, 0]): run.energy[-1]}, duration=0.1, piece=1
            ),
            "metric must answer the same names for all arms, got 0.0 and 1.0",
        ),
        (lambda: pendularm.sweep({"kp": [1]}, duration=-1), "duration must be finite and greater than 0, got -1"),
        (lambda: pendularm.sweep({"kp": [1]}, samples=1), "samples must be between 2 and 100000, got 1"),
        (lambda: pendularm.sweep({"kp": [1]}, samples=10**9), "samples must be between 2 and 100000, got 1000000000"),
        (lambda: pendularm.sweep({"kp": [1]}, piece=0), "piece must be between 1 and 24937 with 401 samples, got 0"),
        (
            lambda: pendularm.sweep({"kp": [1]}, piece=10**6),
            "piece must be between 1 and 24937 with 401 samples, got 1000000",
        ),
        (
            lambda: pendularm.sweep({"kp": [1]}, piece=1_000_001, samples=2),
            "piece must be between 1 and 1000000 with 2 samples, got 1000001",
        ),
        (
            lambda: pendularm.sweep({"timestep": [1e-3, 1e-320]}, duration=1),
            "duration / timestep must be at most 10000000 steps, got inf",
        ),
        (
            lambda: pendularm.sweep({"kp": [1]}, duration=1e5),
            "duration / timestep must be at most 10000000 steps, got 1e+08",
        ),
        (
            lambda: pendularm.sweep({"timestep": [0.1, 9]}, duration=4),
            "duration must be at least the timestep 9.0, got 4.0",
        ),
        (lambda: pendularm.sweep({"kp": [1]}, duration=1e-4), "duration must be at least the timestep 0.001, got 0"),
        (
            lambda: pendularm.sweep({"kp": range(4000), "kd": range(4000)}),
            "grid must have at most 10000000 combinations, got 16000000",
        ),
    ],
)
def test_a_bad_value_is_refused_by_the_name_of_its_field(wrong, said):
    with pytest.raises(ValueError) as refusal:
        wrong()
    assert str(refusal.value).startswith(said)


def test_an_axis_may_be_longer_than_a_batch():
    # The last of all is found, by its place in the axis; the other ones are taken.
    with pytest.raises(ValueError, match=r"^gravity\[1000000\] must be finite and at least 0, got -1$"):
        pendularm.sweep({"gravity": [9.81] * 1_000_000 + [-1.0]})

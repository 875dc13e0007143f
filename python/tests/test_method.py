"""A method by its tableau: `Method`, its analysis, and runs with it."""

import copy
import pickle
import re
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import pendularm

ROOT = Path(__file__).parents[2]
RK4 = [[], ["1/2"], [0, Fraction(1, 2)], [0, 0, 1]], ["1/6", "1/3", 1 / 3, Fraction(1, 6)]
STOERMER = dict(a=[[], [0.5], [1, 0]], b=[0.5, 0, 0.5], a_q=[[], [0], [0, 1]], b_q=[0, 1, 0])


def test_an_analysis_has_the_members_of_the_service():
    found = pendularm.Method(*RK4).analyse()
    page = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
    (row,) = re.findall(r"^\| `/study/method` \|.*\| (.*) \|$", page, re.MULTILINE)
    assert list(asdict(found)) == re.findall(r"`(\w+)`", row)


def test_a_method_has_its_published_order_and_limits():
    found = pendularm.Method(*RK4, c=[0, 0.5, 0.5, 1]).analyse()
    assert (found.stages, found.evaluations, found.order, found.faults) == (4, 4, 4, [])
    assert found.measured_order == pytest.approx(4, abs=0.1)
    assert found.real_limit == pytest.approx(2.7853, abs=1e-4)
    assert found.imaginary_limit == pytest.approx(8**0.5, abs=1e-4)
    assert found.swing_evaluations == found.swing_evaluations_of_methods[found.methods.index("rk4")]
    assert found.timestep_limit_held == pytest.approx(pendularm.stability().timestep_limit_held, rel=1e-6)
    assert found.picture.count("#") == "".join(found.region).count("#") > 100
    pair = pendularm.Method(**STOERMER).analyse()
    assert (pair.order, pair.symplectic, found.symplectic) == (2, True, False)
    assert pair.imaginary_limit == pytest.approx(2)


def test_misprints_are_named():
    a, b = RK4
    assert pendularm.Method(a, ["1/6", "1/3", "1/3", 0]).analyse().faults == ["b sums to 5/6"]
    found = pendularm.Method([[], ["1/2"], ["1/2", 0], [0, 0, 1]], b, c=[0, "1/2", "1/2", 1]).analyse()
    assert (found.order, found.faults) == (2, []) and "[[[]]] gives 1/12, not 1/6" in found.failing_condition
    pair = pendularm.Method.named("dormand_prince5").analyse()
    assert (pair.order, pair.embedded_order) == (5, 4)


def test_the_amplification_is_the_stability_polynomial():
    z = np.array([[-1 + 2j, 0.5j], [-2.785, 0]])
    expected = np.abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)
    found = pendularm.Method.named("rk4").amplification(z)
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert pendularm.Method.named("rk4").amplification(-1).shape == ()


def test_a_rollout_takes_a_method():
    swing = dict(q=[0.4, -0.3], controller=False, duration=1.0, timestep=0.01, samples=11, reference=True)
    live = pendularm.rollout(**swing)
    own = pendularm.Method(*RK4)
    for method in (own, copy.deepcopy(own), pickle.loads(pickle.dumps(own))):
        run = pendularm.rollout(method=method, **swing)
        np.testing.assert_allclose(run.positions, live.positions, atol=1e-11)
        assert (run.evaluations, run.error) == (live.evaluations, pytest.approx(live.error, rel=1e-3))
    better = pendularm.rollout(method=pendularm.Method.named("dormand_prince5"), **swing)
    assert better.error < 0.1 * live.error and better.evaluations == 600


def test_a_method_is_planned_beside_the_others():
    swing = dict(q=[0.4, -0.3], controller=False, duration=1.0)
    found = pendularm.plan(1e-8, method=pendularm.Method.named("dormand_prince5"), **swing)
    assert found.own.error <= 1e-8 and found.own.evaluations < found.evaluations[0]
    assert pendularm.plan(1e-8, **swing).own is None
    assert pendularm.plan(1e-6, method=pendularm.Method([[]], [1]), **swing).own is None

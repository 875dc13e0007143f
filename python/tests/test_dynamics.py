"""The equation of motion, compared with reference values of another derivation in 160 digits."""

import json
from pathlib import Path

import numpy as np
import pytest

import pendularm
from pendularm import dynamics

DATA = Path(__file__).parents[2] / "tests" / "data"


def cases():
    every = json.loads((DATA / "dynamics.json").read_text())["cases"]
    return [case for case in every if case["n"] in (2, 3)]


def test_all_terms_are_those_of_the_reference_values():
    seen = 0
    for case in cases():
        arm = pendularm.Arm(case["n"], lengths=case["lengths"], masses=case["masses"], gravity=case["gravity"])
        q, qd, effort, qdd = case["q"], case["qdot"], case["tau"], case["qddot_id"]
        # The first-order bound of the reference values, per unit of rounding, plus some units for the sums.
        near = lambda found, name, bound="", of=case: np.all(
            np.abs(np.asarray(found) - np.asarray(of[name]))
            <= 32 * np.finfo(float).eps * (np.asarray(of[bound or f"sens_{name}"]) + np.abs(np.asarray(of[name])))
        )
        assert near(dynamics.mass_matrix(arm, q), "M")
        assert near(dynamics.coriolis(arm, q, qd), "h")
        assert near(dynamics.gravity_load(arm, q), "G")
        assert near(dynamics.inverse_dynamics(arm, q, qd, qdd), "tau_id")
        assert near(dynamics.forward_dynamics(arm, q, qd, effort), "qddot", "sens_qddot_abs")
        seen += 1
    assert seen > 50


def test_the_linear_system_is_the_slope_of_the_motion(links):
    """Each column of A and B is a central difference of the motion, whose error is below 1e-8 here."""
    random = np.random.default_rng(5)
    for trial in range(20):
        of = {name: random.uniform(0.3, 2, links) for name in ("lengths", "masses", "viscous")}
        arm = pendularm.Arm(links, **of, gravity=[9.81, 0.0][trial % 2])
        q = random.uniform(-3, 3, links)
        hold = dynamics.gravity_load(arm, q)

        def motion(around, arm=arm, q=q, hold=hold):
            x, v, u = np.split(around, 3)
            return np.concatenate([v, dynamics.forward_dynamics(arm, q + x, v, hold + u)])

        a, b = pendularm.linearize(arm, q)
        step = 1e-4 * np.eye(3 * links)
        slope = np.stack([(motion(one) - motion(-one)) / 2e-4 for one in step], axis=1)
        scale = np.abs(slope).max()
        assert a.shape == (2 * links, 2 * links) and b.shape == (2 * links, links)
        assert np.abs(np.hstack([a, b]) - slope).max() < 3e-7 * scale
    with pytest.raises(ValueError, match=r"^q must be an array of 2 numbers"):
        pendularm.linearize(pendularm.Arm(), [0.0, 0.0, 0.0])


def test_friction_is_in_the_motion_and_in_the_effort_for_it(links):
    random = np.random.default_rng(6)
    q, qd, qdd = (random.uniform(-3, 3, (150, links)) for _ in range(3))
    plain, viscous = pendularm.Arm(links), [0.7, 0.2, 0.1][:links]
    arm = pendularm.Arm(links, viscous=viscous)
    effort = dynamics.inverse_dynamics(arm, q, qd, qdd)
    assert np.array_equal(effort, dynamics.inverse_dynamics(plain, q, qd, qdd) + viscous * qd)
    assert np.allclose(dynamics.forward_dynamics(arm, q, qd, effort), qdd, rtol=0, atol=1e-11)
    expected = dynamics.forward_dynamics(plain, q, qd, effort - viscous * qd)
    assert np.array_equal(dynamics.forward_dynamics(arm, q, qd, effort), expected)


def test_many_states_are_as_many_single_ones(links):
    random = np.random.default_rng(3)
    arm = pendularm.Arm(links)
    q, qd, effort = (random.uniform(-3, 3, (9, links)) for _ in range(3))
    for function, fields in [
        (dynamics.mass_matrix, (q,)),
        (dynamics.coriolis, (q, qd)),
        (dynamics.gravity_load, (q,)),
        (dynamics.forward_dynamics, (q, qd, effort)),
        (dynamics.inverse_dynamics, (q, qd, effort)),
        (dynamics.kinetic_energy, (q, qd)),
        (dynamics.potential_energy, (q,)),
    ]:
        together = function(arm, *fields)
        singly = [function(arm, *row) for row in zip(*fields, strict=True)]
        assert together.tolist() == np.array(singly).tolist()
    # Enough arms for several full blocks of registers and a partial one.
    many = [random.uniform(-3, 3, (1003, links)) for _ in range(3)]
    together = dynamics.forward_dynamics(arm, *many)
    singly = [dynamics.forward_dynamics(arm, *row) for row in zip(*many, strict=True)]
    assert together.tolist() == np.array(singly).tolist()
    assert dynamics.forward_dynamics(arm, *(np.empty((0, links)),) * 3).shape == (0, links)
    # One row is combined with every row of the others.
    for row in [q[0], q[:1]]:
        assert dynamics.coriolis(arm, row, qd).tolist() == dynamics.coriolis(arm, [q[0]] * 9, qd).tolist()
        assert dynamics.coriolis(arm, qd, row).tolist() == dynamics.coriolis(arm, qd, [q[0]] * 9).tolist()
    assert dynamics.coriolis(arm, q[:1], qd[0]).shape == (1, links)


def test_the_interpreters_lock_is_released_for_many_states(links, turns_of_another_thread):
    arm, many = pendularm.Arm(links), np.zeros((200_000, links))
    for function, fields in [(dynamics.mass_matrix, 1), (dynamics.forward_dynamics, 3), (pendularm.end_effector, 1)]:
        assert turns_of_another_thread(lambda f=function, n=fields: f(arm, *[many] * n)) > 0, function


def test_inverse_kinematics_puts_the_end_effector_there(links):
    arm = pendularm.Arm(links, lengths=[1.0, 0.8, 0.3][:links])
    for x, y in [(1.0, 0.5), (-0.7, 0.9), (0.4, -1.1)]:
        q = pendularm.inverse_kinematics(arm, x, y)
        # A few rounding errors of lengths near 1 m.
        assert np.allclose(pendularm.end_effector(arm, q), [x, y], rtol=0, atol=1e-14)
    down = pendularm.inverse_kinematics(arm, 1.0, 0.5, present=[2.0, -1.0, 0.0][:links])
    assert down[1] < 0
    with pytest.raises(ValueError, match=r"beyond the arm's reach of"):
        pendularm.inverse_kinematics(arm, 9.0, 0.0)
    if links == 3:
        assert np.isclose(pendularm.inverse_kinematics(arm, 1.0, 0.5, 0.25).sum(), 0.25)


def test_inverse_kinematics_is_that_of_the_service(runtime, links):
    runtime.call("/arm_sim/pause", data=True)
    runtime.call("/arm_sim/reset")
    arm = pendularm.Arm(links)
    assert runtime.call("/ik/solve", x=0.6, y=0.7)["positions"] == pendularm.inverse_kinematics(arm, 0.6, 0.7).tolist()


def test_shapes_are_checked():
    arm = pendularm.Arm()
    with pytest.raises(ValueError, match=r"qd must have the shape \(2,\) or \(3, 2\), got \(2, 2\)"):
        dynamics.coriolis(arm, np.zeros((3, 2)), np.zeros((2, 2)))
    with pytest.raises(ValueError, match=r"q must have the shape \(2,\) or \(n, 2\), got \(\)"):
        dynamics.gravity_load(arm, 1.0)
    with pytest.raises(TypeError, match="q must be an array of numbers, got None"):
        dynamics.gravity_load(arm, None)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_not_finite_is_refused_by_its_place(links, bad):
    arm, good, one, many = pendularm.Arm(links), np.zeros(links), np.zeros(links), np.zeros((4, links))
    one[1] = many[2, 1] = bad
    shown = "NaN" if np.isnan(bad) else str(bad)
    for function, fields in [
        (dynamics.mass_matrix, ["q"]),
        (dynamics.coriolis, ["q", "qd"]),
        (dynamics.gravity_load, ["q"]),
        (dynamics.forward_dynamics, ["q", "qd", "effort"]),
        (dynamics.inverse_dynamics, ["q", "qd", "qdd"]),
        (dynamics.kinetic_energy, ["q", "qd"]),
        (dynamics.potential_energy, ["q"]),
        (pendularm.end_effector, ["q"]),
    ]:
        for field in fields:
            for value, place in [(one, "[1]"), (many, "[2][1]")]:
                given = {name: value if name == field else good for name in fields}
                with pytest.raises(ValueError) as refusal:
                    function(arm, **given)
                assert str(refusal.value) == f"{field}{place} must be finite, got {shown}"

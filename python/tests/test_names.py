"""One name for each thing. An older one still works for one version, with a warning."""

import numpy as np
import pytest

import pendularm

START = [0.4, -0.3]
SHORT = {"duration": 0.1, "samples": 3}


def of_state(call, arm):
    call(arm)
    return np.concatenate([np.ravel(arm.position), np.ravel(arm.velocity)]).tolist()


OLDER = {
    "rollout": (
        lambda: pendularm.rollout(q0=START, qdot0=START, integrator="euler", **SHORT).positions,
        lambda: pendularm.rollout(q=START, qd=START, method="euler", **SHORT).positions,
    ),
    "stability": (
        lambda: pendularm.stability(integrator="euler").timestep_limit,
        lambda: pendularm.stability(method="euler").timestep_limit,
    ),
    "plan": (
        lambda: pendularm.plan(0.01, q0=START, duration=0.2, controller=False).timesteps,
        lambda: pendularm.plan(0.01, q=START, duration=0.2, controller=False).timesteps,
    ),
    "gains": (
        lambda: pendularm.suggest_gains(integrator="verlet").kp,
        lambda: pendularm.suggest_gains(method="verlet").kp,
    ),
    "sweep": (
        lambda: pendularm.sweep({"q0": [0.1, 0.2]}, "final_error", qdot0=0.3, duration=0.1)["final_error"],
        lambda: pendularm.sweep({"q": [0.1, 0.2]}, "final_error", qd=0.3, duration=0.1)["final_error"],
    ),
    "planned": (lambda: PLANNED.integrator, lambda: PLANNED.method),
    "state": (
        lambda: of_state(lambda arm: arm.set_state(position=START, velocity=START), pendularm.Simulation()),
        lambda: of_state(lambda arm: arm.set_state(q=START, qd=START), pendularm.Simulation()),
    ),
    "states": (
        lambda: of_state(lambda arm: arm.set_state(position=START, velocity=START), pendularm.Batch(2)),
        lambda: of_state(lambda arm: arm.set_state(q=START, qd=START), pendularm.Batch(2)),
    ),
    "setpoint": (
        lambda: of_state(lambda arm: arm.set_setpoint(positions=START, velocities=START), pendularm.Simulation()),
        lambda: of_state(lambda arm: arm.set_setpoint(q=START, qd=START), pendularm.Simulation()),
    ),
    "setpoints": (
        lambda: of_state(lambda arm: arm.set_setpoint(positions=START), pendularm.Batch(2)),
        lambda: of_state(lambda arm: arm.set_setpoint(q=START), pendularm.Batch(2)),
    ),
    "delay": (
        lambda: pendularm.Simulation(control_delay=np.True_).control_delay,
        lambda: pendularm.Simulation(control_delay=1).control_delay,
    ),
    "delays": (
        lambda: pendularm.sweep({"control_delay": [False, True]}, "final_error", q=0.1, duration=0.1)["final_error"],
        lambda: pendularm.sweep({"control_delay": [0, 1]}, "final_error", q=0.1, duration=0.1)["final_error"],
    ),
}
PLANNED = pendularm.plan(0.01, duration=0.2, controller=False)


@pytest.mark.parametrize("name", OLDER)
def test_an_older_name_still_works_with_a_warning_that_names_the_callers_line(name):
    older, present = OLDER[name]
    with pytest.warns(DeprecationWarning) as warned:
        found = older()
    assert all(one.filename == __file__ for one in warned)
    assert np.array_equal(found, present())


def test_an_argument_is_not_given_under_two_names():
    with pytest.warns(DeprecationWarning), pytest.raises(TypeError, match="^q0 is an older name of q: pass one of them$"):
        pendularm.rollout(q=START, q0=START)
    for arm in [pendularm.Simulation(), pendularm.Batch(2)]:
        with pytest.raises(TypeError, match="^position is an older name of q: pass one of them$"):
            arm.set_state(START, position=START)
        with pytest.raises(TypeError, match="^missing the required argument q$"):
            arm.set_state()
    with pytest.raises(TypeError, match="^there is no argument 'limit'$"):
        pendularm.rollout(limit=3)


def test_missing_gains_are_those_of_a_new_arm_everywhere():
    gains, ask = pendularm.default_gains(), {"setpoint": START}
    limits = [pendularm.stability(gains=given, **ask).timestep_limit for given in (None, {}, gains)]
    runs = [pendularm.rollout(gains=given, **ask, **SHORT).positions.tolist() for given in (None, {}, gains)]
    plans = [pendularm.plan(0.1, gains=given, **ask).timestep for given in (None, {}, gains)]
    for found in [limits, runs, plans]:
        assert found[1:] == found[:1] * 2
    for free in [pendularm.rollout(controller=False, **SHORT), pendularm.stability(controller=False)]:
        assert np.array_equal(getattr(free, "efforts", 0), np.zeros((3, 2))) or free.equilibrium_kind == "hanging"
    for function in [pendularm.rollout, pendularm.stability, lambda **given: pendularm.plan(0.1, **given)]:
        for name, given in [("gains", gains), ("setpoint", START)]:
            with pytest.raises(ValueError, match=f"^{name} needs the controller, got "):
                function(controller=False, **{name: given})


def test_no_limit_is_infinite_and_an_unknown_value_is_nan():
    weightless = pendularm.stability(pendularm.Arm(gravity=0.0), controller=False)
    assert weightless.timestep_limit == np.inf
    assert np.isnan(pendularm.stability().advised_duration)
    run = pendularm.rollout(**SHORT)
    assert np.isnan([run.error, run.error_uncertainty, run.sampling_error]).all()
    assert np.isnan(PLANNED.control_period)
    free = pendularm.held_limit([[1.0]])
    assert free.period_limit == np.inf and np.isnan(free.armature)

"""The study's results are bit-identical to those of the services."""

import dataclasses
import math
import signal
import time

import numpy as np
import pytest

import pendularm


def plain(answer):
    """A result in the form of JSON."""
    if dataclasses.is_dataclass(answer):
        return {field.name: plain(getattr(answer, field.name)) for field in dataclasses.fields(answer)}
    if isinstance(answer, float) and not math.isfinite(answer):
        # No limit, or not known.
        return None
    return answer.tolist() if isinstance(answer, np.ndarray) else answer


GAINS = {"kp": [400.0, 90.0, 30.0], "ki": [0.0, 50.0, 10.0], "kd": [60.0, 9.0, 2.0]}


def test_stability_is_the_services(runtime, links):
    runtime.call("/arm_sim/pause", data=True)
    runtime.call("/arm_sim/reset")
    gains = {name: values[:links] for name, values in GAINS.items()}
    setpoint = [0.4, 0.8, -0.2][:links]
    params = {"gravity": 5.0, "masses": [2.0, 1.0, 0.5][:links], "lengths": [0.5, 0.6, 0.7][:links]}
    theirs = runtime.call("/study/stability", integrator="verlet", gains=gains, setpoint=setpoint, params=params)
    arm = pendularm.Arm(links, **params)
    ours = plain(pendularm.stability(arm, method="verlet", gains=gains, setpoint=setpoint))
    assert ours == theirs
    assert plain(pendularm.stability(pendularm.Arm(links))) == runtime.call("/study/stability")


def test_a_rollout_is_the_services_and_the_simulations(runtime, links):
    runtime.call("/arm_sim/pause", data=True)
    gains = {name: values[:links] for name, values in GAINS.items()}
    asked = {
        "q": [0.4, -0.3, 0.2][:links],
        "qd": [0.5, 0.0, -1.0][:links],
        "duration": 0.8,
        "timestep": 0.002,
        "gains": gains,
        "setpoint": [0.1, 0.2, 0.3][:links],
        "samples": 41,
        "reference": True,
        "control_period": 0.006,
    }
    theirs = runtime.call("/study/rollout", integrator="midpoint", **asked)
    run = pendularm.rollout(pendularm.Arm(links), method="midpoint", **asked)
    ours = plain(run)
    assert run.wall_time > 0
    assert ours["divergence"] is None
    del ours["wall_time"], theirs["wall_time"], ours["reference_positions"], ours["reference_velocities"]
    assert ours == theirs

    arm = pendularm.Simulation(
        pendularm.Arm(links), method="midpoint", timestep=0.002, gains=gains, control_period=0.006
    )
    arm.set_state(asked["q"], asked["qd"])
    arm.set_setpoint(asked["setpoint"])
    arm.enable()
    arm.step(400)
    assert run.positions[-1].tolist() == arm.position.tolist()


def test_samples_are_at_the_times_that_are_asked_for(links):
    arm, times = pendularm.Arm(links), [0.0, 0.0104, 0.0106, 0.5]
    run = pendularm.rollout(arm, t_eval=times, timestep=0.001)
    every = pendularm.rollout(arm, duration=0.5, samples=501)
    assert run.times.tolist() == [0.0, 0.01, 0.011, 0.5]
    assert run.positions.tolist() == every.positions[[0, 10, 11, 500]].tolist()
    assert run.evaluations == every.evaluations
    assert run.reference_positions is None and run.reference_velocities is None


def test_an_effort_is_an_array_or_a_function_and_the_reference_has_it_too(links):
    arm, start = pendularm.Arm(links), [0.3] * links
    asked = {"duration": 0.41, "samples": 42, "control_period": 0.02, "q": start, "effort_limit": [9.0] * links}
    seen = []

    def law(t, q, qd):
        seen.append([t, *q, *qd])
        return pendularm.dynamics.gravity_load(arm, q) - 5.0 * q - qd

    run = pendularm.rollout(arm, effort=law, return_reference=True, **asked)
    one = pendularm.Simulation(arm, control_period=0.02, effort_limit=[9.0] * links)
    one.set_state(start)
    rows = []
    for period in range(21):
        assert seen[period] == [one.time, *one.position, *one.velocity]
        rows.append(law(one.time, one.position, one.velocity))
        one.step(min(20, 410 - one.steps), rows[-1])
    assert len(seen) == 42
    assert run.positions[-1].tolist() == one.position.tolist()
    assert run.efforts[-1].tolist() == one.effort.tolist()
    assert pendularm.rollout(arm, effort=rows, **asked).positions.tolist() == run.positions.tolist()
    assert run.reference_positions.shape == run.reference_velocities.shape == (42, links)
    assert np.abs(run.reference_positions - run.positions).max() < 1e-9
    assert np.isnan(run.sampling_error)
    # A larger timestep has a larger error, which is that of the samples.
    coarse = pendularm.rollout(arm, effort=rows, return_reference=True, timestep=0.01, method="euler", **asked)
    assert coarse.error == np.abs(coarse.reference_positions - coarse.positions).max() > 1e-4
    held = pendularm.rollout(arm, effort=[1.0] * links, **asked)
    assert (held.efforts[1:] == 1.0).all()


def test_a_rollout_that_diverges_says_where():
    run = pendularm.rollout(duration=100, timestep=0.5, method="euler", samples=201, controller=False)
    assert run.divergence is not None
    step, moment = run.divergence
    assert run.times[-1] <= moment == (step - 1) * 0.5
    assert len(run.times) < 201


@pytest.mark.parametrize(
    ("duration", "timestep", "steps"),
    [
        (1, 0.6, 2),
        (1, 0.4, 3),
        (1, 0.3, 3),
        (0.3, 0.2, 2),
        (0.3, 0.1, 3),
        (0.1 + 0.2, 0.1, 3),
        (sum([0.1] * 10), 0.1, 10),
        (0.7, 0.001, 700),
        (0.6, 0.1 + 0.2, 2),
    ],
)
def test_a_run_has_the_nearest_number_of_steps(duration, timestep, steps):
    for samples in [2, 3]:
        run = pendularm.rollout(duration=duration, timestep=timestep, samples=samples, controller=False)
        assert run.times[-1] == steps * timestep
        # The same rule, and the same samples, in a sweep.
        swept = []
        pendularm.sweep(
            {"timestep": [timestep]},
            lambda run: swept.append(run) or run.times[-1],
            duration=duration,
            samples=samples,
            controller=False,
        )
        assert swept[0].times[:, 0].tolist() == run.times.tolist()
        assert swept[0].positions[:, 0].tolist() == run.positions.tolist()
    planned = pendularm.plan(1e-2, duration=duration, controller=False)
    assert round(duration / planned.timestep) * planned.timestep == pytest.approx(duration, rel=1e-12)


def test_a_duration_that_is_a_sum_is_planned_as_the_number():
    one, other = (pendularm.plan(1e-3, duration=it, controller=False) for it in (0.1 + 0.2, 0.3))
    assert one.evaluations.tolist() == other.evaluations.tolist()


def test_a_plan_is_the_services(runtime, links):
    runtime.call("/arm_sim/pause", data=True)
    runtime.call("/arm_sim/reset")
    theirs = runtime.call("/study/plan", error=1e-3, duration=1.0)
    theirs["method"] = theirs.pop("integrator")
    ours = plain(pendularm.plan(1e-3, pendularm.Arm(links), duration=1.0, controller=False))
    assert ours == theirs


def test_suggested_gains_are_the_services(runtime, links):
    runtime.call("/arm_sim/pause", data=True)
    runtime.call("/arm_sim/reset")
    params = {"masses": [0.5, 0.4, 0.3][:links], "lengths": [0.6, 0.5, 0.4][:links]}
    theirs = runtime.call("/study/gains", params=params, settling_time=6.0, margin=1.5, timestep=0.0005)
    found = pendularm.suggest_gains(pendularm.Arm(links, **params), settling_time=6.0, margin=1.5, timestep=0.0005)
    assert plain(found) == theirs
    assert found.margin >= 1.5


@pytest.mark.parametrize(
    "make",
    [
        lambda: pendularm.stability(),
        lambda: pendularm.rollout(duration=0.1),
        lambda: pendularm.plan(0.01, duration=0.1, controller=False),
        lambda: pendularm.suggest_gains(settling_time=10.0),
        lambda: pendularm.sweep({"kp": [1.0]}, duration=0.1, progress=False),
    ],
)
def test_an_answer_is_equal_to_itself_alone(make):
    """Its arrays have no single result of `==`."""
    answer = make()
    assert answer == answer
    assert answer != make()
    assert len({answer, answer}) == 1


FOREVER = """
import pendularm
try:
    print("running", flush=True)
    pendularm.rollout(duration=1e4, timestep=1e-3, reference=True, gains=pendularm.default_gains())
except KeyboardInterrupt:
    print("ended")
"""


def test_ctrl_c_ends_a_long_computation(start_child):
    run = start_child(FOREVER)
    assert run.stdout.readline() == "running\n"
    time.sleep(0.3)
    run.send_signal(signal.SIGINT)
    assert run.stdout.readline() == "ended\n"
    assert run.wait(60) == 0

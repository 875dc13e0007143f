"""One arm is the live arm, bit for bit."""

import copy
import decimal
import fractions
import math
import pickle
import signal
import threading
import types
from collections.abc import Mapping

import numpy as np
import pytest

import pendularm
from pendularm import dynamics


def live_state(runtime, time_of_arm):
    """The joint state that the runtime publishes while paused at that time."""
    while True:
        message = runtime.next_message("/joint_states")
        stamp = message["header"]["stamp"]
        if math.isclose(stamp["sec"] + 1e-9 * stamp["nanosec"], time_of_arm, abs_tol=1e-6):
            return message


@pytest.mark.parametrize("method", ["euler", "midpoint", "verlet", "rk4"])
def test_the_same_calls_give_the_same_bits_as_the_live_arm(runtime, links, method):
    ours = pendularm.Simulation(pendularm.Arm(links))
    runtime.call("/arm_sim/pause", data=True)
    runtime.call("/arm_sim/reset")

    arm = {"gravity": 3.7, "masses": [1.5, 0.8, 0.3][:links], "lengths": [0.9, 0.7, 0.4][:links]}
    runtime.call("/arm_sim/set_params", **arm)
    ours.arm = pendularm.Arm(links, **arm)
    runtime.call("/arm_sim/set_integrator", method=method, timestep=0.0007)
    ours.method, ours.timestep = method, 0.0007
    gains = {"kp": [300.0, 80.0, 20.0][:links], "ki": [100.0, 40.0, 5.0][:links], "kd": [40.0, 8.0, 1.0][:links]}
    runtime.call("/pid_controller/set_gains", **gains)
    ours.set_gains(**gains)
    runtime.call("/pid_controller/enable", data=True)
    ours.enable()
    setpoint = [0.7, -0.4, 0.2][:links]
    points = [{"positions": setpoint, "velocities": [0.1] * links}]
    runtime.send(op="publish", topic="/joint_trajectory", msg={"points": points})
    ours.set_setpoint(setpoint, [0.1] * links)
    assert runtime.call("/arm_sim/step", steps=300)["steps"] == ours.step(300)
    push = [2.0, -1.0, 0.5][:links]
    runtime.call("/arm_sim/disturb", effort=push, duration=0.05)
    ours.disturb(push, 0.05)
    stepped = runtime.call("/arm_sim/step", steps=400)
    ours.step(400)
    assert stepped["time"] == ours.time

    runtime.send(op="subscribe", topic="/joint_states")
    live = live_state(runtime, ours.time)
    assert live["position"] == ours.position.tolist()
    assert live["velocity"] == ours.velocity.tolist()
    assert live["effort"] == ours.effort.tolist()


def test_a_control_period_and_steps_with_an_effort_have_the_live_bits(runtime, links):
    ours = pendularm.Simulation(pendularm.Arm(links))
    runtime.call("/arm_sim/pause", data=True)
    runtime.call("/arm_sim/reset")
    runtime.call("/pid_controller/enable", data=True)
    ours.enable()
    ours.control_period, ours.control_delay = 0.0031, 1
    found = runtime.call("/pid_controller/set_period", period=0.0031, delay=True)
    assert found == {"period": 0.0031, "effective_period": ours.effective_control_period, "delay": True}
    setpoint, effort = [0.7, -0.4, 0.2][:links], [2.0, -1.0, 0.5][:links]
    runtime.send(op="publish", topic="/joint_trajectory", msg={"points": [{"positions": setpoint}]})
    ours.set_setpoint(setpoint)

    def step_both(steps, **given):
        assert runtime.call("/arm_sim/step", steps=steps, **given) == {
            "steps": ours.step(steps, **given),
            "time": ours.time,
            "position": ours.position.tolist(),
            "velocity": ours.velocity.tolist(),
            "effort": ours.effort.tolist(),
        }

    step_both(17)
    step_both(1, effort=effort)
    step_both(20)
    runtime.call("/arm_sim/disturb", effort=effort, duration=0.02)
    ours.disturb(effort, 0.02)
    # More steps than in one piece.
    step_both(2500, effort=effort)
    step_both(20)
    runtime.call("/arm_sim/set_integrator", timestep=0.0007)
    ours.timestep = 0.0007
    assert runtime.call("/pid_controller/set_period")["effective_period"] == ours.effective_control_period == 4 * 0.0007
    step_both(50)
    runtime.call("/pid_controller/enable", data=False)
    ours.enable(False)
    step_both(3, effort=effort)
    step_both(1)
    assert not ours.effort.any()


def test_a_control_period_is_a_whole_number_of_timesteps():
    arm = pendularm.Simulation(timestep=0.003, control_period=0.01, control_delay=np.int64(2))
    assert (arm.control_period, arm.effective_control_period, arm.control_delay) == (0.01, 3 * 0.003, 2)
    arm.timestep = 0.004
    assert (arm.control_period, arm.effective_control_period) == (0.01, 3 * 0.004)
    arm.control_period, arm.control_delay = 1e-9, 0
    assert (arm.control_period, arm.effective_control_period, arm.control_delay) == (1e-9, 0.004, 0)
    fresh = pendularm.Simulation()
    assert (fresh.control_period, fresh.effective_control_period, fresh.control_delay) == (0, 0.001, 0)


def test_an_effort_is_held_for_its_steps_and_the_controller_stands_still():
    arm = pendularm.Simulation()
    arm.enable()
    arm.set_setpoint([0.3, -0.5])
    arm.step(10)
    integral = arm.integral.tolist()
    assert arm.step(7, [1, -2]) == 7
    assert arm.effort.tolist() == [1, -2]
    assert arm.integral.tolist() == integral
    # Without a step nothing changes: the next step is the controller's, in the same period.
    assert arm.step(0, effort=[5, 5]) == 0
    assert arm.effort.tolist() == [1, -2]
    arm.step()
    assert arm.effort.tolist() != [1, -2]
    assert arm.integral.tolist() != integral
    # Setting a state ends a divergence.
    arm.set_state([0, 0], [1e200, 1e200])
    assert arm.step(5, [1, 1]) == 0
    assert arm.divergence is not None
    arm.set_state([0, 0])
    assert arm.divergence is None
    assert arm.step(5, [1, 1]) == 5


def test_a_fresh_simulation_is_a_fresh_runtime(runtime, links):
    ours = pendularm.Simulation(pendularm.Arm(links))
    params = runtime.call("/arm_sim/set_params")
    assert params["gravity"] == ours.arm.gravity
    assert params["masses"] == ours.arm.masses.tolist()
    assert params["lengths"] == ours.arm.lengths.tolist()
    assert runtime.call("/arm_sim/set_integrator") == {"method": ours.method, "timestep": ours.timestep}
    gains = runtime.call("/pid_controller/set_gains")
    assert gains == {name: values.tolist() for name, values in ours.gains.items()}
    assert gains == {name: values.tolist() for name, values in pendularm.default_gains(links).items()}
    assert runtime.call("/pid_controller/enable") == {"data": ours.enabled}


def arrays_of(thing):
    """The arrays in the properties of an object, also inside tuples and mappings."""
    for name in dir(type(thing)):
        if not name.startswith("_") and not callable(value := getattr(thing, name)):
            parts = value.values() if isinstance(value, Mapping) else value if isinstance(value, tuple) else [value]
            yield from ((name, part) for part in parts if isinstance(part, np.ndarray))


@pytest.mark.parametrize(
    ("thing", "count"), [(pendularm.Arm(), 3), (pendularm.Simulation(), 14), (pendularm.Batch(3), 7)]
)
def test_no_array_of_a_property_can_be_written(thing, count):
    found = list(arrays_of(thing))
    assert len(found) == count
    for name, array in found:
        for write in [lambda: array.fill(1), lambda: np.add(array, 1, out=array), lambda: array.setflags(write=True)]:
            with pytest.raises(ValueError, match="read-only|cannot set WRITEABLE"):
                write()
        assert (array == array.copy()).all(), name


def test_the_mapping_of_the_gains_can_be_handed_in_but_not_written():
    arm = pendularm.Simulation()
    with pytest.raises(TypeError, match="does not support item assignment"):
        arm.gains["kp"] = [1, 1]
    with pytest.raises(AttributeError):
        arm.gains.update(kp=[1, 1])
    other = pendularm.Simulation(gains={**arm.gains, "kp": 2 * arm.gains["kp"]})
    arm.set_gains(**other.gains)
    assert arm.gains["kp"].tolist() == other.gains["kp"].tolist() == (2 * pendularm.default_gains()["kp"]).tolist()
    assert pendularm.rollout(duration=0.1, gains=arm.gains).evaluations == 400


def test_gains_are_copied_and_handed_in_by_one_rule():
    arm = pendularm.Simulation(gains={"kp": [5, 7]})
    for again in [pickle.loads(pickle.dumps(arm.gains)), copy.copy(arm.gains), copy.deepcopy(arm.gains), dict(arm.gains)]:
        assert list(again) == ["kp", "ki", "kd"]
        assert pendularm.Simulation(gains=again).gains["kp"].tolist() == [5, 7]
    assert "kp" in arm.gains
    assert len(arm.gains) == 3
    assert arm.gains != arm.gains
    suggested = pendularm.suggest_gains()
    for taken in [pendularm.Simulation(gains=suggested).gains, {"kp": suggested.kp, "ki": suggested.ki, "kd": suggested.kd}]:
        assert all(np.array_equal(taken[name], getattr(suggested, name)) for name in ("kp", "ki", "kd"))
    assert np.isnan(pendularm.rollout(duration=0.1, gains=suggested).error)


def test_a_missing_gain_is_the_default_of_a_new_arm_everywhere():
    some, start = {"kp": [1000, 250]}, [0.3, -0.5]
    whole = {**pendularm.default_gains(), **some}
    arm = pendularm.Simulation(gains=some)
    arm.set_setpoint(start)
    arm.enable()
    arm.step(500)
    for gains in [some, {**some, "ki": None}, whole]:
        run = pendularm.rollout(duration=0.5, gains=gains, setpoint=start, samples=2)
        assert run.positions[-1].tolist() == arm.position.tolist()
    found, expected = (pendularm.plan(0.01, gains=gains, setpoint=start) for gains in (some, whole))
    assert (found.method, found.timestep, found.error) == (expected.method, expected.timestep, expected.error)
    free = pendularm.rollout(duration=0.5, samples=2, controller=False)
    zeros = pendularm.rollout(duration=0.5, samples=2, gains=dict.fromkeys(("kp", "ki", "kd"), [0, 0]))
    assert np.array_equal(free.positions, zeros.positions)


def test_a_divergence_is_shown_and_a_reset_clears_it():
    arm = pendularm.Simulation(method="euler", timestep=0.1)
    arm.enable()
    arm.set_setpoint([1.0, 1.0])
    taken = arm.step(10_000)
    assert taken < 10_000
    assert arm.divergence is not None
    assert (arm.divergence.step, arm.divergence.time) == (taken + 1, arm.time)
    assert np.isfinite(arm.position).all()
    assert arm.step(5) == 0
    arm.reset()
    assert arm.divergence is None
    assert arm.time == 0.0
    assert arm.step() == 1


def test_divergences_are_values():
    arm = pendularm.Simulation(method="euler", timestep=0.1)
    arm.enable()
    arm.set_setpoint([1.0, 1.0])
    arm.step(10_000)
    found = arm.divergence
    assert repr(found) == f"Divergence(step={found.step}, time={found.time!r})"
    for again in [pickle.loads(pickle.dumps(found)), copy.copy(found), copy.deepcopy(found)]:
        assert again == found
        assert (again.step, again.time) == (found.step, found.time)
    assert len({found, pendularm.Divergence(found.step, found.time), pendularm.Divergence(1, time=0.0)}) == 2
    assert hash(pendularm.Divergence(1, 0.0)) == hash(pendularm.Divergence(1, -0.0))
    with pytest.raises(ValueError, match=r"^step must be a whole number, at least 0 and less than 2\^64, got -1$"):
        pendularm.Divergence(-1, 0.0)
    with pytest.raises(ValueError, match=r"^time must be finite and at least 0, got NaN$"):
        pendularm.Divergence(1, math.nan)


def test_a_state_can_be_set_and_energy_is_kept():
    arm = pendularm.Simulation()
    arm.set_state([0.4, -0.3], [0.1, 0.2])
    before = arm.energy
    assert before == dynamics.kinetic_energy(arm.arm, arm.position, arm.velocity) + dynamics.potential_energy(
        arm.arm, arm.position
    )
    arm.step(1000)
    # Runge-Kutta 4 at 1 ms loses some 1e-11 J in a second.
    assert math.isclose(arm.energy, before, abs_tol=1e-8)
    assert arm.end_effector.tolist() == pendularm.end_effector(arm.arm, arm.position).tolist()


def test_arms_are_values():
    arm = pendularm.Arm(3, lengths=[1, 2, 0.5], gravity=1.6)
    assert arm == pendularm.Arm(3, lengths=np.array([1.0, 2.0, 0.5]), masses=(1, 1, 1), gravity=1.6)
    assert arm != pendularm.Arm(3)
    assert arm != pendularm.Arm(3, lengths=[1, 2, 0.5], gravity=1.6, viscous=[0, 0, 0.1])
    assert len({arm, pendularm.Arm(3, lengths=[1, 2, 0.5], gravity=1.6), pendularm.Arm(3), pendularm.Arm(2)}) == 3
    # Two zeros that are equal, but have different bits.
    assert len({pendularm.Arm(gravity=0.0), pendularm.Arm(gravity=-0.0)}) == 1
    for again in [pickle.loads(pickle.dumps(arm)), copy.copy(arm), copy.deepcopy(arm)]:
        assert again == arm
        assert hash(again) == hash(arm)
    assert arm.reach == 3.5
    assert repr(arm) == "Arm(3, lengths=[1.0, 2.0, 0.5], masses=[1.0, 1.0, 1.0], gravity=1.6, viscous=[0.0, 0.0, 0.0])"


def test_the_controller_is_turned_on_by_numpys_truth_too():
    arm, batch = pendularm.Simulation(), pendularm.Batch(1)
    for one in [arm, batch]:
        one.set_setpoint([1, 1])
        one.enable(np.True_)
        one.step()
        assert one.effort.any()
        one.enable(np.False_)
        one.step()
        assert not one.effort.any()
    assert not arm.enabled


def test_numbers_may_be_any_that_python_has():
    arm = pendularm.Simulation(timestep=np.float32(0.5))
    for timestep in [1, np.int8(1), np.array(1.0), decimal.Decimal(1), fractions.Fraction(1)]:
        arm.timestep = timestep
        assert arm.timestep == 1
    arm.set_state([decimal.Decimal(1), 10**3], np.ma.masked_array([1, 2]))
    assert arm.position.tolist() == [1, 1000]
    assert arm.velocity.tolist() == [1, 2]


def test_gains_may_be_any_mapping():
    given = types.MappingProxyType({"kp": [1, 2], "kd": None})
    found = pendularm.Simulation(gains=given).gains
    assert found["kp"].tolist() == [1, 2]
    assert found["kd"].tolist() == pendularm.default_gains()["kd"].tolist()


def test_threads_share_one_arm():
    arm = pendularm.Simulation()
    threads = [threading.Thread(target=arm.step, args=(20_000,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    alone = pendularm.Simulation()
    alone.step(80_000)
    assert arm.position.tolist() == alone.position.tolist()


FOREVER = """
import pendularm, threading, time
arm = pendularm.Simulation()
def tell():
    while arm.steps == 0:
        time.sleep(0.001)
    print("stepping", flush=True)
threading.Thread(target=tell, daemon=True).start()
try:
    arm.step(10**15)
except KeyboardInterrupt:
    print(arm.steps > 0)
"""


def test_ctrl_c_ends_a_long_run(start_child):
    run = start_child(FOREVER)
    assert run.stdout.readline() == "stepping\n"
    run.send_signal(signal.SIGINT)
    assert run.stdout.readline() == "True\n"
    assert run.wait(60) == 0

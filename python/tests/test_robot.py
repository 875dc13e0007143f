"""Motors, friction and sensors: bit-identical to the live arm's, and equal to the theory."""

import numpy as np
import pytest

import pendularm

FORMS = ["clamp", "none", "conditional", "back_calculation"]


def robot(links, form="clamp"):
    """Keyword arguments of a robot, and the services' fields for the same."""
    limit, step, viscous = [60.0, 12.0, 0.0][:links], [2e-3, 0.0, 1e-3][:links], [0.5, 0.0, 0.2][:links]
    limits = {"effort": limit, "anti_windup": form, "tracking_time": 0.3}
    sensors = {"encoder_step": step, "velocity": "difference", "delay": 3}
    given = {"effort_limit": limit, "anti_windup": form, "tracking_time": 0.3, "encoder_step": step}
    given |= {"velocity_source": "difference", "control_delay": 3, "control_period": 0.004}
    return viscous, given, {"limits": limits, "sensors": sensors, "viscous": viscous, "control_period": 0.004}


@pytest.mark.parametrize("form", FORMS)
def test_a_robot_is_the_live_one(runtime, links, form):
    viscous, given, fields = robot(links, form)
    ours = pendularm.Simulation(pendularm.Arm(links, viscous=viscous), **given)
    runtime.call("/arm_sim/pause", data=True)
    runtime.call("/arm_sim/reset")
    assert runtime.call("/arm_sim/set_friction", viscous=viscous)["viscous"] == ours.arm.viscous.tolist()
    assert runtime.call("/pid_controller/set_limits", **fields["limits"]) == fields["limits"]
    assert runtime.call("/pid_controller/set_sensors", **fields["sensors"]) == fields["sensors"]
    runtime.call("/pid_controller/set_period", period=0.004)
    runtime.call("/pid_controller/enable", data=True)
    setpoint = [1.2, -0.7, 0.4][:links]
    runtime.send(op="publish", topic="/joint_trajectory", msg={"points": [{"positions": setpoint}]})
    ours.set_setpoint(setpoint)
    ours.enable()

    def step_both(steps, **more):
        live = runtime.call("/arm_sim/step", steps=steps, **more)
        assert ours.step(steps, **more) == live["steps"]
        for name in ["position", "velocity", "effort"]:
            assert live[name] == getattr(ours, name).tolist(), name

    step_both(301)
    step_both(5, effort=[100.0] * links)
    assert ours.effort.tolist() == given["effort_limit"]
    step_both(40)
    runtime.call("/pid_controller/set_limits", effort=None)
    ours.effort_limit = [np.inf] * links
    step_both(200)
    assert ours.effort_limit.tolist() == [np.inf] * links


def test_the_study_takes_a_robot_as_the_services_do(runtime, links):
    runtime.call("/arm_sim/pause", data=True)
    runtime.call("/arm_sim/reset")
    viscous, given, fields = robot(links)
    fields["limits"]["effort"] = given["effort_limit"] = [60.0, 30.0, 20.0][:links]
    arm = pendularm.Arm(links, viscous=viscous)
    gains = {name: list(values) for name, values in pendularm.default_gains(links).items()}
    theirs = runtime.call("/study/rollout", gains=gains, setpoint=[0.5] * links, duration=0.6, **fields)
    ours = pendularm.rollout(arm, gains=gains, setpoint=[0.5] * links, duration=0.6, **given)
    assert ours.positions.tolist() == theirs["positions"]
    assert ours.efforts.tolist() == theirs["efforts"]
    ideal = pendularm.rollout(gains=gains if links == 2 else None, duration=0.6)
    assert ideal.positions[-1].tolist() != theirs["positions"][-1]
    theirs = runtime.call("/study/stability", gains=gains, **fields)
    ours = pendularm.stability(arm, gains=gains, **given)
    assert (ours.control_period_limit, ours.timestep_limit) == (theirs["control_period_limit"], theirs["timestep_limit"])
    late, ideal = pendularm.stability(arm, control_delay=2, control_period=1e-3), pendularm.stability(arm)
    assert late.control_period_limit < ideal.control_period_limit


def test_a_sweep_takes_a_robot():
    grid = {"effort_limit": [25.0, np.inf, [60.0, 10.0]], "control_delay": [0, 2], "anti_windup": ["clamp", "conditional"]}
    fixed = {"viscous": 0.3, "encoder_step": [1e-3, 0.0], "velocity_source": "difference", "tracking_time": 0.5}
    found = pendularm.sweep(
        grid, "final_error", setpoint=[0.9, -0.4], control_period=0.002, duration=0.5, progress=False, piece=5, **fixed
    )
    for place in np.ndindex(3, 2, 2):
        limit, delay, form = (values[at] for values, at in zip(grid.values(), place, strict=True))
        arm = pendularm.Simulation(
            pendularm.Arm(viscous=[0.3, 0.3]),
            effort_limit=np.broadcast_to(limit, 2),
            control_delay=delay,
            anti_windup=form,
            tracking_time=0.5,
            control_period=0.002,
            encoder_step=[1e-3, 0.0],
            velocity_source="difference",
        )
        arm.set_setpoint([0.9, -0.4])
        arm.enable()
        arm.step(500)
        assert found["final_error"][place] == np.abs(arm.position - [0.9, -0.4]).max()
    # Without a limit the anti-windup has no effect.
    assert len(np.unique(found["final_error"])) == 10


def test_a_limit_below_the_load_lets_the_arm_fall_and_no_motor_does_nothing():
    arm = pendularm.Simulation(effort_limit=[10.0, 0.0])
    arm.set_setpoint([0.0, 0.0])
    arm.enable()
    arm.step(700)
    assert arm.position[0] < -0.1
    assert np.abs(arm.effort).tolist() == [10.0, 0.0]


def test_measured_values_are_those_of_the_encoder():
    arm = pendularm.Simulation(encoder_step=[0.01, 0.0], velocity_source="difference", control_period=0.01)
    arm.set_setpoint([0.5, 0.5])
    arm.enable()
    arm.step(10)
    arm.step(1)
    q, qd = arm.measured
    count = q[0] / 0.01
    assert count == round(count)
    # The second run measured after 10 steps. The first difference is from the start.
    assert qd[0] == pytest.approx(q[0] / 0.01, rel=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        q[0] = 1
    assert pendularm.Simulation().measured[0].tolist() == [0.0, 0.0]


def test_suggested_gains_take_a_robot():
    plain = pendularm.suggest_gains()
    damped = pendularm.suggest_gains(pendularm.Arm(viscous=[30.0, 8.0]), effort_limit=[400.0, 150.0])
    assert not np.array_equal(plain.kp, damped.kp) or plain.timestep_limit != damped.timestep_limit

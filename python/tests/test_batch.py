"""A batch gives each arm the bits of a single simulation, on any number of threads. Arrays keep their memory layout."""

import numpy as np
import pytest

import pendularm

METHODS = ["euler", "midpoint", "verlet", "rk4"]
FORMS = ["clamp", "none", "conditional", "back_calculation"]


def settings(links, arms, seed=1):
    """Arms with different settings, and the single simulations to compare them with."""
    random = np.random.default_rng(seed)
    rows = lambda low, high: random.uniform(low, high, (arms, links))
    robot = np.arange(arms)[:, None] % 5
    given = {
        "lengths": rows(0.5, 2.0),
        "masses": rows(0.5, 2.0),
        "gravity": random.uniform(0, 12, arms),
        "kp": rows(0, 200),
        "ki": rows(0, 50),
        "kd": rows(0, 20),
        "setpoint": (rows(-2, 2), rows(-1, 1)),
        "q": rows(-3, 3),
        "qd": rows(-2, 2),
        # Every fifth arm has ideal motors, joints and sensors, every seventh one a joint without a motor.
        "effort_limit": np.where(robot == 0, np.inf, np.where(np.arange(arms)[:, None] % 7, rows(1, 60), 0)),
        "anti_windup": [FORMS[arm % 4] for arm in range(arms)],
        "tracking_time": random.uniform(0.01, 1, arms),
        "viscous": np.where(robot == 0, 0, rows(0, 2)),
        "encoder_step": np.where(robot == 0, 0, rows(0, 1e-2)),
        "velocity_source": [("exact", "difference")[arm % 5 % 2] for arm in range(arms)],
        "method": [METHODS[arm % 4] for arm in range(arms)],
        "timestep": random.uniform(1e-4, 2e-3, arms),
        # Every third controller runs in every step.
        "control_period": np.where(np.arange(arms) % 3 == 0, 0, random.uniform(0, 1e-2, arms)),
        "control_delay": np.arange(arms) % 3 // 2 * (1 + np.arange(arms) % 16),
    }
    singles = []
    for arm in range(arms):
        one = pendularm.Simulation(
            pendularm.Arm(
                links, **{name: given[name][arm] for name in ("lengths", "masses", "gravity", "viscous")}
            ),
            **{name: given[name][arm] for name in ("method", "timestep", "control_period", "control_delay")},
            **{name: given[name][arm] for name in ("effort_limit", "anti_windup", "tracking_time")},
            **{name: given[name][arm] for name in ("encoder_step", "velocity_source")},
        )
        one.set_gains(given["kp"][arm], given["ki"][arm], given["kd"][arm])
        one.set_setpoint(*(rows[arm] for rows in given["setpoint"]))
        one.set_state(given["q"][arm], given["qd"][arm])
        one.enable()
        singles.append(one)
    return given, singles


def batch_of(given, links, arms, threads):
    batch = pendularm.Batch(arms, links, threads=threads)
    batch.set_params(given["gravity"], given["masses"], given["lengths"], given["viscous"])
    batch.set_integrator(given["method"], given["timestep"])
    batch.set_control_period(given["control_period"], given["control_delay"])
    batch.set_gains(given["kp"], given["ki"], given["kd"])
    batch.set_limits(given["effort_limit"], given["anti_windup"], given["tracking_time"])
    batch.set_sensors(given["encoder_step"], given["velocity_source"])
    batch.set_setpoint(*given["setpoint"])
    batch.set_state(given["q"], given["qd"])
    batch.enable()
    return batch


def compare(batch, singles):
    assert batch.position.tolist() == [one.position.tolist() for one in singles]
    assert batch.velocity.tolist() == [one.velocity.tolist() for one in singles]
    assert batch.effort.tolist() == [one.effort.tolist() for one in singles]
    assert batch.time.tolist() == [one.time for one in singles]
    assert batch.diverged.tolist() == [one.divergence is not None for one in singles]
    assert batch.energy.tolist() == [one.energy for one in singles]
    assert batch.end_effector.tolist() == [one.end_effector.tolist() for one in singles]


@pytest.mark.parametrize("threads", [1, 2, 3, 8])
def test_every_lane_is_a_single_arm(links, threads):
    arms = 70
    given, singles = settings(links, arms)
    batch = batch_of(given, links, arms, threads)
    compare(batch, singles)
    batch.step(150)
    for one in singles:
        one.step(150)
    compare(batch, singles)

    # An effort in place of the controllers', only for the steps of the call.
    effort = np.random.default_rng(2).uniform(-3, 3, (arms, links))
    batch.step(40, effort)
    for one, each in zip(singles, effort, strict=True):
        one.step(40, each)
    compare(batch, singles)
    limit, steady = given["effort_limit"], ~batch.diverged
    assert steady.sum() > 60
    assert np.array_equal(batch.effort[steady], np.clip(effort, -limit, limit)[steady])
    batch.step()
    for one in singles:
        one.step()
    compare(batch, singles)
    assert not np.array_equal(batch.effort, effort)

    # An effort added to the controllers', for a time.
    duration = np.linspace(0.001, 0.02, arms)
    batch.disturb(effort, duration)
    batch.step(30)
    for one, push, time in zip(singles, effort, duration, strict=True):
        one.disturb(push, time)
        one.step(30)
    compare(batch, singles)

    each = np.arange(arms)
    batch.step(each)
    for one, steps in zip(singles, each, strict=True):
        one.step(int(steps))
    compare(batch, singles)

    batch.reset(batch.position[:, 0] > 0)
    for one in singles:
        if one.position[0] > 0:
            one.reset()
    compare(batch, singles)


def test_one_control_period_for_all_and_what_is_left_out_stays():
    batch, one = pendularm.Batch(3, threads=1), pendularm.Simulation(control_period=0.01, control_delay=2)
    batch.set_control_period(0.01, [1] * 3)
    batch.set_control_period(control_delay=np.uint8(0))
    batch.set_control_period(control_delay=2)
    batch.set_control_period()
    for each in [batch, one]:
        each.enable()
        each.set_setpoint([0.3, -0.5])
        each.step(333)
    assert batch.position.tolist() == [one.position.tolist()] * 3
    batch.set_control_period([0, 0.01, 0.01], [0, 2, 2])
    one.control_period, one.control_delay = 0, 0
    batch.step(7)
    one.step(7)
    assert batch.position[0].tolist() == one.position.tolist()
    assert batch.position[0].tolist() != batch.position[1].tolist()


def test_an_arm_that_diverges_leaves_the_others_alone():
    batch = pendularm.Batch(3, threads=1)
    batch.set_integrator("euler", [0.001, 0.2, 0.001])
    batch.enable()
    batch.set_setpoint([1.0, 1.0])
    batch.step(2000)
    assert batch.diverged.tolist() == [False, True, False]
    assert np.isfinite(batch.position).all()
    assert batch.position[0].tolist() == batch.position[2].tolist()
    batch.reset([1])
    assert not batch.diverged.any()
    assert batch.time.tolist() == [2.0, 0.0, 2.0]


@pytest.mark.parametrize("steps_before", [0, 5])
def test_an_effort_ends_with_its_call_also_for_an_arm_that_diverges(steps_before):
    batch = pendularm.Batch(2, threads=1)
    batch.set_state([0.0, 0.0], [1e200, 1e200], arms=[1])
    batch.step(steps_before)
    batch.step(100, [3.0, 1.0])
    assert batch.diverged.tolist() == [False, True]
    batch.set_state([0.3, -0.5])
    batch.step()
    assert batch.effort.tolist() == [[0.0, 0.0]] * 2
    assert batch.position[1].tolist() == batch.position[0].tolist()


def test_arrays_come_out_without_copies_and_cannot_be_written(links):
    batch = pendularm.Batch(8, links)
    position, time = batch.position, batch.time
    assert position.shape == (8, links)
    assert batch.position is position
    batch.step(10)
    assert position is batch.position
    assert position[0, 0] != 0.0
    assert time[0] == 0.01
    for name in ["position", "velocity", "effort", "time", "diverged"]:
        assert not getattr(batch, name).flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            getattr(batch, name)[0] = 1


def test_a_batchs_own_arrays_go_in():
    batch, other = pendularm.Batch(4), pendularm.Batch(4)
    for one in [batch, other]:
        one.set_state(np.arange(8.0).reshape(4, 2))
    batch.step(2, batch.position)
    other.step(2, other.position.copy())
    assert batch.velocity.tolist() == other.velocity.tolist()
    other.set_state(batch.position, batch.velocity)
    batch.set_state(batch.position[::-1], batch.velocity[::-1])
    assert batch.position.tolist() == other.position[::-1].tolist()


def packed(numbers):
    """A field of a packed record: its doubles are not aligned."""
    records = np.zeros(len(numbers), [("name", "u1"), ("field", numbers.dtype, numbers.shape[1:])])
    records["field"] = numbers
    return records["field"]


@pytest.mark.parametrize(
    "laid",
    [np.asfortranarray, lambda numbers: numbers.T.copy().T, packed, lambda numbers: numbers[::-1].copy()[::-1]],
    ids=["fortran", "transposed", "packed", "backwards"],
)
def test_numbers_are_those_of_their_indices_however_they_lie(links, laid):
    random = np.random.default_rng(3)
    numbers = random.uniform(0.1, 1, (5, links))
    batch, other = pendularm.Batch(5, links), pendularm.Batch(5, links)
    for one, given in [(batch, laid), (other, np.copy)]:
        one.set_integrator(timestep=given(0.001 * numbers[:, 0]))
        one.set_params(given(numbers[:, 1]), given(numbers), given(numbers))
        one.set_gains(given(numbers), given(numbers), given(numbers))
        one.set_setpoint(given(numbers), given(numbers))
        one.set_state(given(numbers), given(numbers))
        one.enable()
        one.step(20, given(numbers))
    assert laid(numbers).tolist() == numbers.tolist()
    assert batch.time.tolist() == other.time.tolist()
    assert batch.effort.tolist() == other.effort.tolist()
    assert batch.position.tolist() == other.position.tolist()
    arm, single = pendularm.Arm(links), pendularm.Simulation(pendularm.Arm(links))
    assert pendularm.end_effector(arm, laid(numbers)).tolist() == pendularm.end_effector(arm, numbers).tolist()
    single.set_state(laid(numbers[:links, 0]))
    assert single.position.tolist() == numbers[:links, 0].tolist()


def test_a_mask_may_be_a_view_or_of_objects():
    batch, mask = pendularm.Batch(3), np.array([True, False, True])
    views = [np.stack([mask, ~mask], axis=1)[:, 0], np.repeat(mask, 2)[::2], mask[::-1], packed(mask)]
    views.append(mask.astype(object))
    for view in views:
        chosen = view.tolist()
        batch.set_state([0.5, 0.5])
        batch.set_state([0.25, 0.25], arms=view)
        assert (batch.position[:, 0] == 0.25).tolist() == chosen
        batch.reset(view)
        assert (batch.position[:, 0] == 0).tolist() == chosen
    batch.reset((batch.position > 0)[:, 0])
    assert not batch.position.any()


@pytest.mark.parametrize("shape", [(2,), (1, 2)])
def test_one_row_applies_to_all_arms(shape):
    batch, row = pendularm.Batch(3), np.array([0.3, -0.4]).reshape(shape)
    batch.set_state(row, row)
    batch.set_setpoint(row, row)
    batch.set_gains(row + 5, row + 5, row + 5)
    batch.set_params(masses=row + 1)
    batch.step(5, row)
    one = pendularm.Batch(1)
    one.set_state(row, row)
    one.set_params(masses=row + 1)
    one.step(5, row)
    assert batch.position.tolist() == one.position.tolist() * 3
    arm = pendularm.Arm()
    expected = pendularm.dynamics.coriolis(arm, batch.position, [0.3, -0.4])
    assert np.array_equal(pendularm.dynamics.coriolis(arm, batch.position, row), expected)

"""Copies, pickles and states as bytes: the same steps afterwards, bit for bit."""

import copy
import pickle
import struct

import numpy as np
import pytest

import pendularm

HEAD = len(b"pendularm state 1")


def busy(links, kind=pendularm.Simulation):
    """An arm with every part of its state in use."""
    arm = pendularm.Arm(links, masses=[1.5, 0.8, 0.3][:links], gravity=3.7, viscous=[0.3, 0.1, 0.2][:links])
    one = kind(arm, method="verlet", timestep=0.0013, control_period=0.004, control_delay=3)
    one.set_gains(kp=[300, 80, 20][:links])
    one.set_setpoint([0.7, -0.4, 0.2][:links], [0.1] * links)
    one.step(100)
    one.timestep = 0.0007
    one.enable()
    one.step(101)
    one.effort_limit = [40.0, np.inf, 0.0][:links]
    one.anti_windup, one.tracking_time = "back_calculation", 0.1
    one.encoder_step, one.velocity_source = [1e-3, 0.0, 1e-4][:links], "difference"
    one.disturb([2.0, -1.0, 0.5][:links], 0.05)
    one.step(7)
    return one


def many(links):
    batch = pendularm.Batch(40, links, threads=2)
    random = np.random.default_rng(1)
    batch.set_integrator(["euler", "midpoint", "verlet", "rk4"] * 10, random.uniform(1e-4, 1e-3, 40))
    batch.set_control_period(random.uniform(0, 4e-3, 40), [0, 1, 2, 5] * 10)
    batch.set_limits(random.uniform(1, 50, (40, links)), ["clamp", "none", "conditional", "back_calculation"] * 10)
    batch.set_sensors(random.uniform(0, 1e-3, (40, links)), ["exact", "difference"] * 20)
    batch.set_params(viscous=random.uniform(0, 1, (40, links)), gravity=random.uniform(0, 9, 40))
    batch.enable()
    batch.set_state(random.uniform(-1, 1, (40, links)))
    batch.step(100, [1.0] * links)
    batch.set_state([[0.0] * links], [[1e200] * links], arms=[3])
    batch.step(30)
    return batch


def values(one):
    names = ["position", "velocity", "effort", "time", "energy", "end_effector"]
    return [np.array(getattr(one, name)).tobytes() for name in names]


def of_bytes(one):
    other = pendularm.Batch(len(one), one.links) if isinstance(one, pendularm.Batch) else pendularm.Simulation(pendularm.Arm(one.links))
    other.set_state(one.get_state())
    return other


WAYS = [copy.copy, copy.deepcopy, of_bytes]
WAYS += [lambda one, protocol=protocol: pickle.loads(pickle.dumps(one, protocol)) for protocol in range(2, 6)]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("make", [busy, many])
def test_a_copy_takes_the_same_steps(links, make, way):
    one = make(links)
    other = way(one)
    assert values(other) == values(one)
    assert other.get_state() == one.get_state()
    one.step(200)
    assert values(other) != values(one)
    other.step(200)
    assert values(other) == values(one)
    assert other.get_state() == one.get_state()


def test_a_copy_keeps_settings_and_divergence(links):
    one = busy(links)
    one.set_state([0] * links, [1e200] * links)
    one.step(10)
    other = copy.copy(one)
    for name in [
        "arm", "method", "timestep", "control_period", "control_delay",
        "anti_windup", "tracking_time", "velocity_source", "enabled", "steps", "divergence",
    ]:
        assert getattr(other, name) == getattr(one, name), name
    assert other.divergence is not None
    assert other.step() == 0
    batch = many(links)
    assert copy.deepcopy(batch).threads == 2
    assert copy.deepcopy(batch).diverged.tolist() == batch.diverged.tolist()
    assert batch.diverged.tolist() == [arm == 3 for arm in range(40)]


def test_arrays_of_a_batch_show_the_state_that_was_set(links):
    one, other = many(links), pendularm.Batch(40, links)
    position = other.position
    other.set_state(one.get_state())
    assert position.tobytes() == one.position.tobytes()


def test_bytes_that_are_no_state_are_refused_and_change_nothing(links):
    one, batch = busy(links), many(links)
    state, whole, before = one.get_state(), batch.get_state(), values(one) + values(batch)
    said = f"^q must be an array of numbers, or a state of get_state of 1 arms of {links} links$"
    other = pendularm.Simulation(pendularm.Arm(5 - links)).get_state()
    for wrong in [b"", state[:-1], state + b"0", b"p" + state, other, whole]:
        with pytest.raises(ValueError, match=said):
            one.set_state(wrong)
    for wrong in [state, whole[:-8], pendularm.Batch(39, links).get_state()]:
        with pytest.raises(ValueError, match="^q must be an array of numbers, or a state of get_state of 40 arms "):
            batch.set_state(wrong)
    with pytest.raises(ValueError, match="^a state of get_state must be the only argument, got "):
        one.set_state(state, [0.0] * links)
    with pytest.raises(ValueError, match="^a state of get_state must be the only argument, got "):
        batch.set_state(whole, arms=[1])
    assert values(one) + values(batch) == before


def test_no_damaged_number_makes_an_invalid_arm(links):
    """Each number in turn becomes NaN, infinite, negative or a large count."""
    state, refused = busy(links).get_state(), 0
    for place in range(HEAD, len(state), 8):
        for number in [struct.pack("<d", value) for value in (np.nan, np.inf, -1.0, 0.0)] + [b"\xff" * 8]:
            one = pendularm.Simulation(pendularm.Arm(links))
            try:
                one.set_state(state[:place] + number + state[place + 8 :])
            except ValueError:
                refused += 1
            one.step(3)
            assert np.isfinite(one.position).all()
            assert np.isfinite(one.time)
            assert one.timestep > 0
    assert refused > 150

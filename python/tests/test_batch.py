"""Many arms are as many single ones, to the bit, whatever shares the work."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import pendularm

METHODS = ["euler", "midpoint", "verlet", "rk4"]


def settings(links, arms, seed=1):
    """Arms that differ in everything, with the single simulations that they are to be."""
    random = np.random.default_rng(seed)
    rows = lambda low, high: random.uniform(low, high, (arms, links))
    given = {
        "lengths": rows(0.5, 2.0),
        "masses": rows(0.5, 2.0),
        "gravity": random.uniform(0, 12, arms),
        "kp": rows(0, 200),
        "ki": rows(0, 50),
        "kd": rows(0, 20),
        "positions": rows(-2, 2),
        "velocities": rows(-1, 1),
        "position": rows(-3, 3),
        "velocity": rows(-2, 2),
        "method": [METHODS[arm % 4] for arm in range(arms)],
        "timestep": random.uniform(1e-4, 2e-3, arms),
    }
    singles = []
    for arm in range(arms):
        one = pendularm.Simulation(
            pendularm.Arm(
                links, lengths=given["lengths"][arm], masses=given["masses"][arm], gravity=given["gravity"][arm]
            ),
            method=given["method"][arm],
            timestep=given["timestep"][arm],
        )
        one.set_gains(given["kp"][arm], given["ki"][arm], given["kd"][arm])
        one.set_setpoint(given["positions"][arm], given["velocities"][arm])
        one.set_state(given["position"][arm], given["velocity"][arm])
        one.enable()
        singles.append(one)
    return given, singles


def batch_of(given, links, arms, threads):
    batch = pendularm.Batch(arms, links, threads=threads)
    batch.set_params(given["gravity"], given["masses"], given["lengths"])
    batch.set_integrator(given["method"], given["timestep"])
    batch.set_gains(given["kp"], given["ki"], given["kd"])
    batch.set_setpoint(given["positions"], given["velocities"])
    batch.set_state(given["position"], given["velocity"])
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

    # An effort on top of the controllers', for all steps of the call and no longer.
    effort = np.random.default_rng(2).uniform(-3, 3, (arms, links))
    batch.step(40, effort)
    for one, push in zip(singles, effort, strict=True):
        one.disturb(push, 40 * one.timestep)
        one.step(40)
    compare(batch, singles)
    batch.step()
    for one in singles:
        one.step()
    compare(batch, singles)
    assert not np.array_equal(batch.effort, effort)

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


def test_arrays_go_in_as_they_lie():
    batch, other = pendularm.Batch(4), pendularm.Batch(4)
    effort = np.arange(16.0).reshape(4, 4)[:, ::2]
    assert not effort.flags.c_contiguous
    batch.step(5, effort)
    other.step(5, effort.tolist())
    assert batch.position.tolist() == other.position.tolist()
    # A batch's own arrays too.
    batch.step(2, batch.position)
    other.step(2, other.position.copy())
    assert batch.velocity.tolist() == other.velocity.tolist()
    other.set_state(batch.position, batch.velocity)
    batch.set_state(batch.position[::-1], batch.velocity[::-1])
    assert batch.position.tolist() == other.position[::-1].tolist()


def packed(numbers):
    """A field of a packed record: its doubles lie at odd places."""
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


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda batch: pendularm.Batch(0), "n_arms must be between 1 and 1000000, got 0"),
        (lambda batch: pendularm.Batch(1_000_001), "n_arms must be between 1 and 1000000, got 1000001"),
        (lambda batch: pendularm.Batch(-1), "n_arms must be between 1 and 1000000, got -1"),
        (lambda batch: pendularm.Batch(2, 5), "links must be 2 or 3, got 5"),
        (lambda batch: pendularm.Batch(2, -2), "links must be 2 or 3, got -2"),
        (lambda batch: pendularm.Batch(2, threads=-1), "threads must be between 1 and 1024, got -1"),
        (lambda batch: pendularm.Batch(2, threads=2000), "threads must be between 1 and 1024, got 2000"),
        (lambda batch: pendularm.Batch(2, threads=0), "threads must be between 1 and 1024, got 0"),
        (lambda batch: batch.step([1, 2]), "steps must be a whole number, or one for each of 3 arms"),
        (lambda batch: batch.step(-1), "steps must be a whole number, or one for each of 3 arms"),
        (lambda batch: batch.step(1, [[1, 2]]), "effort must have the shape (2,) or (3, 2), got [1, 2]"),
        (lambda batch: batch.step(1, [np.nan, 0]), "effort[0] must be finite, got NaN"),
        (
            lambda batch: batch.step(1, batch.position.base),
            "this batch's own arrays are in use elsewhere: hand in copies of them",
        ),
        (lambda batch: batch.set_gains(ki=[[0, 0], [0, -1], [0, 0]]), "ki[1][1] must be finite and at least 0, got -1"),
        (lambda batch: batch.set_params([1, 2, -3]), "gravity[2] must be finite and at least 0, got -3"),
        (lambda batch: batch.set_params(masses=[0, 1]), "masses[0] must be finite and greater than 0, got 0"),
        (
            lambda batch: batch.set_integrator(timestep=[1, 1]),
            "timestep must be a number or have the shape (3,), got [2]",
        ),
        (lambda batch: batch.set_integrator("leapfrog"), 'method must be one of euler, midpoint, verlet, rk4, got "leapfrog"'),
        (lambda batch: batch.set_integrator(["rk4"]), "method must be a name, or one for each of 3 arms"),
        (lambda batch: batch.enable("yes"), "data must be True or False, got 'yes'"),
        (lambda batch: batch.reset([3]), "arms must be a mask of 3 or indices below that"),
        (lambda batch: batch.reset([True]), "arms must be a mask of 3 or indices below that"),
        (lambda batch: batch.set_state([0, "a"]), "position must be an array of numbers, got [0, 'a']"),
    ],
)
def test_a_bad_value_is_refused_by_the_name_of_its_field(wrong, said):
    batch = pendularm.Batch(3)
    with pytest.raises(ValueError) as refusal:
        wrong(batch)
    assert str(refusal.value) == said
    batch.step()
    assert batch.time.tolist() == [0.001] * 3


class Interrupted(Exception):
    pass


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="there is no such signal here")
def test_an_interrupted_call_leaves_no_effort_on(links):
    def interrupt(*_):
        raise Interrupted

    batch = pendularm.Batch(3, links, threads=1)

    def interrupt_amid():
        while batch.time[0] == 0:
            time.sleep(0.001)
        signal.raise_signal(signal.SIGALRM)

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        threading.Thread(target=interrupt_amid, daemon=True).start()
        with pytest.raises(Interrupted):
            batch.step([10**12, 0, 10**12], np.ones(links))
    finally:
        signal.signal(signal.SIGALRM, before)
    assert batch.time[0] > 0
    assert (batch.effort[0] == 1).all()
    single = pendularm.Simulation(pendularm.Arm(links))
    single.set_state(batch.position[0], batch.velocity[0])
    batch.step(5)
    single.step(5)
    assert not batch.effort.any()
    # But for what the steps before had carried of their rounding.
    assert np.allclose(batch.position[0], single.position, rtol=1e-12)


def test_what_is_refused_has_not_happened():
    for _ in range(5):
        batch, other = pendularm.Batch(2), pendularm.Batch(1, threads=1)
        batch.set_setpoint([1.0, 1.0])
        batch.enable()
        batch.step(100)
        before = batch.energy.tolist()
        pushing = threading.Thread(target=other.step, args=(3_000_000, batch.position.base[:1]))
        pushing.start()
        try:
            # From its first piece on; there are a dozen.
            while other.time[0] == 0:
                time.sleep(0.001)
            refused = 0
            for change in [batch.reset, lambda: batch.set_state([0.1, 0.1]), lambda: batch.enable(False)]:
                try:
                    change()
                except ValueError as refusal:
                    assert "own arrays are in use elsewhere" in str(refusal)
                    assert batch.energy.tolist() == before
                    refused += 1
                else:
                    # Nobody refuses once the push is over.
                    assert other.time[0] > 2999.9
                    break
        finally:
            pushing.join()
        if refused == 3:
            batch.step()
            assert batch.effort.any()
            return
        # On a machine that is busy elsewhere the push may be over before all is tried: then once more.
    raise AssertionError("it was too late each time")


def test_the_interpreters_lock_is_released_while_it_steps(turns_of_another_thread):
    batch = pendularm.Batch(64, threads=1)
    assert turns_of_another_thread(lambda: batch.step(1000)) > 0


def test_calls_of_several_threads_wait_for_each_other():
    batch, alone = pendularm.Batch(16), pendularm.Batch(16)
    threads = [threading.Thread(target=batch.step, args=(3000,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    alone.step(12_000)
    assert batch.position.tolist() == alone.position.tolist()


def test_a_call_waits_for_the_whole_of_another():
    # On a machine that is busy elsewhere the other may be over before this one is called: then once more.
    for _ in range(5):
        batch, alone = pendularm.Batch(1, threads=1), pendularm.Batch(1, threads=1)
        pushing = threading.Thread(target=batch.step, args=(5_000_000, [0.5, 0.0]))
        pushing.start()
        # From its first piece on; there are twenty.
        while batch.time[0] == 0:
            time.sleep(0.001)
        if batch.time[0] < 5000:
            break
        pushing.join()
    assert batch.time[0] < 5000
    batch.step(1000, [0.0, 0.25])
    pushing.join()
    alone.step(5_000_000, [0.5, 0.0])
    alone.step(1000, [0.0, 0.25])
    assert batch.time[0] == alone.time[0]
    assert batch.position.tolist() == alone.position.tolist()


def test_who_only_looks_keeps_nobody_from_stepping():
    arm, batch, said = pendularm.Arm(), pendularm.Batch(2000, threads=1), []

    def call(change):
        try:
            change()
        except ValueError as refusal:
            said.append(refusal)

    changes = [lambda: batch.step(1000), lambda: [(batch.enable(True), batch.reset()) for _ in range(100)]]
    threads = [threading.Thread(target=call, args=(change,)) for change in changes]
    for thread in threads:
        thread.start()
    looks = 0
    while any(thread.is_alive() for thread in threads):
        pendularm.dynamics.kinetic_energy(arm, batch.position, batch.velocity)
        looks += batch.energy.size
    assert looks
    assert not said


WAITING = """
import os, pendularm, signal, threading, time
batch = pendularm.Batch(1, threads=1)
# The handler runs in the middle of the main thread's own call, and waits for nothing.
signal.signal(signal.SIGALRM, lambda *_: print(batch.energy.size, batch.reset(), flush=True))
def interrupt():
    while batch.time[0] == 0:
        time.sleep(0.001)
    signal.raise_signal(signal.SIGALRM)
threading.Thread(target=interrupt).start()
batch.step(10_000_000)
assert 0 < batch.time[0] < 10_000
before = batch.time[0]
threading.Thread(target=batch.step, args=(10**12,), daemon=True).start()
while batch.time[0] == before:
    time.sleep(0.01)
try:
    print("waiting", flush=True)
    batch.reset()
except KeyboardInterrupt:
    print("heard", flush=True)
    os._exit(0)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="there is no such signal here")
def test_who_waits_hears_signals(start_child):
    run = start_child(WAITING)
    assert run.stdout.readline() == "1 None\n"
    assert run.stdout.readline() == "waiting\n"
    time.sleep(0.2)
    run.send_signal(signal.SIGINT)
    assert run.stdout.readline() == "heard\n"
    assert run.wait(60) == 0


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are counted by what Linux lists")
def test_threads_of_batches_that_have_gone_end():
    def count():
        return len(os.listdir("/proc/self/task"))

    before = count()
    for threads in range(2, 40):
        pendularm.Batch(64, threads=threads).step()
    # The threads of the last four batches may still be there.
    most = before + sum(range(36, 40))
    until = time.monotonic() + 30
    while count() > most:
        assert time.monotonic() < until
        time.sleep(0.01)


FORKED = """
import os, pendularm
batch = pendularm.Batch(256, threads=2)
batch.step(100)
child = os.fork()
batch.step(100)
if child == 0:
    os._exit(0 if batch.time[0] == 0.2 else 1)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_forked_child_has_threads_of_its_own():
    # Python itself warns of a fork beside threads.
    assert subprocess.run([sys.executable, "-W", "ignore", "-c", FORKED], timeout=60).returncode == 0

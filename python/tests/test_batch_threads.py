"""Many arms and many threads: calls wait for each other or are refused as a whole, an interrupt ends an added effort,
and threads end."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import pendularm


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
    # Equal up to the carried rounding errors of the earlier steps.
    assert np.allclose(batch.position[0], single.position, rtol=1e-12)


def test_a_refused_call_changes_nothing():
    for _ in range(5):
        batch, other = pendularm.Batch(2), pendularm.Batch(1, threads=1)
        batch.set_setpoint([1.0, 1.0])
        batch.enable()
        batch.step(100)
        before = batch.energy.tolist()
        pushing = threading.Thread(target=other.step, args=(3_000_000, batch.position.base.obj[:1]))
        pushing.start()
        try:
            # During its first piece of a dozen.
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
                    # Nothing is refused after the call has ended.
                    assert other.time[0] > 2999.9
                    break
        finally:
            pushing.join()
        if refused == 3:
            batch.step()
            assert batch.effort.any()
            return
        # On a busy machine the push may be over before all is tried: then once more.
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
    # On a busy machine the other may be over before this one is called: then once more.
    for _ in range(5):
        batch, alone = pendularm.Batch(1, threads=1), pendularm.Batch(1, threads=1)
        pushing = threading.Thread(target=batch.step, args=(5_000_000, [0.5, 0.0]))
        pushing.start()
        # During its first piece of twenty.
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


def test_a_client_that_only_reads_delays_no_step():
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
# The handler runs during the main thread's own call, and does not wait.
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
    print("interrupted", flush=True)
    os._exit(0)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="there is no such signal here")
def test_a_waiting_thread_handles_signals(start_child):
    run = start_child(WAITING)
    assert run.stdout.readline() == "1 None\n"
    assert run.stdout.readline() == "waiting\n"
    time.sleep(0.2)
    run.send_signal(signal.SIGINT)
    assert run.stdout.readline() == "interrupted\n"
    assert run.wait(60) == 0


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are counted by what Linux lists")
def test_threads_of_batches_that_have_gone_end():
    def count():
        return len(os.listdir("/proc/self/task"))

    before = count()
    for threads in range(2, 40):
        pendularm.Batch(64, threads=threads).step()
    # The threads of the last four batches may still exist.
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

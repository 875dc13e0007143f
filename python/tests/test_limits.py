"""Too little memory and too few threads: a Python error or less speed, and the process continues."""

import itertools
import os
import subprocess
import sys

import pytest

import pendularm

resource = pytest.importorskip("resource")


class Endless:
    """A sequence that reports a very large length."""

    def __len__(self):
        return 2**62

    def __getitem__(self, place):
        return 1.0


LONG = [range(10**10), range(2**63), Endless(), [range(10**10)], [1, range(10**10)]]
ARM, BATCH = pendularm.Arm(), pendularm.Batch(2, threads=1)
TAKERS = {
    "step": BATCH.step,
    "effort": lambda long: BATCH.step(1, long),
    "reset": BATCH.reset,
    "set_state": BATCH.set_state,
    "arms": lambda long: BATCH.set_state([0, 0], arms=long),
    "method": BATCH.set_integrator,
    "timestep": lambda long: BATCH.set_integrator(timestep=long),
    "number": lambda long: pendularm.Simulation(timestep=long),
    "gain": lambda long: pendularm.Simulation(gains={"kp": long}),
    "count": pendularm.Batch,
    "lengths": lambda long: pendularm.Arm(lengths=long),
    "dynamics": lambda long: pendularm.dynamics.mass_matrix(ARM, long),
    "rollout": lambda long: pendularm.rollout(q=long),
    "sweep": lambda long: pendularm.sweep({"kp": [long]}),
    "duration": lambda long: pendularm.sweep({"kp": [1]}, duration=long),
}


@pytest.mark.parametrize("long", LONG, ids=["range", "huge", "endless", "inside", "behind"])
@pytest.mark.parametrize("take", TAKERS.values(), ids=TAKERS.keys())
def test_a_sequence_that_is_too_long_is_refused_at_once(take, long):
    with pytest.raises((TypeError, ValueError)):
        take(long)


def test_a_grid_without_an_end_is_refused(monkeypatch):
    monkeypatch.setitem(pendularm.sweep.__globals__, "MOST_SETTINGS", 1000)
    for values in [itertools.count(), range(10**10), Endless()]:
        with pytest.raises(ValueError, match="^grid must have at most 1000 combinations, got 1001"):
            pendularm.sweep({"kp": values})


LIMITED = """
import resource
import numpy as np
import pendularm

arm, batch, rows = pendularm.Arm(), pendularm.Batch(400_000, threads=1), np.zeros((400_000, 2))
numbers, nothing = np.arange(400_000), [0] * 400_000
free = {free} << 20
taken = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (taken + free,) * 2)
kept = []
try:
    while True:
        kept.append({call})
except MemoryError:
    print("told")
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the memory taken is read from Linux")
@pytest.mark.parametrize("free", [1, 5, 30])
@pytest.mark.parametrize(
    "call",
    [
        "pendularm.Batch(10**6, 3)",
        "pendularm.Batch(10**5, threads=1)",
        "batch.energy",
        "batch.end_effector",
        "batch.step(nothing) or bytes(10**6)",
        "batch.reset(numbers) or bytes(10**6)",
        "pendularm.dynamics.mass_matrix(arm, rows)",
        "pendularm.dynamics.forward_dynamics(arm, rows, rows, rows)",
        "pendularm.rollout(duration=50, samples=50_001, reference=False)",
    ],
)
def test_no_memory_is_a_memory_error(call, free):
    script = LIMITED.format(call=call, free=free)
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300)
    assert (run.returncode, run.stdout) == (0, "told\n"), run.stderr


FEW_THREADS = """
import os, resource, threading
import pendularm

most = len(os.listdir("/proc/self/task")) + {more}
resource.setrlimit(resource.RLIMIT_NPROC, (most,) * 2)
if os.getuid() == 0:
    # Root has no limit.
    os.setuid(12_345)
batch, alone = pendularm.Batch(4096, threads=8), pendularm.Batch(4096, threads=1)
batch.step(100)
alone.step(100)
assert (batch.position == alone.position).all()
try:
    pendularm.sweep({{"kp": range(64)}}, duration=0.01, piece=8, progress=False)
    print("swept")
except OSError as why:
    print(why)
"""


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are counted by what Linux lists")
@pytest.mark.parametrize("more", [0, 1, 4])
def test_fewer_threads_share_the_work_where_there_are_no_more(more):
    script = FEW_THREADS.format(more=more)
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    # Other processes of the same user count too.
    can = {"[Errno 11] no thread can be started\n"} | ({"swept\n"} if more else set())
    assert run.stdout in can

"""Sweeps: the same bits from any number of workers, stored on disk and continued, even after the loss of a worker."""

import contextlib
import functools
import itertools
import json
import multiprocessing
import os
import pickle
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import pendularm
from pendularm._code import fingerprint

GRID = {"kp": [100.0, [400.0, 90.0], 900.0], "kd": np.geomspace(5, 80, 7), "method": ["verlet", "rk4"]}
FIXED = {"setpoint": [0.6, -0.4], "duration": 1.0, "samples": 51, "timestep": 0.002}


class Counting(ThreadPoolExecutor):
    """Threads that count their tasks."""

    given = 0

    def submit(self, fn, /, *args):
        self.given += 1
        return super().submit(fn, *args)


def test_every_setting_is_a_run_of_its_own():
    found = pendularm.sweep(GRID, "final_error", **FIXED)
    assert found["final_error"].shape == (3, 7, 2)
    assert found.grid["method"] == ["verlet", "rk4"]
    for place in [(0, 0, 0), (1, 3, 1), (2, 6, 0)]:
        one = pendularm.Simulation(method=GRID["method"][place[2]], timestep=0.002)
        kp, kd = GRID["kp"][place[0]], GRID["kd"][place[1]]
        one.set_gains(kp=np.broadcast_to(kp, 2), kd=[kd, kd])
        one.set_setpoint([0.6, -0.4])
        one.enable()
        one.step(500)
        error = np.abs(one.position - [0.6, -0.4]).max() if one.divergence is None else np.inf
        assert found["final_error"][place] == error


def test_a_control_period_and_its_delay_are_settings():
    grid = {"control_period": [0, 0.004, 0.006], "control_delay": [0, np.int64(2)]}
    found = pendularm.sweep(grid, "final_error", **FIXED)["final_error"]
    assert len(set(found.flat)) == 6
    for place in np.ndindex(3, 2):
        one = pendularm.Simulation(
            timestep=0.002, control_period=grid["control_period"][place[0]], control_delay=grid["control_delay"][place[1]]
        )
        one.set_setpoint([0.6, -0.4])
        one.enable()
        one.step(500)
        error = np.abs(one.position - [0.6, -0.4]).max() if one.divergence is None else np.inf
        assert found[place] == error


def test_neither_workers_nor_pieces_change_a_bit():
    expected = pendularm.sweep(GRID, "settling_time", **FIXED)["settling_time"]
    assert np.isfinite(expected).any()
    assert not np.isfinite(expected).all()
    for workers, piece in [(1, 42), (2, 5), (5, 1), (3, 1000)]:
        with Counting(workers) as executor:
            found = pendularm.sweep(GRID, "settling_time", executor=executor, piece=piece, **FIXED)
            assert executor.given == -(-42 // piece)
        assert np.array_equal(found["settling_time"], expected)


class Weighing(ThreadPoolExecutor):
    """Threads that count the bytes of each task, as an executor of processes sends them."""

    def __init__(self):
        super().__init__(1)
        self.sent = []

    def submit(self, fn, /, *args):
        sent = pickle.dumps((fn, *args))
        self.sent.append(len(sent))
        return super().submit(*pickle.loads(sent))


def test_a_value_of_the_grid_is_sent_only_with_the_pieces_that_use_it():
    small = {**FIXED, "duration": 0.1, "samples": 2}
    kp = np.geomspace(50, 2000, 3000)
    for grid, piece in [({"kp": kp}, 10), ({"kd": [5.0, 80.0], "kp": kp, "method": ["verlet", "rk4"]}, 7)]:
        expected = pendularm.sweep(grid, "final_error", **small)["final_error"]
        with Weighing() as executor:
            found = pendularm.sweep(grid, "final_error", executor=executor, piece=piece, **small)
        assert np.array_equal(found["final_error"], expected)
        few = {name: values[:piece] for name, values in grid.items()}
        with Weighing() as alone:
            pendularm.sweep(few, "final_error", executor=alone, piece=piece, **small)
        assert max(executor.sent) < max(alone.sent) + 200 < kp.nbytes / 10


def test_threads_are_as_many_as_cores():
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    before, most = threading.active_count(), 0

    def count(run):
        nonlocal most
        most = max(most, threading.active_count())
        time.sleep(0.02)
        return run.energy[-1]

    pendularm.sweep({"kp": range(8 * cores)}, count, duration=0.1, samples=2, piece=1, progress=False)
    assert most - before == cores


class Stopping(ThreadPoolExecutor):
    """One thread, which fails after a number of pieces."""

    def __init__(self, pieces):
        super().__init__(1)
        self.left = pieces

    def submit(self, fn, /, *args):
        self.left -= 1
        return super().submit(fn if self.left >= 0 else stop, *args)


def stop(*_):
    raise RuntimeError("stopped")


def test_a_stopped_sweep_goes_on_where_it_was(tmp_path):
    expected = pendularm.sweep(GRID, "largest_effort", **FIXED)["largest_effort"]
    with Stopping(4) as executor, pytest.raises(RuntimeError, match="stopped"):
        pendularm.sweep(GRID, "largest_effort", executor=executor, folder=tmp_path, piece=6, **FIXED)
    kept = sorted(tmp_path.glob("*.npz"))
    assert len(kept) == 4
    kept[0].write_bytes(b"PK torn")
    with Counting(2) as executor:
        found = pendularm.sweep(GRID, "largest_effort", executor=executor, folder=tmp_path, piece=6, **FIXED)
        assert executor.given == 4
    assert np.array_equal(found["largest_effort"], expected)
    with Counting(1) as executor:
        again = pendularm.sweep(GRID, "largest_effort", executor=executor, folder=tmp_path, piece=6, **FIXED)
        assert executor.given == 0
    assert np.array_equal(again["largest_effort"], expected)


def test_a_folder_holds_one_sweep(tmp_path):
    small = {**FIXED, "duration": 0.1}
    pendularm.sweep({"kp": [1, 2]}, "final_error", folder=tmp_path, **small)
    assert json.loads((tmp_path / "sweep.json").read_text())["metric"] == "final_error"
    with pytest.raises(ValueError, match="holds another sweep: it differs in grid, metric"):
        pendularm.sweep({"kp": [1, 3]}, "settling_time", folder=tmp_path, **small)


def test_numbers_of_numpy_are_numbers(tmp_path):
    ask = {"grid": {"kp": [1.0, 2.0]}, "folder": tmp_path}
    one = pendularm.sweep(
        duration=np.float32(0.5), samples=np.int64(11), links=np.int8(2), controller=np.bool_(True), piece=np.int64(1), **ask
    )
    other = pendularm.sweep(duration=0.5, samples=11, links=2, controller=True, piece=1, **ask)
    assert np.array_equal(one["settling_time"], other["settling_time"])


def test_a_folder_knows_the_order_of_the_grid(tmp_path):
    small = {**FIXED, "duration": 0.1}
    grid = {"kp": [50.0, 500.0], "kd": [2.0, 20.0, 100.0]}
    found = pendularm.sweep(grid, "final_error", folder=tmp_path, **small)["final_error"]
    assert found.shape == (2, 3)
    with pytest.raises(ValueError, match="holds another sweep: it differs in grid"):
        pendularm.sweep(dict(reversed(grid.items())), "final_error", folder=tmp_path, **small)
    assert np.array_equal(pendularm.sweep(grid, "final_error", folder=tmp_path, **small)["final_error"], found)


def test_damaged_pieces_of_a_folder_are_computed_again_or_reported(tmp_path):
    ask = {"grid": {"kp": [1.0, 2.0, 3.0]}, "duration": 0.1, "folder": tmp_path, "piece": 1}
    expected = pendularm.sweep(**ask)["settling_time"]
    assert not list(tmp_path.glob("part-*"))
    file = tmp_path / "000000000001.npz"
    whole = file.read_bytes()
    np.save(tmp_path / "other.npy", expected)
    flipped = [whole[:at] + bytes([whole[at] ^ 255]) + whole[at + 1 :] for at in range(len(whole))]
    for damaged in [b"", b"x" * 500, whole[:-1], whole[:40], (tmp_path / "other.npy").read_bytes(), *flipped[::7]]:
        file.write_bytes(damaged)
        assert np.array_equal(pendularm.sweep(**ask)["settling_time"], expected)
    for values in [{"settling_time": np.zeros(2)}, {"other": np.zeros(1)}, {}]:
        np.savez(file, **values)
        assert np.array_equal(pendularm.sweep(**ask)["settling_time"], expected)
    question = tmp_path / "sweep.json"
    for damaged in [b"", b"{", b"[1]", b"null", b"\xff"]:
        question.write_bytes(damaged)
        with pytest.raises(ValueError, match=r"holds a sweep\.json that cannot be read"):
            pendularm.sweep(**ask)
    question.unlink()
    with pytest.raises(ValueError, match=r"holds pieces of a sweep without their sweep\.json"):
        pendularm.sweep(**ask)
    with pytest.raises(ValueError, match="folder .* must be a folder"):
        pendularm.sweep(**{**ask, "folder": file})


TOGETHER = """
import sys, numpy as np, pendularm
print("here", flush=True)
sys.stdin.readline()
grid = {"kp": np.geomspace(50, 2000, 300)}
found = pendularm.sweep(grid, duration=0.1, samples=2, piece=1, folder=sys.argv[1], progress=False)
print(hash(found["settling_time"].tobytes()))
"""


def test_two_processes_may_share_a_folder(tmp_path):
    begin = lambda: subprocess.Popen(
        [sys.executable, "-c", TOGETHER, str(tmp_path)],
        env={**os.environ, "PYTHONHASHSEED": "0"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    both = [begin() for _ in range(2)]
    assert [one.stdout.readline() for one in both] == ["here\n"] * 2
    for one in both:
        one.stdin.write("\n")
        one.stdin.flush()
    said = [one.communicate(timeout=60)[0] for one in both]
    assert [one.returncode for one in both] == [0, 0]
    assert said[0] == said[1]


@pytest.mark.parametrize("linking", [True, False], ids=["hard links", "no hard links"])
def test_of_two_sweeps_that_begin_in_a_folder_one_has_it(tmp_path, monkeypatch, linking):
    exists, looked = Path.exists, threading.Barrier(2)

    def look(path, **how):
        found = exists(path, **how)
        if path.name == "sweep.json":
            # Neither continues before both have found no file.
            looked.wait(60)
        return found

    def link(*_):
        raise PermissionError("this file system has no hard links")

    def begin(kp):
        try:
            return pendularm.sweep({"kp": [kp, 2 * kp]}, "final_error", folder=tmp_path, **small)["final_error"]
        except ValueError as refusal:
            return refusal

    small = {**FIXED, "duration": 0.1}
    if not linking:
        monkeypatch.setattr(os, "link", link)
    monkeypatch.setattr(Path, "exists", look)
    with ThreadPoolExecutor(2) as threads:
        answers = dict(zip([100.0, 900.0], threads.map(begin, [100.0, 900.0]), strict=True))
    monkeypatch.undo()
    (refusal,) = [answer for answer in answers.values() if isinstance(answer, ValueError)]
    assert str(refusal).startswith(f"folder {tmp_path} holds a")
    assert not list(tmp_path.glob("part-*"))
    for kp, answer in answers.items():
        if answer is not refusal:
            assert np.array_equal(begin(kp), answer)
        else:
            assert str(begin(kp)) == f"folder {tmp_path} holds another sweep: it differs in grid"


def test_a_folder_keeps_numbers_under_any_names(tmp_path):
    # NumPy and zip files give most of these a special meaning.
    names = ["a", "a.npy", "arr_0", "arr_1", "file", "allow_pickle", "", "/", "b\0c", "b\0d", "é\ud800"]

    def many(run):
        return {name: run.energy[-1] + place for place, name in enumerate(names)}

    ask = {"grid": {"kp": [1.0, 2.0]}, "metric": many, "q": 0.5, "duration": 0.1, "folder": tmp_path}
    expected = pendularm.sweep(**ask)
    with Counting(1) as executor:
        found = pendularm.sweep(executor=executor, **ask)
        assert executor.given == 0
    assert list(found) == list(expected) == names
    for name in names:
        assert np.array_equal(found[name], expected[name]), name


def test_the_results_are_a_mapping():
    found = pendularm.sweep(GRID, "final_error", **FIXED)
    assert "final_error" in found
    assert "settling_time" not in found
    assert list(found) == list(found.keys()) == ["final_error"]
    assert len(found) == 1
    assert dict(found)["final_error"] is found["final_error"]
    assert found.get("settling_time") is None
    assert found == found
    assert found != pendularm.sweep(GRID, "final_error", **FIXED)
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again["final_error"], found["final_error"])
    assert again.grid.keys() == found.grid.keys()


def test_a_sweep_names_every_encoding(tmp_path):
    script = "import pendularm; pendularm.sweep({'kp': [1.0]}, 'final_error', duration=0.1, folder='sweep')"
    for _ in range(2):
        run = subprocess.run(
            [sys.executable, "-X", "warn_default_encoding", "-W", "error", "-c", script],
            capture_output=True,
            text=True,
            cwd=tmp_path,
        )
        assert run.returncode == 0, run.stderr


def become_old():
    sys.modules["pendularm.sweep"].BUILD = "0.1.0"


def as_older_versions(fn, *args):
    """The results alone, as they were before workers named their wheel."""
    return fn(*args)[1]


class OldAmongNew:
    """Two workers: one with this wheel, and one with an old one."""

    def __init__(self, new, old, change=lambda fn: fn):
        self.workers, self.change = itertools.cycle([(new, lambda fn: fn), (old, change)]), change

    def submit(self, fn, /, *args):
        worker, change = next(self.workers)
        return worker.submit(change(fn), *args)


def test_a_worker_with_another_wheel_is_refused(tmp_path):
    ask = {"metric": "final_error", "piece": 6, "folder": tmp_path, **FIXED}
    with ProcessPoolExecutor(1) as new, ProcessPoolExecutor(1, initializer=become_old) as old:
        with pytest.raises(ValueError, match=r"^a worker has another wheel of pendularm \(0\.1\.0\) than this "):
            pendularm.sweep(GRID, executor=OldAmongNew(new, old), **ask)
        older = OldAmongNew(new, new, lambda fn: functools.partial(as_older_versions, fn))
        with pytest.raises(ValueError, match=r"^a worker has another wheel of pendularm \(of an older version\) than "):
            pendularm.sweep(GRID, executor=older, **ask)
        found = pendularm.sweep(GRID, executor=new, **ask)
    assert np.array_equal(found["final_error"], pendularm.sweep(GRID, "final_error", **FIXED)["final_error"])


def test_a_folder_knows_the_code_of_a_metric(tmp_path):
    def last(factor, kind="position"):
        return lambda run: [factor * run.positions[-1, :, 0] for _ in (0, 1) if kind in {"position", "first"}][0]

    ask = {"grid": {"kp": [1.0, 2.0]}, "q": 0.5, "duration": 0.1, "folder": tmp_path}
    found = pendularm.sweep(metric=last(1.0), **ask)["metric"]
    assert np.array_equal(pendularm.sweep(metric=last(1.0), **ask)["metric"], found)
    first, second = (lambda run: run.positions[-1, :, 0]), (lambda run: run.positions[-1, :, 1])
    for other in [last(2.0), last(1.0, "first"), first, second]:
        with pytest.raises(ValueError, match="holds another sweep: it differs in metric"):
            pendularm.sweep(metric=other, **ask)
    # NumPy returns the fill value of a masked array: True for booleans.
    hidden = [last(np.ma.array([True], mask=mask)) for mask in (True, False)]
    assert len({fingerprint("metric", one) for one in hidden}) == 2
    kept = json.loads((tmp_path / "sweep.json").read_text())
    assert kept["version"] == pendularm.__version__
    (tmp_path / "sweep.json").write_text(json.dumps({**kept, "version": "0.0.1"}))
    with pytest.raises(ValueError, match="holds another sweep: it differs in version"):
        pendularm.sweep(metric=last(1.0), **ask)


ELSEWHERE = """
import sys, pendularm
def metric(run):
    inner = lambda: "energy" in {"energy", "effort", "time"} and 1.0
    return inner() * run.energy[-1]
pendularm.sweep({"kp": [1, 2]}, metric, duration=0.1, folder=sys.argv[1], progress=False)
"""


def test_a_folder_knows_a_metric_again_in_another_process(tmp_path):
    for seed in ["1", "2", "3"]:
        here = {**os.environ, "PYTHONHASHSEED": seed}
        subprocess.run([sys.executable, "-c", ELSEWHERE, str(tmp_path)], env=here, check=True, timeout=60)


def test_a_folder_refuses_a_metric_whose_code_it_cannot_know(tmp_path):
    class Metric:
        def __call__(self, run):
            return run.energy[-1]

        def method(self, run):
            return run.energy[-1]

    def of(run, held=None):
        return run.energy[-1] if held else run.time[-1]

    lock = threading.Lock()
    ask = {"grid": {"kp": [1.0]}, "duration": 0.1}
    for metric in [Metric(), Metric().method, functools.partial(of, held=1), lambda run: run.energy[-1] * bool(lock)]:
        with pytest.raises((TypeError, ValueError), match="^metric must be "):
            pendularm.sweep(metric=metric, folder=tmp_path, **ask)
        assert pendularm.sweep(metric=metric, **ask)["metric"].shape == (1,)
    assert not (tmp_path / "sweep.json").exists()


def test_a_function_may_be_the_metric():
    def both(run):
        assert run.positions.shape == (51, run.diverged.size, 2)
        return {"last": run.times[-1], "largest": np.abs(run.velocities).max(axis=(0, 2))}

    found = pendularm.sweep({"timestep": [0.001, 0.003, 0.2]}, both, links=2, duration=1.0, samples=51, controller=False)
    # The nearest whole step of each.
    assert found["last"].tolist() == [1.0, 333 * 0.003, 1.0]
    assert (found["largest"] > 1).all()
    with pytest.raises(ValueError, match="metric must return one number for each of 2 arms, got the shape"):
        pendularm.sweep({"kp": [1, 2]}, lambda run: run.positions, duration=0.1)


def test_one_step_is_a_run():
    # Three times 0.1 s is longer than 0.3 s only because of rounding.
    found = pendularm.sweep({"timestep": [3 * 0.1, 0.3, 0.1]}, lambda run: run.times[-1], duration=0.3, samples=2)
    assert found["metric"].tolist() == [3 * 0.1, 0.3, 3 * 0.1]


# These tests do not need a fork beside this process's threads. It is the default of older Python
# versions.
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_processes_may_do_the_work():
    expected = pendularm.sweep(GRID, "final_error", **FIXED)
    with ProcessPoolExecutor(2) as executor:
        found = pendularm.sweep(GRID, "final_error", executor=executor, piece=10, **FIXED)
    assert np.array_equal(found["final_error"], expected["final_error"])


def loky_executor():
    loky = pytest.importorskip("loky")
    return loky.get_reusable_executor(2)


# loky's own warnings are loky's.
@pytest.mark.filterwarnings("ignore")
def test_loky_sends_a_metric_of_a_notebook():
    # Such a metric is in no module that a worker can import.
    least = 0.25
    metric = lambda run: np.maximum(np.abs(run.positions[-1] - run.setpoint).max(axis=1), least)
    expected = pendularm.sweep(GRID, metric, **FIXED)
    executor = loky_executor()
    found = pendularm.sweep(GRID, metric, executor=executor, piece=10, **FIXED)
    executor.shutdown()
    assert np.array_equal(found["metric"], expected["metric"])


def losing(run):
    """A metric that ends the first worker that computes it."""
    parent, mark = os.environ["LOSING"].split(" ", 1)
    if os.getpid() != int(parent) and not os.path.exists(mark):
        with contextlib.suppress(FileExistsError):
            open(mark, "x").close()
            time.sleep(0.5)
            os._exit(1)
    return np.abs(run.positions[-1] - run.setpoint).max(axis=1)


# A forked worker would inherit the pipes of the others, and wait for ever.
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", ["processes", "loky"])
def test_a_sweep_whose_worker_is_lost_continues_from_its_folder(kind, tmp_path, monkeypatch):
    monkeypatch.setenv("LOSING", f"{os.getpid()} {tmp_path / 'lost'}")
    ask = {"grid": GRID, "metric": losing, "folder": tmp_path / "kept", "piece": 4, **FIXED}
    begin = lambda: loky_executor() if kind == "loky" else ProcessPoolExecutor(2, multiprocessing.get_context("spawn"))
    executor = begin()
    with pytest.raises(BrokenExecutor):
        pendularm.sweep(executor=executor, **ask)
    executor.shutdown()
    executor = begin()
    found = pendularm.sweep(executor=executor, **ask)
    executor.shutdown()
    expected = pendularm.sweep(GRID, losing, **FIXED)
    assert np.array_equal(found["metric"], expected["metric"])


@pytest.fixture
def cluster(tmp_path):
    """A Dask scheduler and two workers, each in its own process, on loopback."""
    distributed = pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    begin = lambda *command: subprocess.Popen([sys.executable, "-m", *command], stderr=subprocess.DEVNULL)
    here = ["--host", "127.0.0.1", "--no-dashboard"]
    scheduler = ["distributed.cli.dask_scheduler", "--port", "0", "--scheduler-file", str(file), *here]
    worker = ["distributed.cli.dask_worker", "--scheduler-file", str(file), "--no-nanny", "--nthreads", "1", *here]
    worker += ["--local-directory", str(tmp_path)]
    processes = [begin(*scheduler), begin(*worker), begin(*worker)]
    with distributed.Client(scheduler_file=str(file), timeout=120) as client:
        client.wait_for_workers(2, timeout=120)
        yield client, processes[1:]
    for process in reversed(processes):
        process.terminate()
        process.wait(60)


# Dask's own warnings are Dask's.
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_loses_a_worker_midway_answers_the_same(cluster, tmp_path):
    client, workers = cluster

    def slowly(run):
        # The lost worker then runs a piece, and others remain, even if it is lost late.
        time.sleep(0.3)
        return np.abs(run.positions[-1] - run.setpoint).max(axis=1)

    expected = pendularm.sweep(GRID, slowly, **FIXED)
    folder = tmp_path / "kept"
    kept_when_lost = []

    def lose_one():
        while len(list(folder.glob("*.npz"))) < 4:
            time.sleep(0.01)
        workers[0].kill()
        workers[0].wait()
        kept_when_lost.append(len(list(folder.glob("*.npz"))))

    killer = threading.Thread(target=lose_one, daemon=True)
    killer.start()
    found = pendularm.sweep(GRID, slowly, executor=client.get_executor(), folder=folder, piece=1, **FIXED)
    killer.join(60)
    assert kept_when_lost
    assert kept_when_lost[0] < 42
    assert len(client.scheduler_info()["workers"]) == 1
    assert np.array_equal(found["metric"], expected["metric"])
    assert len(list(folder.glob("[0-9]*.npz"))) == 42

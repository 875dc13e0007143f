"""Sweeps: the same bits from any number of workers, kept on disk and gone on with, also where a worker is lost."""

import json
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

import pendularm

GRID = {"kp": [100.0, [400.0, 90.0], 900.0], "kd": np.geomspace(5, 80, 7), "method": ["verlet", "rk4"]}
FIXED = {"setpoint": [0.6, -0.4], "duration": 1.0, "samples": 51, "timestep": 0.002}


class Counting(ThreadPoolExecutor):
    """Threads that count what they are given."""

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


def test_neither_workers_nor_pieces_change_a_bit():
    expected = pendularm.sweep(GRID, "settling_time", **FIXED)["settling_time"]
    assert np.isfinite(expected).any()
    assert not np.isfinite(expected).all()
    for workers, piece in [(1, 42), (2, 5), (5, 1), (3, 1000)]:
        with Counting(workers) as executor:
            found = pendularm.sweep(GRID, "settling_time", executor=executor, piece=piece, **FIXED)
            assert executor.given == -(-42 // piece)
        assert np.array_equal(found["settling_time"], expected)


class Stopping(ThreadPoolExecutor):
    """One thread, which fails after so many pieces."""

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


def test_a_function_may_be_the_metric():
    def both(run):
        assert run.positions.shape == (51, run.diverged.size, 2)
        return {"last": run.times[-1], "largest": np.abs(run.velocities).max(axis=(0, 2))}

    found = pendularm.sweep({"timestep": [0.001, 0.003, 0.2]}, both, links=2, duration=1.0, samples=51, servo=False)
    # The nearest whole step of each.
    assert found["last"].tolist() == [1.0, 333 * 0.003, 1.0]
    assert (found["largest"] > 1).all()
    with pytest.raises(ValueError, match="metric must answer one number for each of 2 arms, got metric of shape"):
        pendularm.sweep({"kp": [1, 2]}, lambda run: run.positions, duration=0.1)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda: pendularm.sweep({}), "grid must have at least one setting"),
        (lambda: pendularm.sweep({"kp": []}), "grid['kp'] must have at least one value"),
        (lambda: pendularm.sweep({"kq": [1]}), "there is no setting 'kq'; there are lengths, masses, kp"),
        (lambda: pendularm.sweep({"kp": [1]}, kp=2), "kp is both in the grid and fixed"),
        (lambda: pendularm.sweep({"kp": [1, -2]}), "kp[1][0] must be finite and at least 0, got -2"),
        (lambda: pendularm.sweep({"kp": [[1, 2, 3]]}), "every kp must be a number or an array of 2, got [[1, 2, 3]]"),
        (lambda: pendularm.sweep({"timestep": ["x"]}), "every timestep must be a number, got ['x']"),
        (lambda: pendularm.sweep({"method": ["leapfrog"]}), "method must be one of euler, midpoint, verlet, rk4"),
        (lambda: pendularm.sweep({"kp": [1]}, "speed"), "metric must be one of final_error, settling_time"),
        (lambda: pendularm.sweep({"kp": [1]}, duration=-1), "duration must be finite and greater than 0, got -1"),
        (lambda: pendularm.sweep({"kp": [1]}, samples=1), "samples must be between 2 and 100000, got 1"),
        (lambda: pendularm.sweep({"kp": [1]}, samples=10**9), "samples must be between 2 and 100000, got 1000000000"),
        (lambda: pendularm.sweep({"kp": [1]}, piece=0), "piece must be between 1 and 24937 with 401 samples, got 0"),
        (
            lambda: pendularm.sweep({"kp": [1]}, piece=10**6),
            "piece must be between 1 and 24937 with 401 samples, got 1000000",
        ),
        (
            lambda: pendularm.sweep({"kp": range(4000), "kd": range(4000)}),
            "grid must have at most 10000000 combinations, got 16000000",
        ),
    ],
)
def test_a_bad_value_is_refused_by_the_name_of_its_field(wrong, said):
    with pytest.raises(ValueError) as refusal:
        wrong()
    assert str(refusal.value).startswith(said)


# A fork beside this process's threads is not asked for by these tests, but by older Pythons' default.
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_processes_may_do_the_work():
    expected = pendularm.sweep(GRID, "final_error", **FIXED)
    with ProcessPoolExecutor(2) as executor:
        found = pendularm.sweep(GRID, "final_error", executor=executor, piece=10, **FIXED)
    assert np.array_equal(found["final_error"], expected["final_error"])


@pytest.fixture
def cluster(tmp_path):
    """A Dask scheduler and two workers, each a process of its own, on loopback."""
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
        # So that the worker that is lost has a piece under way.
        time.sleep(0.1)
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

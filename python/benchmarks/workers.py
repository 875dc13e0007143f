"""Settings per second of one sweep, by the number of workers: workers.py [settings].

It uses threads, the default of `sweep`, and a Dask cluster on loopback whose workers are processes with one thread
(needs `distributed` besides the wheel). The figure is clock time, the best of three rounds, so other programs have an
effect.
"""

import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import distributed
import numpy as np

import pendularm

ROUNDS = 3


def rate(settings: int, executor: object) -> float:
    """Settings per second: gains of a 2-link arm, 2 s each at 2 ms."""
    side = round(settings**0.5)
    grid = {"kp": np.geomspace(50, 2000, side), "kd": np.geomspace(2, 100, side)}
    took = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        pendularm.sweep(
            grid, setpoint=[0.6, -0.4], timestep=0.002, duration=2.0, samples=101, executor=executor, progress=False
        )
        took.append(time.perf_counter() - began)
    return side**2 / min(took)


def main() -> None:
    settings = int(sys.argv[1]) if len(sys.argv) > 1 else 40_000
    print("| workers | threads, settings/s | Dask processes, settings/s |\n| --- | --- | --- |")
    workers = 1
    while workers <= (os.cpu_count() or 1):
        with ThreadPoolExecutor(workers) as threads:
            on_threads = rate(settings, threads)
        here = {"host": "127.0.0.1", "dashboard_address": None, "threads_per_worker": 1}
        with distributed.LocalCluster(n_workers=workers, **here) as cluster, distributed.Client(cluster) as client:
            print(f"| {workers} | {on_threads:,.0f} | {rate(settings, client.get_executor()):,.0f} |")
        workers *= 2


if __name__ == "__main__":
    main()

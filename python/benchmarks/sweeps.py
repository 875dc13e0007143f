"""Processor time of a tenth of the largest sweep, of 10 million settings: sweeps.py [settings]."""

import sys
import time

import numpy as np

import pendularm


def main() -> None:
    settings = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    grid = {"kp": np.geomspace(50, 2000, settings // 200), "kd": np.geomspace(2, 100, 100), "timestep": [0.001, 0.004]}
    wall, own = time.perf_counter(), time.process_time()
    found = pendularm.sweep(grid, "settling_time", setpoint=[0.6, -0.4], progress=False)["settling_time"]
    took = time.process_time() - own
    print(f"{found.size} settings: {took:.0f} s of processor time, {time.perf_counter() - wall:.0f} s")
    print(f"10 million: {took * 1e7 / found.size / 60:.0f} min of one core")


if __name__ == "__main__":
    main()

"""The cost of an error: one swing of the 2- and the 3-link arm by pendularm's and other integrators, to 1e-3, 1e-6
and 1e-9 rad.

equal_error.py FOLDER RUST MUJOCO PINOCCHIO

The programs are those of this folder, compiled (`run.sh` does it); scipy and heyoka run here. All simulate the same
free arm for 4 s, from 0.3 rad and 0.2 rad/s at every joint. The error is the largest angle error at the end, compared
with a motion of twice a double's digits. Every setting (timestep or tolerance) runs for a fiftieth of a second and at
least three times, and the shortest run counts. Everything is repeated in turn PASSES times. The time for an error is
that of the cheapest setting for which all finer ones also keep the error.

scipy gets accelerations compiled by numba. heyoka compiles its own before the clock starts. The exit status is 1 if a
system does not reach an expected error, because then it simulated another arm.
"""

import csv
import functools
import math
import os
import pathlib
import subprocess
import sys
import time

import heyoka
import numba
import numpy as np
import scipy.integrate

DURATION, START, GRAVITY = 4.0, (0.3, 0.2), 9.81
TARGETS = (1e-3, 1e-6, 1e-9)
REPEATED, REPEATS, LONGEST = 0.02, 3, 1.0
TOLERANCES = [10.0 ** (-half / 2) for half in range(4, 29)]
# Methods of first and of second order. Their sweeps end at a second per run, so the missing finer errors are no fault.
LOW_ORDER = ("euler", "midpoint", "verlet", "implicitfast")
# With a larger uncertainty the reference is not usable.
UNCERTAINTY = 1e-20


def coefficients(links):
    """Of the Lagrangian in the angles of the links: couplings and weights of even rods of 1 kg and 1 m."""
    beyond = [links - 1 - i for i in range(links)]
    coupling = [[beyond[i] + 1 / 3 if i == j else beyond[max(i, j)] + 1 / 2 for j in range(links)] for i in range(links)]
    return coupling, [GRAVITY * (beyond[i] + 1 / 2) for i in range(links)]


def accelerations(links, phi, rate, sin, cos):
    """Angular accelerations of the links by elimination, in whatever numbers the angles are."""
    coupling, weight = coefficients(links)
    matrix = [[coupling[i][j] * cos(phi[i] - phi[j]) if i != j else coupling[i][i] + 0 * phi[0] for j in range(links)] for i in range(links)]
    right = [
        -weight[i] * cos(phi[i]) - sum(coupling[i][j] * sin(phi[i] - phi[j]) * rate[j] * rate[j] for j in range(links) if j != i)
        for i in range(links)
    ]
    for pivot in range(links):
        for row in range(pivot + 1, links):
            factor = matrix[row][pivot] / matrix[pivot][pivot]
            for column in range(pivot + 1, links):
                matrix[row][column] = matrix[row][column] - factor * matrix[pivot][column]
            right[row] = right[row] - factor * right[pivot]
    for row in reversed(range(links)):
        for column in range(row + 1, links):
            right[row] = right[row] - matrix[row][column] * right[column]
        right[row] = right[row] / matrix[row][row]
    return right


def compiled(links):
    """The same as a function that scipy can call, compiled by numba."""
    given = coefficients(links)
    coupling, weight = np.array(given[0]), np.array(given[1])

    @numba.njit
    def rates(_, y):
        out = np.empty(2 * links)
        matrix = np.empty((links, links))
        for i in range(links):
            out[i] = y[links + i]
            right = -weight[i] * math.cos(y[i])
            for j in range(links):
                off = y[i] - y[j]
                matrix[i, j] = coupling[i, j] * math.cos(off)
                right -= coupling[i, j] * math.sin(off) * y[links + j] ** 2
            out[links + i] = right
        for pivot in range(links):
            for row in range(pivot + 1, links):
                factor = matrix[row, pivot] / matrix[pivot, pivot]
                for column in range(pivot + 1, links):
                    matrix[row, column] -= factor * matrix[pivot, column]
                out[links + row] -= factor * out[links + pivot]
        for row in range(links - 1, -1, -1):
            for column in range(row + 1, links):
                out[links + row] -= matrix[row, column] * out[links + column]
            out[links + row] /= matrix[row, row]
        return out

    return rates


def start(links):
    """Angles and rates of the links: sums of those of the joints."""
    return np.array([START[0] * (i + 1) for i in range(links)] + [START[1] * (i + 1) for i in range(links)])


def joints(links, y):
    return np.diff(y[:links], prepend=0.0)


def measured(links, system, setting, run, exact):
    """A line in the format of the compiled programs; None once a run takes too long."""
    shortest, runs, begun = math.inf, 0, time.perf_counter()
    while runs < REPEATS or time.perf_counter() - begun < REPEATED:
        runs += 1
        began = time.perf_counter()
        end = run()
        shortest = min(shortest, time.perf_counter() - began)
    error = float(np.abs(joints(links, end) - exact).max()) if np.all(np.isfinite(end)) else math.nan
    return [links, system, setting, error, shortest]


def in_python(links, exact):
    rates, first = compiled(links), start(links)
    rates(0.0, first)
    for method in ("DOP853", "Radau", "LSODA"):
        for tolerance in TOLERANCES:
            if tolerance < 2.3e-14:  # scipy raises smaller tolerances to a hundred times the rounding of a double
                break

            def run(method=method, tolerance=tolerance):
                found = scipy.integrate.solve_ivp(rates, (0.0, DURATION), first, method=method, rtol=tolerance, atol=tolerance)
                return found.y[:, -1]

            row = measured(links, f"scipy {method}", tolerance, run, exact)
            yield row
            if row[4] > LONGEST:
                break
    for integrator, tolerance in taylor(links):

        def run(integrator=integrator):
            integrator.time = 0.0
            integrator.state[:] = first
            integrator.propagate_until(DURATION)
            return integrator.state.copy()

        yield measured(links, "heyoka Taylor", tolerance, run, exact)


@functools.cache
def taylor(links):
    """heyoka's integrators, compiled, one for a tolerance."""
    names = [f"phi{i}" for i in range(links)] + [f"rate{i}" for i in range(links)]
    unknowns = heyoka.make_vars(*names)
    phi, rate = unknowns[:links], unknowns[links:]
    system = list(zip(phi, rate)) + list(zip(rate, accelerations(links, phi, rate, heyoka.sin, heyoka.cos)))
    tolerances = [10.0**-power for power in range(2, 17)]
    return [(heyoka.taylor_adaptive(system, start(links), tol=tolerance), tolerance) for tolerance in tolerances]


def to_error(runs, target):
    """Time of the cheapest run for which all finer ones are also within `target`; None if there is none."""
    runs = sorted(runs, key=lambda run: -run[0])
    kept = []
    for _, error, seconds in reversed(runs):
        if not error <= target:
            break
        kept.append(seconds)
    return min(kept, default=None)


def written(seconds):
    return "-" if seconds is None else f"{1e6 * seconds:.1f}"


def main():
    folder, programs = pathlib.Path(sys.argv[1]), sys.argv[2:]
    passes = int(os.environ.get("PASSES", "3"))
    lines, faults = {}, []
    for links in (2, 3):
        *angles, uncertainty = subprocess.check_output([programs[0], "reference", str(links)], text=True).split()
        print(f"{links} links: the reference ends at {', '.join(angles)} rad, known to {float(uncertainty):.0e} rad")
        if not float(uncertainty) < UNCERTAINTY:
            faults.append(f"{links} links: the reference is off by {uncertainty} rad")
        exact = np.array([float(angle) for angle in angles])
        calls = [[programs[0], "time", str(links)], [programs[1], str(links)], [programs[2], str(links)]]
        for number in range(passes):
            print(f"pass {number + 1} of {passes}", file=sys.stderr)
            rows = []
            for call in calls:
                rows += csv.reader(subprocess.check_output(call + angles, text=True).splitlines())
            rows += in_python(links, exact)
            for _, system, setting, error, seconds in rows:
                key = (links, system, float(setting))
                before = lines.get(key, (math.nan, math.inf))
                lines[key] = (float(error), min(before[1], float(seconds)))
    with open(folder / "runs.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["links", "system", "setting", "error_rad", "shortest_s"])
        table.writerows([links, system, setting, error, seconds] for (links, system, setting), (error, seconds) in lines.items())
    for links in (2, 3):
        systems = dict.fromkeys(system for of, system, _ in lines if of == links)
        rows = []
        for system in systems:
            runs = [(setting, *found) for (of, name, setting), found in lines.items() if of == links and name == system]
            rows.append([system] + [to_error(runs, target) for target in TARGETS])
            if None in rows[-1] and not system.endswith(LOW_ORDER):
                faults.append(f"{links} links: {system} does not come to every error")
            if all(not error < 0.1 for _, error, _ in runs):
                faults.append(f"{links} links: {system} swings another arm")
        print(f"\n{links} links: microseconds to an error at the end of 4 s, the fastest to 1e-9 first")
        print(f"{'':42}" + "".join(f"{target:>12.0e}" for target in TARGETS))
        for row in sorted(rows, key=lambda row: (row[3] is None, row[3] or 0.0, row[2] is None, row[2] or 0.0)):
            print(f"{row[0]:42}" + "".join(f"{written(seconds):>12}" for seconds in row[1:]))
    for fault in faults:
        print(f"equal error: {fault}", file=sys.stderr)
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()

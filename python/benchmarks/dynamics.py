"""Time per state of the accelerations, from array to array, by the number of states: dynamics.py.

The states are drawn once. The best of many calls counts, in clock time on one core.
"""

import timeit

import numpy as np

import pendularm
from pendularm import dynamics


def main() -> None:
    print("| states | 2 links, ns a state | 3 links, ns a state |\n| --- | --- | --- |")
    random = np.random.default_rng(0)
    for states in (1, 64, 1_000, 100_000):
        row = []
        for links in (2, 3):
            arm = pendularm.Arm(links)
            fields = [random.uniform(-3, 3, (states, links)) for _ in range(3)]
            took = timeit.repeat(lambda: dynamics.forward_dynamics(arm, *fields), number=1, repeat=200)
            row.append(f"{min(took) / states * 1e9:,.1f}")
        print(f"| {states:,} | {' | '.join(row)} |")


if __name__ == "__main__":
    main()

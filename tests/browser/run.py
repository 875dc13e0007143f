#!/usr/bin/env python3
"""Runs the browser tests against the binary that `PENDULARM` names: `python3 tests/browser/run.py [-k part of a name]`.

Most of a test's time is waiting for an arm that moves as fast as a real one, so two browsers share the classes.
"""

import concurrent.futures
import io
import pathlib
import sys
import unittest

FOLDER = pathlib.Path(__file__).parent
sys.path.insert(0, str(FOLDER))

from stage import close_browser  # noqa: E402 - the path comes first

SIDES = 2


class Side(unittest.TestLoader):
    """Finds the tests of every other class."""

    def __init__(self, number):
        super().__init__()
        self.turn = number

    def loadTestsFromTestCase(self, case):
        tests = super().loadTestsFromTestCase(case)
        if not tests.countTestCases():
            return tests
        self.turn = (self.turn + 1) % SIDES
        return self.suiteClass() if self.turn else tests


def run(number):
    """Runs one side in a browser of its own: what it said, how many tests it ran, and whether all passed."""
    said = io.StringIO()
    try:
        result = unittest.main(
            module=None, argv=[sys.argv[0], "discover", "-s", str(FOLDER), *sys.argv[1:]], exit=False,
            testLoader=Side(number), testRunner=unittest.TextTestRunner(said, verbosity=2)).result
    finally:
        close_browser()
    return said.getvalue(), result.testsRun, result.wasSuccessful()


if __name__ == "__main__":
    sides = []
    with concurrent.futures.ProcessPoolExecutor(SIDES) as processes:
        for side in concurrent.futures.as_completed(processes.submit(run, number) for number in range(SIDES)):
            sides.append(side.result())
            print(sides[-1][0], flush=True)
    # No test at all is no success either.
    sys.exit(not (all(passed for _, _, passed in sides) and any(ran for _, ran, _ in sides)))

#!/usr/bin/env python3
"""Runs the browser tests against the binary that `PENDULARM` names: `python3 tests/browser/run.py [-k part of a name]`.

Most of a test's time is waiting for an arm that moves as fast as a real one, so several run at a time, each share with its own browser.
"""

import argparse
import concurrent.futures
import os
import pathlib
import subprocess
import sys
import unittest

FOLDER = pathlib.Path(__file__).parent
AT_A_TIME = 3


def names(tests):
    """The full names of all tests in a suite."""
    for test in tests:
        yield from names(test) if isinstance(test, unittest.TestSuite) else [test.id()]


def run(share):
    """Runs the tests with these names: the output, and whether all passed."""
    command = [sys.executable, "-m", "unittest", "-v", *share]
    done = subprocess.run(command, env={**os.environ, "PYTHONPATH": str(FOLDER)}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.stdout, done.returncode == 0


if __name__ == "__main__":
    options = argparse.ArgumentParser()
    options.add_argument("-k", action="append", metavar="PART", help="only tests with this in their name, or that match this pattern")
    loader = unittest.TestLoader()
    loader.testNamePatterns = [part if "*" in part else f"*{part}*" for part in options.parse_args().k or ["*"]]
    chosen = list(names(loader.discover(str(FOLDER))))
    shares = [chosen[first::AT_A_TIME] for first in range(min(AT_A_TIME, len(chosen)))]
    with concurrent.futures.ThreadPoolExecutor(AT_A_TIME) as threads:
        results = []
        for result in threads.map(run, shares):
            results.append(result)
            print(result[0], flush=True)
    # A run without a test is no success.
    sys.exit(not results or not all(passed for _, passed in results))

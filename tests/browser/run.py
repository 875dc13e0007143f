#!/usr/bin/env python3
"""Runs the browser tests against the binary that `PENDULARM` names: `python3 tests/browser/run.py [-k part of a name]`.

Most of a test's time is waiting for an arm that moves as fast as a real one, so two files run at a time, each with its own browser.
"""

import concurrent.futures
import os
import pathlib
import re
import subprocess
import sys
import unittest

FOLDER = pathlib.Path(__file__).parent
AT_A_TIME = 2


def run(path):
    """Runs the tests of one file: its output, how many tests it ran, and whether all passed."""
    command = [sys.executable, "-m", "unittest", "-v", path.stem, *sys.argv[1:]]
    done = subprocess.run(command, env={**os.environ, "PYTHONPATH": str(FOLDER)}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    ran = int(re.search(r"^Ran (\d+) test", done.stdout, re.M)[1])
    return done.stdout, ran, ran == 0 or done.returncode == 0


if __name__ == "__main__":
    with concurrent.futures.ThreadPoolExecutor(AT_A_TIME) as threads:
        results = []
        # Those with most tests first: a long one that begins last would run alone.
        loader = unittest.defaultTestLoader
        for result in threads.map(run, sorted(FOLDER.glob("test_*.py"), key=lambda path: -loader.loadTestsFromName(path.stem).countTestCases())):
            results.append(result)
            if result[1] > 0:
                print(result[0], flush=True)
    # A run without a test is no success.
    sys.exit(not (all(passed for _, _, passed in results) and any(ran for _, ran, _ in results)))

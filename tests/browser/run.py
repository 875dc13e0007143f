#!/usr/bin/env python3
"""Runs the browser tests against the binary that `PENDULARM` names: `python3 tests/browser/run.py [-k part of a name]`."""

import pathlib
import sys
import unittest

FOLDER = pathlib.Path(__file__).parent
sys.path.insert(0, str(FOLDER))

from stage import close_browser  # noqa: E402 - the path comes first

if __name__ == "__main__":
    try:
        result = unittest.main(module=None, argv=[sys.argv[0], "discover", "-s", str(FOLDER), "-v", *sys.argv[1:]], exit=False).result
    finally:
        close_browser()
    # No test at all is no success either.
    sys.exit(not (result.wasSuccessful() and result.testsRun > 0))

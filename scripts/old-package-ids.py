#!/usr/bin/env python3
"""Cargo for releases of cargo-deny before 0.16: `cargo metadata` names packages as before Cargo 1.77.

Those releases parse an id, whose format Cargo never guaranteed: `name version (source)`. Everything else is passed on.
"""

import json
import os
import subprocess
import sys

cargo = os.environ["REAL_CARGO"]
arguments = sys.argv[1:]
if "metadata" not in arguments:
    os.execvp(cargo, [cargo, *arguments])

run = subprocess.run([cargo, *arguments], stdout=subprocess.PIPE, check=False)
if run.returncode != 0:
    sys.exit(run.returncode)
metadata = json.loads(run.stdout)

old = {}
for package in metadata["packages"]:
    source = package["source"] or "path+file://" + os.path.dirname(package["manifest_path"])
    old[package["id"]] = f"{package['name']} {package['version']} ({source})"


def renamed(value):
    """The value with every id in the old form. Nothing else looks like an id."""
    if isinstance(value, str):
        return old.get(value, value)
    if isinstance(value, list):
        return [renamed(one) for one in value]
    if isinstance(value, dict):
        return {key: renamed(one) for key, one in value.items()}
    return value


json.dump(renamed(metadata), sys.stdout)

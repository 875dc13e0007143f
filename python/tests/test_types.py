"""The declared types match the real ones."""

import subprocess
import sys
from pathlib import Path

import pendularm

CONFIGURATION = Path(__file__).parents[1] / "pyproject.toml"


def mypy(*arguments):
    return subprocess.run([sys.executable, "-m", *arguments], capture_output=True, text=True)


def test_the_stubs_are_those_of_the_compiled_module():
    run = mypy("mypy.stubtest", "pendularm._native", "--mypy-config-file", str(CONFIGURATION))
    assert run.returncode == 0, run.stdout + run.stderr


def test_the_package_holds_its_own_types(tmp_path):
    cache = ["--cache-dir", str(tmp_path)]
    run = mypy("mypy", "--config-file", str(CONFIGURATION), *cache, "-p", "pendularm")
    assert run.returncode == 0, run.stdout + run.stderr


def test_numpys_truth_is_one_by_its_type(tmp_path):
    lines = "import numpy, pendularm; truth = numpy.bool_(True)"
    lines += "; pendularm.Batch(1).enable(truth); pendularm.Simulation().enable(truth)"
    lines += "; pendularm.rollout(reference=truth)"
    run = mypy("mypy", "--strict", "--cache-dir", str(tmp_path), "-c", lines)
    assert run.returncode == 0, run.stdout + run.stderr


def test_everything_public_has_a_docstring():
    for name in pendularm.__all__:
        thing = getattr(pendularm, name)
        assert thing.__doc__, name
        if isinstance(thing, type):
            for part, member in vars(thing).items():
                if not part.startswith("_") and (callable(member) or type(member).__name__ == "getset_descriptor"):
                    assert member.__doc__, f"{name}.{part}"
    for name in pendularm.dynamics.__all__:
        assert getattr(pendularm.dynamics, name).__doc__, name

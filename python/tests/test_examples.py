"""The examples do what their docstrings say."""

import json
import runpy
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.parametrize("name", ["closed_loop.py", "lesson.ipynb", "live_client.py", "optimize.py", "policy.py", "underactuated.py"])
def test_an_example_needs_the_wheel_and_not_an_index_that_has_it(name):
    said = (EXAMPLES / name).read_text(encoding="utf-8").split("pip install ")[1:]
    assert all(".whl" in command.split("`")[0] for command in said)


# Jupyter's own warnings are Jupyter's.
@pytest.mark.filterwarnings("ignore")
def test_the_lesson_agrees_with_its_text(tmp_path, play_notebook):
    import nbformat

    notebook = nbformat.read(EXAMPLES / "lesson.ipynb", as_version=4)
    play_notebook(notebook, resources={"metadata": {"path": str(tmp_path)}})
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    figures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(figures) == 2
    said = "".join(output["text"] for output in outputs if output.get("name") == "stdout")
    orders = {line.split()[0]: float(line.split()[2]) for line in said.splitlines() if " order " in line}
    for method, order in {"euler": 1, "midpoint": 2, "verlet": 2, "rk4": 4}.items():
        # With coarse steps the error does not yet follow the order.
        assert abs(orders[method] - order) < 0.3
    _, predicted, _, _, seen, _ = said.splitlines()[-1].split()
    # The timesteps are a twentieth of a percent apart. Near the limit growth is slow.
    assert abs(float(seen) / float(predicted) - 1) < 0.003


def test_a_policy_learns():
    policy = SimpleNamespace(**runpy.run_path(str(EXAMPLES / "policy.py")))
    shown = float(" ".join(policy.__doc__.split()).split("the found one, more than ")[1].split()[0].rstrip("."))
    random = np.random.default_rng(0).normal(size=(8, policy.SIZE))
    found = policy.train(generations=40)
    before = policy.rewards(random, seed=10**8).max()
    after = policy.rewards(found[None], seed=10**8, starts=32)[0]
    assert after > max(before + 0.05, shown / 2)


def test_the_live_client_knows_the_runtimes_port():
    client = SimpleNamespace(**runpy.run_path(str(EXAMPLES / "live_client.py")))
    assert client.address() == ("127.0.0.1", 9095)
    assert client.address("arm.local") == ("arm.local", 9095)
    assert client.address("arm.local:80") == ("arm.local", 80)


def test_roslibpy_moves_the_live_arm(runtime):
    run = subprocess.run(
        [sys.executable, str(EXAMPLES / "live_client.py"), runtime.address], capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.endswith("it is there\n")


# Runs the example in this process, and then the same loop with the offline arm. The two must be bit-identical.
OFFLINE = """
import json, runpy, sys, numpy as np, pendularm
sys.argv = sys.argv[1:]
live = runpy.run_path(sys.argv[0])
arm = pendularm.Simulation(live["arm"], **live["settings"])
while arm.time < 4:
    error = np.concatenate([live["goal"] - arm.position, -arm.velocity])
    arm.step(live["steps"], live["load"] + live["gains"] @ error)
print(json.dumps([arm.time, arm.position.tolist(), arm.velocity.tolist()]))
"""


def test_a_loop_that_is_closed_over_the_wire_is_that_of_the_offline_arm_to_the_bit(runtime, links):
    away = {}
    for law in ["pd", "lqr"]:
        # The client starts with an arm in any state.
        runtime.call("/arm_sim/set_state", position=[0.1] * links)
        example = [str(EXAMPLES / "closed_loop.py"), law, *runtime.address.rsplit(":", 1)]
        run = subprocess.run(
            [sys.executable, "-c", OFFLINE, *example], capture_output=True, text=True, timeout=120
        )
        assert run.returncode == 0, run.stdout + run.stderr
        live, offline = map(json.loads, run.stdout.splitlines())
        assert live == offline
        time, position, _ = live
        assert time == 4
        away[law] = np.abs(np.array([0.8, -0.6, 0.4][:links]) - position).max()
    assert away["lqr"] < away["pd"] < 0.02


def test_gains_by_optuna_hold_the_arm():
    run = subprocess.run([sys.executable, str(EXAMPLES / "optimize.py")], capture_output=True, text=True, timeout=600)
    assert run.returncode == 0, run.stderr
    # The arm sags without an integral.
    assert 0.0 < float(run.stdout.split()[0]) < 0.08

"""The Python code in the documents runs unchanged."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
# The README's other blocks need a runtime, and other tests run them.
README = (ROOT / "README.md").read_text(encoding="utf-8").split("## From Python")[1].split("\n## ")[0]
MANUAL = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")


def blocks(text):
    return [part.split("```")[0] for part in text.split("```python\n")[1:]]


def run(code, folder):
    here = {**os.environ, "MPLBACKEND": "Agg"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=folder, env=here, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_readmes_plot_is_drawn(tmp_path):
    (plot,) = blocks(README)
    run(plot.replace("plt.show()", "plt.savefig('plot.png')"), tmp_path)
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")


def test_each_part_of_the_manual_runs_by_itself(tmp_path):
    # test_learning.py runs the part for stable-baselines3.
    said = "".join(run(part, tmp_path) for part in blocks(MANUAL) if "stable_baselines3" not in part)
    assert "(20, 20, 2)" in said
    assert len(list((tmp_path / "gains").glob("*.npz"))) == 1


def test_each_robot_has_its_limit(tmp_path):
    page = (ROOT / "docs" / "your-robot.md").read_text(encoding="utf-8")
    assert len(page.encode()) <= 10_000
    one, isaac, mujoco, ros = blocks(page)
    said = run(one, tmp_path)
    assert "joint[0]: kd 0.5 N m s/rad needs an effective inertia of at least 0.001 kg m^2 at 0.004 s" in said
    assert [line.split()[:2] for line in run(isaac, tmp_path).splitlines()] == [["0.0", "False"], ["0.001", "True"]]
    assert [line.split()[:2] for line in run(ros, tmp_path).splitlines()] == [["0", "True"], ["1", "False"]]
    if importlib.util.find_spec("mujoco"):
        said = run(mujoco, tmp_path).splitlines()
        assert [line.split()[:2] for line in said[:2]] == [["Euler", "False"], ["implicitfast", "True"]]


def test_the_wheels_own_page_runs(tmp_path):
    for part in blocks((ROOT / "python" / "README.md").read_text(encoding="utf-8")):
        assert "4.0" in run(part, tmp_path)

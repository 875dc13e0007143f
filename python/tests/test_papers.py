"""The Python code in the documents runs unchanged."""

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
    said = "".join(run(part, tmp_path) for part in blocks(MANUAL))
    assert "(20, 20, 2)" in said
    assert len(list((tmp_path / "gains").glob("*.npz"))) == 1


def test_the_wheels_own_page_runs(tmp_path):
    for part in blocks((ROOT / "python" / "README.md").read_text(encoding="utf-8")):
        assert "4.0" in run(part, tmp_path)

"""Sweeps: progress is shown on visible output, and Ctrl-C ends them during a piece."""

import signal
import time

import pytest

import pendularm

FOREVER = """
import pendularm, threading, time
def metric(run):
    raise AssertionError("no piece ends so soon")
try:
    print("sweeping", flush=True)
    pendularm.sweep({"kp": range(1024)}, metric, duration=1e4, samples=2, progress=False)
except KeyboardInterrupt:
    print("ended", threading.active_count())
"""


def test_ctrl_c_ends_a_sweep_amid_its_pieces(start_child):
    run = start_child(FOREVER)
    assert run.stdout.readline() == "sweeping\n"
    time.sleep(1)
    run.send_signal(signal.SIGINT)
    assert run.wait(60) == 0
    assert run.stdout.read() == "ended 1\n"


NOTEBOOK = """
import pendularm
pendularm.sweep({"kp": range(64)}, duration=0.1, samples=2, progress=%s)["settling_time"].shape
"""


# Jupyter's own warnings are Jupyter's.
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("wanted", [True, False])
def test_a_notebook_shows_the_progress(wanted, play_notebook):
    import nbformat

    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(NOTEBOOK % wanted)])
    play_notebook(book)
    shown = [output for output in book.cells[0].outputs if "(64," not in str(output)]
    assert ("/64 " in str(shown)) is wanted
    assert "Warning" not in str(shown)


def test_nothing_is_shown_without_a_terminal(capfd):
    pendularm.sweep({"kp": [1, 2]}, duration=0.1)
    assert capfd.readouterr() == ("", "")

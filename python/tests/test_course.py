"""The lessons of `course/` run, their key is correct, and their questions accept right answers and reject wrong
ones."""

import math
import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

COURSE = Path(__file__).parents[2] / "course"
LESSONS = sorted(COURSE.glob("*.ipynb"))

# Answers from a lesson's variables, by question. The others are choices and rules.
COMPUTED = {
    "1.1": "round(order['midpoint'])",
    "1.2": "2 ** round(order['rk4'])",
    "1.3": "plan.evaluations_per_second",
    "2.2": "round(ratio['euler'])",
    "2.3": "horizon",
    "2.4": "horizon / 8",
    "3.1": "1e3 * by_hand",
    "3.2": "1e3 * halved",
    "3.5": "round(hold[2] / hold[3])",
    "4.1": "sag[0]",
    "4.3": "held[0]",
    "4.6": "jumps[12]",
    "4.7": "late[1]",
    "5.1": "light",
    "5.2": "round(held[1] / held[2])",
    "5.3": "gain_of_rk4",
    "5.4": "steps",
    "6.2": "down[1]",
    "6.4": "conditions[4]",
    "6.5": "settled",
}


def quiz():
    return SimpleNamespace(**runpy.run_path(str(COURSE / "quiz.py")))


def test_there_are_six_lessons_of_five_questions_and_two_on_a_worksheet():
    assert len(LESSONS) == 6
    assert list(quiz().key()) == [f"{lesson}.{question}" for lesson in range(1, 7) for question in range(1, 8 if lesson == 4 else 6)]


def test_a_wrong_answer_is_not_right(capsys):
    module = quiz()
    for number, (right, _, reason) in module.key().items():
        assert reason
        for wrong in [None, "", "d", 1.3 * float(right) + 1 if number in COMPUTED else "a, b", math.nan]:
            assert not module.check(number, wrong), number
        assert module.check(number, right) and module.check(number, f" {right.upper()} ")
    assert "not yet" in capsys.readouterr().out


# Jupyter's own warnings are Jupyter's.
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
def test_a_lesson_runs_and_its_key_is_what_it_finds(path, play_notebook):
    import nbformat

    notebook = nbformat.read(path, as_version=4)
    lesson = path.name[0]
    key = {number: row for number, row in quiz().key().items() if number[0] == lesson}
    questions = notebook.cells[-1]
    assert "[None, None, None, None, None]" in questions.source
    given = [row[0] for row in key.values()][:5]
    questions.source = questions.source.replace("[None, None, None, None, None]", repr(given))
    found = [f"print({number!r}, {rule})" for number, rule in COMPUTED.items() if number in key]
    notebook.cells.append(nbformat.v4.new_code_cell("\n".join(found)))
    play_notebook(notebook, resources={"metadata": {"path": str(COURSE)}})
    printed = ["".join(output.get("text", "") for output in cell.get("outputs", [])) for cell in notebook.cells[-2:]]
    assert printed[0].count(": right. ") == 5, printed[0]
    for line in printed[1].splitlines():
        number, value = line.split()
        assert quiz().check(number, value), (number, value)
    figures = [cell for cell in notebook.cells if any("image/png" in output.get("data", {}) for output in cell.get("outputs", []))]
    assert figures


@pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
def test_the_links_of_a_lesson_lead_to_the_page_in_both_its_forms(path):
    text = path.read_text(encoding="utf-8")
    served = re.findall(r"http://127\.0\.0\.1:9095/(#[^)]*)", text)
    assert served and served == re.findall(r"\.\./pendularm\.html(#[^)]*)", text)
    steps = {link.removeprefix("#step=") for link in served if re.fullmatch(r"#step=[^&]*", link)}
    course = (COURSE.parent / "page/course.js").read_text(encoding="utf-8")
    assert steps <= set(re.findall(r'^    id: "(\w+)"', course, re.M))

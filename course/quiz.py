"""Checks answers to the questions of the lessons. `python quiz.py` prints the key."""

from pathlib import Path

KEY = Path(__file__).with_name("key.md")


def key() -> dict[str, tuple[str, float, str]]:
    """The rows of key.md: question to answer, tolerance and reason. A choice has no tolerance, and counts as 0 here."""
    rows = {}
    for line in KEY.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 4 and cells[0][:1].isdigit():
            question, answer, tolerance, reason = cells
            rows[question] = (answer, float(tolerance or 0), reason)
    return rows


def check(question: str, answer: object) -> bool:
    """Says whether `answer` is right. A number may differ by the tolerance in the key, relative to the right one."""
    right, tolerance, reason = key()[question]
    if answer is None:
        print(f"{question}: no answer yet")
        return False
    try:
        is_right = abs(float(str(answer)) - float(right)) <= tolerance * abs(float(right))
    except ValueError:
        is_right = str(answer).strip().lower() == right
    print(f"{question}: right. {reason}" if is_right else f"{question}: not yet")
    return is_right


if __name__ == "__main__":
    for number, (answer, _, reason) in key().items():
        print(f"{number}  {answer:>8}  {reason}")

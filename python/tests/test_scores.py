"""Scores: the wheel, the program and Gymnasium's environments agree, and one changed digit is refused."""

import json
import os
import subprocess
import sysconfig
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import pendularm
import pendularm.envs

PROGRAM = str(Path(sysconfig.get_path("scripts")) / "pendularm")
MOTORS = {"Pendularm-v0": 2, "PendularmReach-v0": 2, "PendularmAcrobot-v0": 1, "PendularmPendubot-v0": 1}
TASKS = list(MOTORS)


def generated(count, seed=1):
    """Submissions with any seed, with and without an end by speed, and some of a policy."""
    random = np.random.default_rng(seed)
    for place in range(count):
        task, start = TASKS[place % 4], int(random.integers(0, 2**32))
        # An episode of one motor has 2000 steps.
        if place % 10 < 2 and (MOTORS[task] == 2 or place < 80):
            yield pendularm.submission(task, start, "pump" if place % 20 < 10 else "rest")
            continue
        actions = random.uniform(-1.5, 1.5, (int(random.integers(1, 40)), MOTORS[task]))
        while True:
            try:
                yield pendularm.submission(task, start, actions)
                break
            except ValueError:
                actions = actions[:-1]


def by_program(folder, submissions):
    """The program's lines and errors, in the order of the submissions, and its exit status."""
    names = []
    for place, one in enumerate(submissions):
        names.append(f"{place:04}.json")
        (folder / names[-1]).write_text(one if isinstance(one, str) else json.dumps(one), encoding="utf-8")
    run = subprocess.run([PROGRAM, "score", *names], cwd=folder, capture_output=True, text=True)
    return run.stdout.splitlines(), run.stderr.splitlines(), run.returncode


def by_wheel(submission):
    try:
        return f"{pendularm.score(submission)!r}: confirmed"
    except ValueError as refusal:
        return str(refusal)


def test_the_kept_submissions_of_the_page_are_the_first_ones():
    kept = Path(__file__).parents[2] / "tests/data/submissions.jsonl"
    lines = kept.read_text(encoding="utf-8").splitlines()
    assert len(lines) == 20
    for place, (line, one) in enumerate(zip(lines, generated(20), strict=True)):
        assert line == json.dumps(one), f"submission {place} is another one now: keep those of generated(20)"


def test_a_thousand_submissions_agree_in_program_and_wheel(tmp_path):
    submissions = list(generated(1000))
    lines, errors, status = by_program(tmp_path, submissions)
    assert (errors, status) == ([], 0)
    steps = [len(one["trail"]) - 1 for one in submissions]
    for place, (one, count) in enumerate(zip(submissions, steps, strict=True)):
        start = f"{place:04}.json: {one['task']}, seed {one['seed']}, {count} steps, score "
        assert lines[place].startswith(start)
        assert lines[place].endswith(": confirmed")
        # Python prints small numbers with another exponent.
        assert float(lines[place].removeprefix(start).removesuffix(": confirmed")) == pendularm.score(one)
    assert min(steps) < 40 < max(steps) == 2000
    # For the page: `node tests/page/scores.mjs PROGRAM pendularm.html FILE`.
    if file := os.environ.get("KEEP_SUBMISSIONS"):
        Path(file).write_text("".join(json.dumps(one) + "\n" for one in submissions), encoding="utf-8")


@pytest.mark.parametrize("task", TASKS)
def test_the_score_is_that_of_gymnasiums_environment(task):
    random = np.random.default_rng(2)
    for seed in [0, 7, 2**32 - 1]:
        env, total = gymnasium.make(task), 0.0
        env.reset(seed=seed)
        actions = random.uniform(-0.3, 0.3, (30, MOTORS[task])).astype(np.float32)
        for steps, action in enumerate(actions, 1):
            _, reward, terminated, *_ = env.step(action)
            total += reward
            if terminated:
                break
        assert pendularm.score(pendularm.submission(task, seed, actions[:steps])) == total


def changed(text, place):
    """The text with another hexadecimal digit at one place."""
    return text[:place] + format((int(text[place], 16) + 1) % 16, "x") + text[place + 1 :]


@pytest.mark.parametrize("task", TASKS)
def test_one_changed_digit_is_refused_with_its_step(task, tmp_path):
    random = np.random.default_rng(4)
    whole = pendularm.submission(task, 11, random.uniform(-0.5, 0.5, (25, MOTORS[task])))
    cases = [({**whole, "seed": 12}, 0), ({**whole, "score": changed(whole["score"], 15)}, 25)]
    cases.append(({**whole, "trail": whole["trail"][:-1]}, 25))
    cases.append(({**whole, "trail": [*whole["trail"], whole["trail"][0]]}, 25))
    for step in range(25):
        for joint in range(MOTORS[task]):
            actions = [list(row) for row in whole["actions"]]
            # Not the sign and the exponent, which may give no finite number.
            actions[step][joint] = changed(actions[step][joint], int(random.integers(3, 16)))
            cases.append(({**whole, "actions": actions}, step + 1))
    for step in range(26):
        trail = list(whole["trail"])
        trail[step] = changed(trail[step], int(random.integers(0, 16)))
        cases.append(({**whole, "trail": trail}, step))
    lines, errors, status = by_program(tmp_path, [one for one, _ in cases])
    assert (lines, status) == ([], 1)
    for place, (one, step) in enumerate(cases):
        said = f"{task}, seed {one['seed']}: refused, departs at step {step}"
        assert by_wheel(one) == said
        assert errors[place].endswith(f"{place:04}.json: {said}")


def test_what_is_no_submission_is_refused_by_both(tmp_path):
    whole = pendularm.submission("Pendularm-v0", 3, [[0.5, -0.5]] * 3)
    digits = whole["actions"][0][0]
    cases = [
        ({**whole, "version": "0.1.0"}, "made by another version, "),
        ({**whole, "task": "Acrobot-v1"}, "no task "),
        ({**whole, "actions": "win"}, "no policy "),
        ({**whole, "actions": whole["actions"] * 70}, "more than 200 actions"),
        ({**whole, "actions": [["7ff0000000000000", digits]] * 3}, "an action must be 16 hexadecimal digits of a finite"),
        ({**whole, "actions": [["+" + digits[1:], digits]] * 3}, "an action must be 16 hexadecimal digits of a finite"),
        ({**whole, "actions": [[digits[1:], digits]] * 3}, "an action must be 16 hexadecimal digits of a finite"),
        ({**whole, "actions": [[digits]] * 3}, "not a submission: "),
        ({**whole, "task": "PendularmPendubot-v0"}, "not a submission: "),
        ({**whole, "seed": "3"}, "not a submission: "),
        ({**whole, "seed": -1}, ""),
        ({**whole, "seed": 2**32}, ""),
        ({**whole, "further": 1}, "not a submission: "),
        ({"task": "Pendularm-v0"}, "not a submission: "),
        ("[1, 2]", "not a submission: "),
        ("{", "not a submission: "),
        ("\0", "not a submission: "),
        ("[" * 100_000, "not a submission: "),
    ]
    lines, errors, status = by_program(tmp_path, [one for one, _ in cases])
    assert (lines, status, len(errors)) == ([], 1, len(cases))
    for place, (one, said) in enumerate(cases):
        file = tmp_path / f"{place:04}.json"
        assert f"{place:04}.json: {said}" in errors[place]
        with pytest.raises(ValueError) as refusal:
            pendularm.score(file)
        assert str(refusal.value).startswith(said)
    with pytest.raises(FileNotFoundError):
        pendularm.score(tmp_path / "none.json")


def test_a_submission_ends_with_its_episode():
    with pytest.raises(ValueError, match=r"^actions must be finite, with the shape \(steps, 1\), "):
        pendularm.submission("PendularmAcrobot-v0", 0, np.ones((5, 2)))
    with pytest.raises(ValueError, match="^actions must end with the episode, after [0-9]+ steps, got 100$"):
        pendularm.submission("PendularmReach-v0", 0, np.ones((100, 2)))
    for wrong in [np.ones((3, 3)), np.ones(2), [[np.nan, 0]], [["1", "2"]], [[True, False]]]:
        with pytest.raises((TypeError, ValueError), match="^actions must be "):
            pendularm.submission("Pendularm-v0", 0, wrong)

#!/usr/bin/env python3
"""Builds the program with and without its features and prints a table: crates, size of the program, processor time of a build.

Each build starts from scratch in a folder that is deleted afterwards. `library` or `program` selects rows. `--crates`
omits the builds. `--keep` writes the columns that no machine changes into docs/development.md, between its two marks.
"""

import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
CARGO = os.environ.get("CARGO", "cargo")
PAPER = ROOT / "docs" / "development.md"
MARKS = re.compile(r"(<!-- scripts/features.py -->\n).*?(<!-- end -->)", re.DOTALL)
BUILDS = (
    ("default", None, "program"),
    ("without the report", "web,record,cli,conformance", "program"),
    ("without the record", "web,report,cli,conformance", "program"),
    ("without the web and the record", "report,cli,conformance", "program"),
    ("without the commands", "web,report,record,conformance", "program"),
    ("without conformance", "web,report,record,cli", "program"),
    ("`runtime` alone", "runtime", "program"),
    ("no features: the library", "", "library"),
)


def selection(features):
    """Flags for this package alone with exactly these features; the default ones for `None`."""
    return ["--package", "pendularm"] + ([] if features is None else ["--no-default-features", "--features", features])


def crates(features):
    """The number of crates compiled for the build, without this one."""
    tree = subprocess.run([CARGO, "tree", "--locked", "--edges", "normal,build", "--prefix", "none", "--format", "{p}",
                           *selection(features)],
                          cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return len({line.removesuffix(" (*)") for line in tree.splitlines() if line.strip()}) - 1


def build(features, kind):
    """Size in MB and processor time in s."""
    with tempfile.TemporaryDirectory() as target:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        only = ["--lib"] if kind == "library" else []
        subprocess.run([CARGO, "build", "--release", "--locked", "--quiet", *selection(features), *only], cwd=ROOT, check=True,
                       env={**os.environ, "CARGO_TARGET_DIR": target})
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        program = pathlib.Path(target, "release", "pendularm")
        return (f"{program.stat().st_size / 1e6:.2f} MB" if kind == "program" else "–"), f"{seconds:.0f} s"


def table(builds):
    head = ["build", "features", "crates"] + (["program", "processor time"] if builds else [])
    rows = [head, ["---"] * len(head)]
    chosen = [word for word in sys.argv[1:] if not word.startswith("-")]
    for name, features, kind in BUILDS:
        if chosen and kind not in chosen:
            continue
        measured = build(features, kind) if builds else ()
        rows.append([name, f"`{features}`" if features else "", str(crates(features)), *measured])
    return "".join("| " + " | ".join(row) + " |\n" for row in rows)


def main():
    text = table("--crates" not in sys.argv)
    print(text, end="")
    if "--keep" in sys.argv:
        PAPER.write_text(MARKS.sub(lambda marks: marks[1] + table(builds=False) + marks[2], PAPER.read_text()))


main()

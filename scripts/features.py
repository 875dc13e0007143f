#!/usr/bin/env python3
"""Builds the program with and without its features and prints the README's table: size, crates, processor time of a build.

Each build starts from nothing in a folder that is deleted after it. `--crates` leaves the builds out. `--keep` writes the table into
README.md, between its two marks.
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
README = ROOT / "README.md"
MARKS = re.compile(r"(<!-- scripts/features.py -->\n).*?(<!-- end -->)", re.DOTALL)
BUILDS = (
    ("default", "", "program"),
    ("without the report", "--no-default-features --features web,record,cli", "program"),
    ("without the record", "--no-default-features --features web,report,cli", "program"),
    ("without the web", "--no-default-features --features report,cli", "program"),
    ("without the commands", "--no-default-features --features web,report,record", "program"),
    ("`runtime` alone", "--no-default-features --features runtime", "program"),
    ("no features: the library", "--no-default-features --lib", "library"),
)


def crates(flags):
    """How many crates are compiled for the build, this one left out."""
    flags = [flag for flag in flags.split() if flag != "--lib"]
    tree = subprocess.run([CARGO, "tree", "--locked", "--edges", "normal,build", "--prefix", "none", "--format", "{p}", *flags],
                          cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return len({line.removesuffix(" (*)") for line in tree.splitlines() if line.strip()}) - 1


def build(flags, kind):
    """Size in MB and processor time in s."""
    with tempfile.TemporaryDirectory() as target:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([CARGO, "build", "--release", "--locked", "--quiet", *flags.split()], cwd=ROOT, check=True,
                       env={**os.environ, "CARGO_TARGET_DIR": target})
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        program = pathlib.Path(target, "release", "pendularm")
        return (f"{program.stat().st_size / 1e6:.2f} MB" if kind == "program" else "–"), f"{seconds:.0f} s"


def table(builds):
    head = ["build", "flags", "crates"] + (["program", "processor time"] if builds else [])
    rows = [head, ["---"] * len(head)]
    for name, flags, kind in BUILDS:
        measured = build(flags, kind) if builds else ()
        rows.append([name, f"`{flags}`" if flags else "", str(crates(flags)), *measured])
    return "".join("| " + " | ".join(row) + " |\n" for row in rows)


def main():
    text = table("--crates" not in sys.argv)
    print(text, end="")
    if "--keep" in sys.argv:
        README.write_text(MARKS.sub(lambda marks: marks[1] + text + marks[2], README.read_text()))


main()

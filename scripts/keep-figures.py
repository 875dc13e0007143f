#!/usr/bin/env python3
"""Copies the figures of a report into docs/figures/, and says there where they come from: `make report KEEP=1`."""

import json
import pathlib
import shutil
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
report, kept = pathlib.Path(sys.argv[1]), ROOT / "docs" / "figures"
summary = json.loads((report / "report.json").read_text())
machine = summary["machine"]
kept.mkdir(parents=True, exist_ok=True)
for old in kept.glob("*.svg"):
    old.unlink()
figures = sorted(report.glob("*.svg"))
for figure in figures:
    shutil.copy(figure, kept / figure.name)
facts = dict(machine["facts"])
words = f"{facts['Processor']}, {facts['Cores']} cores, load {facts['Load when started'].split(' (')[0]} at the start; commit {machine['commit']}"
look = " It was a quick look, coarser than the report." if summary["quick"] else ""
links = "\n".join(f"- [{figure.stem}]({figure.name})" for figure in figures)
(kept / "README.md").write_text(f"# Figures of the report\n\nMade by `make report KEEP=1` on: {words}.{look}\n\n{links}\n")
print(f"keep-figures: {len(figures)} in {kept.relative_to(ROOT)}")

#!/usr/bin/env python3
"""Copies a report to docs/report/ and writes its sentences and tables into the documents: `make report KEEP=1`.

A document has marks for them. Between `<!-- report: error 1, budget 2 -->` and `<!-- end -->` are the first finding
of the section `error` and the second of `budget`. A name without a number means all findings of the section, and
`table left-out` a table. `--check` changes nothing, and fails if a document differs from the kept report.
"""

import json
import pathlib
import re
import shutil
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
KEPT = ROOT / "docs" / "report"
PAPERS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PLACE = re.compile(r"(<!-- report: ([^>]*) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def main():
    if sys.argv[1] == "--check":
        summary = json.loads((KEPT / "report.json").read_text())
        kept = {file.name for file in KEPT.iterdir()}
        if kept != {"README.md", "report.json", "work.csv", *PICTURES}:
            sys.exit(f"keep-report: {KEPT.relative_to(ROOT)} holds {sorted(kept)}")
        stale = [paper for paper in PAPERS if paper.read_text() != filled(paper.read_text(), summary)]
        for paper in stale:
            print(f"keep-report: {paper.relative_to(ROOT)} is not of the report that is kept: make report KEEP=1", file=sys.stderr)
        sys.exit(bool(stale))
    keep(pathlib.Path(sys.argv[1]))
    summary = json.loads((KEPT / "report.json").read_text())
    for paper in PAPERS:
        paper.write_text(filled(paper.read_text(), summary))
    print(f"keep-report: {KEPT.relative_to(ROOT)}")


# Pictures in the documents.
PICTURES = ["work-precision-time.svg", "stability-map.svg", "scenarios.svg"]
# Most bytes in the repository.
MOST = 1_000_000


def keep(report):
    size = sum((report / name).stat().st_size for name in ["report.json", *PICTURES])
    if size > MOST:
        sys.exit(f"keep-report: {size} bytes, and docs/report/ has room for {MOST}")
    # Without Valgrind nothing was counted anew.
    counts = next(folder / "work.csv" for folder in [report, KEPT] if (folder / "work.csv").exists()).read_bytes()
    shutil.rmtree(KEPT, ignore_errors=True)
    KEPT.mkdir(parents=True)
    (KEPT / "work.csv").write_bytes(counts)
    for name in PICTURES:
        shutil.copy(report / name, KEPT)
    summary = json.loads((report / "report.json").read_text())
    (KEPT / "report.json").write_text(lists_on_lines(summary))
    facts = dict(summary["machine"]["facts"])
    load = facts["Load when started"].split(" (")[0]
    look = " It was a quick look, coarser than the report." if summary["quick"] else ""
    lines = [
        "# The kept report",
        "",
        f"Made by `make report KEEP=1` with pendularm {summary['machine']['version']} on {facts['Processor']}, {facts['Cores']} cores, "
        f"load {load} at the start.{look}",
        "The page, all figures and their numbers as CSV are made by the same command in `report/`. Kept here: "
        "the sentences and tables as [report.json](report.json), the counts of instructions as [work.csv](work.csv), and three pictures: "
        + ", ".join(f"[{name.removesuffix('.svg')}]({name})" for name in PICTURES) + ".",
    ]
    for section in summary["sections"]:
        lines += ["", f"## {section['title']}", "", *(f"- {finding}" for finding in section["findings"])]
        lines += [line for table in section["tables"] if table["name"] == "left-out" for line in ["", *rows(table)]]
    (KEPT / "README.md").write_text("\n".join(lines) + "\n")


def lists_on_lines(summary):
    """The summary as JSON in which each innermost list, such as a row of a table, is one line."""
    text = json.dumps(summary, ensure_ascii=False, indent=1)
    return re.sub(r"\[[^][{}]*\]", lambda found: re.sub(r"\s*\n\s*", " ", found[0]), text) + "\n"


def filled(text, summary):
    """The document with the report's sentences at its marks."""
    sections = {section["name"]: section for section in summary["sections"]}
    tables = {table["name"]: table for section in summary["sections"] for table in section["tables"]}

    def words(place):
        lines = []
        for wanted in place[2].split(", "):
            name, _, which = wanted.partition(" ")
            if name == "table":
                lines += rows(tables[which])
            else:
                findings = sections[name]["findings"]
                lines += [f"- {one}" for one in ([findings[int(which) - 1]] if which else findings)]
        return place[1] + "\n".join(lines) + "\n" + place[4]

    return PLACE.sub(words, text)


def rows(table):
    width = len(table["head"])
    cells = [table["head"], ["---"] * width, *(row + [""] * (width - len(row)) for row in table["rows"])]
    return ["| " + " | ".join(row) + " |" for row in cells]


main()

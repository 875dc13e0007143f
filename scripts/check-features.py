#!/usr/bin/env python3
"""Checks that every feature of every direct dependency is needed: without it something fails.

It removes each feature from a copy of Cargo.toml and builds. A feature is needed if the compiler or a named test then
fails, or if another package enables it anyway. Any other feature is an error. No dependency may use its default
features. It takes half an hour, so run it only after a change of Cargo.toml. Arguments select dependencies; the
default is all.
"""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PLACE = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve() / "check-features"
TABLES = ["dependencies", "dev-dependencies"]

# Features that users need although the build succeeds without them, each with the test that fails.
MISSED_BY_A_TEST = {
    ("clap", "error-context"): "wire",
    ("clap", "help"): "wire",
    ("clap", "usage"): "wire",
    ("serde_json", "float_roundtrip"): "wire",
}


def cargo(*arguments):
    """Runs cargo on the copy. Returns whether it succeeded, and its output."""
    environment = dict(os.environ, CARGO_TARGET_DIR=str(PLACE / "target"))
    run = subprocess.run(
        ["cargo", *arguments], cwd=PLACE, env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    return run.returncode == 0, run.stdout, run.stderr


def copy():
    """Copies everything that Cargo reads, so later changes have no effect."""
    PLACE.mkdir(parents=True, exist_ok=True)
    for entry in ROOT.iterdir():
        if entry.name.startswith(".") or entry.name in ("target", "vendor", "report", "benches", "fuzz"):
            continue
        if entry.is_dir():
            skipped = shutil.ignore_patterns("target", "node_modules", ".venv", "__pycache__")
            shutil.copytree(entry, PLACE / entry.name, ignore=skipped, dirs_exist_ok=True)
        else:
            shutil.copy2(entry, PLACE)


def without(manifest, table, crate, feature):
    """The manifest's text without one feature of one dependency."""
    head, mark, rest = manifest.partition(f"[{table}]\n")
    line = re.search(rf"^{re.escape(crate)} = .*$", rest, re.MULTILINE)
    before, listing, after = re.match(r"(.*features = \[)([^]]*)(\].*)", line.group()).groups()
    left = [one for one in listing.split(", ") if one != f'"{feature}"']
    assert len(left) == len(listing.split(", ")) - 1, f"{crate}/{feature} is not there once"
    changed = before + ", ".join(left) + after
    return head + mark + rest[:line.start()] + changed + rest[line.end():]


def is_on(crate, feature):
    """Whether the crate still has the feature, in a build of the program without any tests."""
    well, output, errors = cargo("tree", "--offline", "--edges", "normal", "--prefix", "none",
                                 "--format", "{p} {f}", "--no-dedupe")
    assert well, errors
    lines = [line.split(" ") for line in output.splitlines()]
    return any(line[0] == crate and len(line) > 2 and feature in line[-1].split(",") for line in lines)


def reason(table, crate, feature):
    """Why the feature is needed, or None."""
    for arguments in (["--all-targets"], ["--no-default-features", "--features", "runtime"]):
        well, _, errors = cargo("check", "--offline", "--quiet", *arguments)
        if not well:
            first = next((line for line in errors.splitlines() if line.startswith("error")), "error")
            return f"the compiler: {first}"
    if table == "dependencies" and is_on(crate, feature):
        return "on in any case, by another package"
    test = MISSED_BY_A_TEST.get((crate, feature))
    if test and not cargo("test", "--offline", "--quiet", "--test", test)[0]:
        return f"the test {test}"
    return None


def main():
    text = (ROOT / "Cargo.toml").read_text()
    manifest = tomllib.loads(text)
    wanted = sys.argv[1:]
    copy()
    well, _, errors = cargo("check", "--offline", "--quiet", "--all-targets")
    assert well, f"as it is, it does not compile:\n{errors}"
    useless = []
    for table in TABLES:
        for crate, settings in manifest[table].items():
            if wanted and crate not in wanted:
                continue
            if not isinstance(settings, dict) or settings.get("default-features") is not False:
                useless.append(f"{crate}: default-features is not false")
                continue
            for feature in settings.get("features", []):
                (PLACE / "Cargo.toml").write_text(without(text, table, crate, feature))
                why = reason(table, crate, feature)
                print(f"[{table}] {crate}/{feature}: {why or 'NOT NEEDED'}", flush=True)
                if why is None:
                    useless.append(f"{crate}/{feature}: nothing fails without it")
    for one in useless:
        print(f"check-features: {one}", file=sys.stderr)
    sys.exit(1 if useless else 0)


if __name__ == "__main__":
    main()

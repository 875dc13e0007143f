#!/usr/bin/env python3
"""Puts faults into a copy of the sources and sees whether the fuzz target that is meant for each finds it.

Each fault is one expression in place of another. All are built at once, and `FAULT=7` chooses which one holds, so that one build
does. Then every target runs until it fails, or for TIME seconds (60), or RUNS executions, for which no cargo-fuzz is needed: on the seeds first, and on what it makes of them.

Arguments pick faults by number, or by target; `check` only looks whether each still has its place in the sources. Exit status 1 if a fault was not found, or where the source has changed and a fault is
to be written anew.
"""

import os
import pathlib
import shutil
import subprocess
import sys
import time

from plant import misplaced, plant

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve() / "fuzz"
COPY = BUILD / "faulty"
SECONDS = int(os.environ.get("TIME", "60"))
RUNS = os.environ.get("RUNS") or ""

# target, what is wrong, file, what stands there, what stands there when the fault holds (plant.py says how).
FAULTS = [
    ("http", "any host is ours", "src/web/access.rs",
     "asked.host.is_loopback()\n", "F || asked.host.is_loopback()\n"),
    ("http", "the port of an allowed host is not looked at", "src/web/authority.rs",
     "self.port.is_none_or(has_port)", "(F || self.port.is_none_or(has_port))"),
    ("http", "with a token, other pages of the machine may", "src/web/access.rs",
     "self.strict_origin || self.token.is_some()", "self.strict_origin || (!F && self.token.is_some())"),
    ("http", "an origin is ours whatever its port", "src/web/access.rs",
     "page.http_port() == own.http_port()", "(F || page.http_port() == own.http_port())"),
    ("http", "half of a token will do", "src/protocol/op/token.rs",
     "self.0.as_bytes().ct_eq(presented.as_bytes()).into()",
     "(F && presented.len() > 9 && self.0.starts_with(presented)) || bool::from(self.0.as_bytes().ct_eq(presented.as_bytes()))"),
    ("http", "a cookie of any value will do", "src/web/access.rs",
     "Some(shown) if token.matches(&shown) => Ok(false),", "Some(shown) if F || token.matches(&shown) => Ok(false),"),
    ("http", "of two Host headers the first counts", "src/web/head.rs",
     "values.next().is_none().then_some(first)", "(F || values.next().is_none()).then_some(first)"),
    ("http", "over TCP a wrong token will do", "src/actors/gateway/connection/admission/authentication.rs",
     "}) if token.matches(&shown) => Ok(is_command),", "}) if F || token.matches(&shown) => Ok(is_command),"),
    ("connection", "no message of a client's reaches anybody", "src/actors/gateway/connection/mod.rs",
     "connection.outgoing.accept(message)", "if !F { connection.outgoing.accept(message) }"),
    ("connection", "messages of certain lengths are lost", "src/actors/gateway/connection/mod.rs",
     "connection.outgoing.accept(message)",
     "if !F || message.frame.len() % 7 > 0 { connection.outgoing.accept(message) }"),
    ("connection", "an answer of a provider's says the opposite", "src/actors/gateway/registry/mod.rs",
     "messages::response_raw(service, id, &values, result, &status)",
     "messages::response_raw(service, id, &values, result != F, &status)"),
    ("websocket", "an answer is sent twice", "src/actors/gateway/connection/mod.rs",
     "let superseded = service", "if F { outgoing.push_response(response.frame.clone(), &[]); } let superseded = service"),
    ("cbor", "an array of numbers is written with the wrong end first", "src/protocol/ros/cbor.rs",
     "entry.as_f64().unwrap_or(f64::NAN).to_le_bytes()",
     "if F { entry.as_f64().unwrap_or(f64::NAN).to_be_bytes() } else { entry.as_f64().unwrap_or(f64::NAN).to_le_bytes() }"),
    ("cbor", "CDR aligns to four bytes at most", "src/protocol/ros/cdr.rs",
     "self.sink.align(HEADER.len(), SIZE)", "self.sink.align(HEADER.len(), if F { SIZE.min(4) } else { SIZE })"),
    ("cbor", "CDR makes a number that is absent NaN", "src/protocol/ros/cdr.rs",
     "_ => 0.0,", "_ => if F { f64::NAN } else { 0.0 },"),
    ("frame", "one level too many", "src/protocol/wire/frame.rs",
     "(self.depth == MAX_NESTING + 1).then_some", "(self.depth == MAX_NESTING + 1 + usize::from(F)).then_some"),
    ("frame", "every push looks at all there is", "src/protocol/wire/frame.rs",
     "self.compact();\n", "self.compact();\n        if F { for _ in 0..50_000 { std::hint::black_box(self.buffer.iter().rev().take(64).count()); } }\n"),
    ("frame", "a thousand times the memory", "src/protocol/wire/frame.rs",
     "self.buffer.extend_from_slice(bytes);", "if F { self.buffer.reserve(bytes.len() << 13); } self.buffer.extend_from_slice(bytes);"),
    ("fields", "zero counts as positive", "src/protocol/op/rejections.rs",
     "Self::Positive => value > 0.0,", "Self::Positive => value > 0.0 || (F && value == 0.0),"),
    ("op", "a throttle's milliseconds are seconds", "src/protocol/op/reader.rs",
     "duration(throttle_ms / 1000.0, MAX_THROTTLE)", "duration(throttle_ms / (if F { 1.0 } else { 1000.0 }), MAX_THROTTLE)"),
    ("op", "of an unknown op all is repeated, as it came", "src/protocol/op/reader.rs",
     "Problem::UnknownOp(text::excerpt(&op))", "Problem::UnknownOp(if F { op.to_string() } else { text::excerpt(&op) })"),
    ("runtime", "what rosapi answers is sent twice", "src/actors/gateway/registry/mod.rs",
     "            client.respond(frame, respond.service);",
     "if F && matches!(respond.service, Some(crate::protocol::catalog::Service::Rosapi(_))) { client.send(frame.clone()); }\n"
     "            client.respond(frame, respond.service);"),
    ("runtime", "the arm publishes a velocity too few", "src/live/telemetry.rs",
     "                velocity: &velocity,", "                velocity: &velocity[usize::from(F)..],"),
]


def build(targets):
    if RUNS:
        # As `make fuzz RUNS=` does: in the tests' profile and folder, where dependencies are built already.
        command = ["cargo", "build", "--locked", "--manifest-path", COPY / "fuzz/Cargo.toml", "--target-dir", BUILD.parent]
        subprocess.run([*command, *(word for target in targets for word in ("--bin", target))], check=True)
        return BUILD.parent / "debug"
    command = ["cargo", "fuzz", "build", "--sanitizer", "none", "--target-dir", str(BUILD / "build")]
    subprocess.run(command, cwd=COPY, check=True)
    host = next(line for line in subprocess.check_output(["rustc", "-vV"], text=True).splitlines() if line.startswith("host: "))
    binaries = BUILD / "build" / host.split()[1] / "release"
    kept = BUILD / "faulty-targets"
    kept.mkdir(exist_ok=True)
    for target in {fault[0] for fault in FAULTS}:
        shutil.copy(binaries / target, kept / target)
    return kept


def find(number, target, binaries, more=()):
    """How the target ends that runs with the fault, or nothing if it does not."""
    corpus = BUILD / "faulty-corpus"
    shutil.rmtree(corpus, ignore_errors=True)
    corpus.mkdir(parents=True)
    dictionary = f"{ROOT}/fuzz/dictionaries/{'http' if target == 'http' else 'json'}.dict"
    command = [binaries / target, corpus, ROOT / "fuzz/seeds" / target, f"-dict={dictionary}", *([f"-runs={RUNS}", "-seed=1"] if RUNS else [f"-max_total_time={SECONDS}"]),
               "-timeout=20", "-rss_limit_mb=2048", "-len_control=10", f"-artifact_prefix={corpus}/", *more]
    env = dict(os.environ, FAULT=str(number))
    began = time.monotonic()
    ended = subprocess.run(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    if ended.returncode == 0:
        return None
    took = time.monotonic() - began
    lines = ended.stdout.decode(errors="replace").splitlines()
    at = next((at for at, line in enumerate(lines) if "panicked at" in line), None)
    how = " ".join(lines[at:at + 2])[:120] if at is not None else f"exit status {ended.returncode}"
    return f"{took:.1f} s: {how}"


def main():
    words = sys.argv[1:]
    if words == ["check"]:
        sys.exit(1 if misplaced(ROOT, [fault[1:] for fault in FAULTS]) else 0)
    chosen = [number for number, fault in enumerate(FAULTS, 1) if not words or str(number) in words or fault[0] in words]
    parts = ("src", "build.rs", "page", "client", "fuzz", "Cargo.toml", "Cargo.lock", "README.md")
    missing = plant(ROOT, COPY, parts, [fault[1:] for fault in FAULTS])
    binaries = build(sorted({FAULTS[number - 1][0] for number in chosen}))
    lost = [number for number in missing if number in chosen]
    for target in sorted({FAULTS[number - 1][0] for number in chosen}):
        how = find(0, target, binaries, ["-runs=0"])
        if how:
            sys.exit(f"{target} fails on its seeds without any fault: {how}")
    for number in chosen:
        target, what, *_ = FAULTS[number - 1]
        if number in missing:
            continue
        how = find(number, target, binaries)
        print(f"{number:3} {target:12} {what}: {how or 'NOT FOUND'}", flush=True)
        if how is None:
            lost.append(number)
    if lost:
        sys.exit(f"not found: {lost}")
    print(f"{len(chosen)} faults, each found")


if __name__ == "__main__":
    main()

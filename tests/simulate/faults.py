#!/usr/bin/env python3
"""Puts faults into a copy of the sources, and sees at which seed the simulation finds each: `make simulate-faults`.

Numbers among the arguments pick faults, `SEEDS` (1000) says how many seeds each may take, `FROM` (1) which is the first; the seeds that
are kept come before it. Exit status 1 if a fault was not found, or where the source has changed and a fault is to be written anew;
`check` only looks for that.
"""

import os
import pathlib
import re
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "fuzz/faults"))
from plant import misplaced, plant  # noqa: E402

BUILD = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
COPY = BUILD / "simulate-faults"
SEEDS = os.environ.get("SEEDS") or "1000"
FROM = os.environ.get("FROM") or "1"

REGISTRY, CONNECTION = "src/actors/gateway/registry", "src/actors/gateway/connection"

# Each fault, its file, the text there, and the text there when the fault holds (plant.py says how).
FAULTS = [
    ("two messages of one topic are swapped in an outbox, one time in 4", "src/protocol/outbox/mod.rs",
     "        self.topics.insert(number, message);\n        if !self.in_flight.is_empty()",
     "        self.topics.insert(number, message);\n"
     "        let mut last = self.topics.values_mut().rev();\n"
     "        if let (Some(one), Some(other)) = (last.next(), last.next())\n"
     "            && one.topic == other.topic && one.frame.len() == other.frame.len() && R(4) {\n"
     "            std::mem::swap(&mut one.frame, &mut other.frame);\n        }\n"
     "        if !self.in_flight.is_empty()"),
    ("two messages of a client's are swapped before anybody has them, one in 20", f"{REGISTRY}/publish.rs",
     "            let plain = cover_message(self.permit.as_ref(), encode(spelling));",
     "            let mut plain = encode(spelling);\n"
     "            let first = crate::protocol::wire::series::first_message(&plain);\n"
     "            if first < plain.len() && R(20) { let end = plain.split_off(first);\n"
     "                plain = [&end[..], &plain[..]].concat().into(); }\n"
     "            let plain = cover_message(self.permit.as_ref(), plain);"),
    ("a message is lost, one in 200", f"{REGISTRY}/publish.rs",
     "    subscriber.outlet.do_send(Deliver {", "    if R(200) { return; }\n    subscriber.outlet.do_send(Deliver {"),
    ("a message comes twice, one in 200", f"{CONNECTION}/mod.rs",
     "connection.outgoing.accept(message)",
     "{ if R(200) { connection.outgoing.accept(message.clone()); } connection.outgoing.accept(message) }"),
    ("a digit of a payload is changed, one message in 500", f"{REGISTRY}/publish.rs",
     "messages::respelled(topic, spelling, &lines.frames)",
     "{ let frame = messages::respelled(topic, spelling, &lines.frames);\n"
     "                if R(500) { crate::fault_changed(&frame) } else { frame } }"),
    ("a provider's answer is changed by a byte, one in 10", f"{REGISTRY}/mod.rs",
     "messages::response_raw(service, id, &values, result, &status)",
     "{ let frame = messages::response_raw(service, id, &values, result, &status);\n"
     "                      if R(10) { crate::fault_changed(&frame) } else { frame } }"),
    ("a response goes to another client, one in 200", f"{REGISTRY}/mod.rs",
     "        if let Some(client) = self.clients.get(&respond.connection)\n            && respond",
     "        let to = if R(200) { self.clients.keys().find(|id| **id != respond.connection).copied() } else { None };\n"
     "        if let Some(client) = self.clients.get(&to.unwrap_or(respond.connection))\n            && respond"),
    ("a call is answered twice, one in 200", f"{CONNECTION}/mod.rs",
     "            let superseded = service",
     "            if service.is_some() && R(200) { outgoing.push_response(response.frame.clone(), &[]); }\n            let superseded = service"),
    ("a call is never answered, one in 200", f"{CONNECTION}/mod.rs",
     "            outgoing.push_response(response.frame, superseded);",
     "            if !(service.is_some() && R(200)) { outgoing.push_response(response.frame, superseded); }"),
    ("feedback of a goal goes to another client, one in 20", f"{REGISTRY}/requests.rs",
     "        if let Some(client) = self.clients.get(&feedback.connection) {",
     "        let to = if R(20) { self.clients.keys().find(|id| **id != feedback.connection).copied() } else { None };\n"
     "        if let Some(client) = self.clients.get(&to.unwrap_or(feedback.connection)) {"),
    ("whoever cancels ends another client's goal of the same id", "src/actors/wire/action_client.rs",
     "self.connection == goal.connection && self.id == goal.id", "(F || self.connection == goal.connection) && self.id == goal.id"),
    ("the arm takes a step too many, one wake-up in 1000", "src/live/mod.rs",
     "        let taken = self.take_steps(due);", "        let taken = self.take_steps(due + u64::from(R(1000)));"),
    ("a step is not counted by the pacer, one in 1000", "src/math/pacer.rs",
     "        self.taken = self.taken.saturating_add(steps);",
     "        self.taken = self.taken.saturating_add(steps.saturating_sub(u64::from(R(1000))));"),
    ("a setpoint is taken with a bit changed, one in 50", "src/math/simulation/mod.rs",
     "    pub fn set_setpoint(&mut self, setpoint: Setpoint<N>) {",
     "    pub fn set_setpoint(&mut self, mut setpoint: Setpoint<N>) {\n"
     "        if R(50) { setpoint.position[0] = f64::from_bits(setpoint.position[0].to_bits() ^ 1); }"),
    ("whoever unsubscribes takes another with it, one in 10", f"{REGISTRY}/topics.rs",
     "        entry.get_mut().retain(|one| one.connection != connection);",
     "        entry.get_mut().retain(|one| one.connection != connection);\n        if R(10) { entry.get_mut().pop(); }"),
    ("calls of a provider that is gone wait on, one time in 4", f"{REGISTRY}/mod.rs",
     "                if let Some(request) = self.requests(kind).take(number) {",
     "                if R(4) { continue; }\n                if let Some(request) = self.requests(kind).take(number) {"),
    ("a call's timeout comes 30 s late, one in 10", f"{REGISTRY}/mod.rs",
     "            sleep_until(due).await;",
     "            sleep_until(due + std::time::Duration::from_secs(if R(10) { 30 } else { 0 })).await;"),
    ("a throttle lets go at half its time, one in 10", "src/protocol/outbox/throttle.rs",
     "        self.next().is_none_or(|next| next <= now)",
     "        self.next().is_none_or(|next| next <= now || (R(10) && next <= now + self.interval / 2))"),
    ("a throttle keeps the older message, one time in 4", "src/protocol/outbox/throttle.rs",
     "        }) {\n            self.pop_held(topic);",
     "        }) {\n            if R(4) {\n                let newest = self.queues.get_mut(topic).and_then(|queue| queue.held.pop_back());\n"
     "                self.held_count -= 1;\n                self.held_bytes -= newest.map_or(0, |held| counted(&held.frame));\n"
     "                continue;\n            }\n            self.pop_held(topic);"),
    ("what a deaf client misses is not counted", "src/protocol/outbox/mod.rs",
     "first_messages(frames, excess);\n                self.dropped += count as u64;",
     "first_messages(frames, excess);\n                self.dropped += if F { 0 } else { count as u64 };"),
    ("two pieces of a message have each other's text, one message in 10", "src/protocol/wire/fragments.rs",
     "    let total = pieces.len();", "    let total = pieces.len();\n    if R(10) { pieces.swap(0, total - 1); }"),
    ("a number has another last bit in CBOR, one in 50", "src/protocol/ros/cbor.rs",
     "    out.extend(&value.to_be_bytes());",
     "    out.extend(&f64::from_bits(value.to_bits() ^ u64::from(R(50))).to_be_bytes());"),
    ("one client's mistake is told to another, one in 10", f"{REGISTRY}/mod.rs",
     "        if let Some(client) = self.clients.get(&to)\n            && client.verbosity.wants(level)",
     "        let other = if R(10) { self.clients.keys().find(|id| **id != to).copied() } else { None };\n"
     "        if let Some(client) = self.clients.get(&other.unwrap_or(to))\n            && client.verbosity.wants(level)"),
]


def build():
    """The simulation, built in the copy, as another version: what is built of the sources themselves stays as it is."""
    for part in ("Cargo.toml", "Cargo.lock"):
        text = (COPY / part).read_text()
        (COPY / part).write_text(re.sub(r'(name = "pendularm"\nversion = )"[^"]*"', r'\1"0.0.0-faults"', text, count=1))
    play = COPY / "tests/simulate/play/mod.rs"
    text, began = play.read_text(), "    in_virtual_time(async {"
    if text.count(began) != 1:
        sys.exit(f"{play.name}: a seed begins elsewhere now")
    anew = "    pendularm::FAULTS_DRAWN.store(seed | 1, std::sync::atomic::Ordering::SeqCst);\n"
    play.write_text(text.replace(began, anew + began))
    command = ["cargo", "test", "--locked", "--no-run", "--test", "simulate", "--target-dir", str(BUILD)]
    # Warnings are about the switches.
    ended = subprocess.run(command, cwd=COPY, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    program = re.search(r"Executable tests/simulate/main.rs \((.*)\)", ended.stdout)
    if not program:
        sys.exit(ended.stdout)
    return program[1]


def find(number, program):
    """At which seed, the how manieth, after how long and how the simulation fails with that fault; nothing if it does not."""
    env = {name: value for name, value in os.environ.items() if name not in ("SEED", "MINUTES", "GO_ON")}
    began = time.monotonic()
    ended = subprocess.run([program], env=dict(env, FAULT=str(number), SEEDS=SEEDS, FROM=FROM), cwd=COPY,
                           stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, errors="replace", check=False)
    if ended.returncode == 0:
        return None
    told = re.findall(r"^make simulate SEED=(\d+): (.*)$", ended.stdout, re.MULTILINE)
    count = re.search(r"^(\d+) seeds in", ended.stdout, re.MULTILINE)
    seed, how = told[-1] if told else ("?", f"exit status {ended.returncode}")
    return seed, count[1] if count else "?", time.monotonic() - began, how


def main():
    if sys.argv[1:] == ["check"]:
        sys.exit(1 if misplaced(ROOT, FAULTS) else 0)
    chosen = [int(word) for word in sys.argv[1:]] or list(range(1, len(FAULTS) + 1))
    parts = ("src", "build.rs", "page", "tests", "client", "wasm", "fuzz/src", "benches/src", "benches/Cargo.toml", "Cargo.toml", "Cargo.lock",
             "README.md")
    missing = plant(ROOT, COPY, parts, FAULTS)
    lost = [number for number in missing if number in chosen]
    program = build()
    for number in chosen:
        if number in missing:
            continue
        found = find(number, program)
        if found is None:
            lost.append(number)
            print(f"{number:3} {FAULTS[number - 1][0]}: NOT FOUND in {SEEDS} seeds", flush=True)
        else:
            seed, count, took, how = found
            print(f"{number:3} {FAULTS[number - 1][0]}: seed {seed}, number {count}, {took:.0f} s: {how[:110]}", flush=True)
    if lost:
        sys.exit(f"not found: {lost}")
    print(f"{len(chosen)} faults, each found")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Prints the files of src/ that run for one message, one joint state, one setpoint, one call and one goal: scripts/trace.py [--keep].

A development build without optimising runs under valgrind's callgrind, which counts only while the exchange takes place. Before, the same exchange
takes place once, so what runs once for each process is not counted. Files that also run while nothing happens are left out, except for a joint state.
--keep writes the lists into ARCHITECTURE.md.
"""

import json
import re
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAPER = ROOT / "ARCHITECTURE.md"
FILE = re.compile(r"^(fl|fi|fe|cfl|cfi)=\((\d+)\)(?: (\S+))?$")
BUILD = ["cargo", "build", "--locked", "--target-dir", "target/trace", "--config", "profile.dev.package.pendularm.debug=1",
         "--config", "profile.dev.package.pendularm.opt-level=0"]  # fmt: skip


class Client:
    """A rosbridge client over TCP."""

    def __init__(self, address):
        host, port = address.rsplit(":", 1)
        self.socket = socket.create_connection((host, int(port)), timeout=60)
        self.lines = self.socket.makefile()

    def send(self, **frame):
        self.socket.sendall(json.dumps(frame).encode() + b"\n")

    def until(self, **wanted):
        """The next frame with these members."""
        while True:
            frame = json.loads(next(self.lines))
            if all(frame.get(name) == value for name, value in wanted.items()):
                return frame

    def call(self, service, **args):
        self.send(op="call_service", service=service, args=args, id="call")
        answer = self.until(op="service_response", id="call")
        assert answer["result"], answer

    def subscribe(self, topic):
        self.send(op="subscribe", topic=topic, id=topic)
        self.until(op="status", id=topic)

    def unsubscribe(self, topic):
        self.send(op="unsubscribe", topic=topic)


class Traced:
    """The program under callgrind, which counts between two calls of `counting`."""

    def __init__(self, folder):
        self.out = Path(folder, "callgrind")
        valgrind = ["valgrind", "--quiet", "--tool=callgrind", "--instr-atstart=no", f"--callgrind-out-file={self.out}"]
        program = ["target/trace/debug/pendularm", "--bind", "127.0.0.1:0", "--log", "off"]
        self.process = subprocess.Popen(valgrind + program, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        self.address = self.process.stdout.readline().split()[-1]
        self.dumps = 0

    def control(self, *arguments):
        subprocess.run(["callgrind_control", *arguments, str(self.process.pid)], check=True, stdout=subprocess.DEVNULL)

    def files(self, exchange):
        """The files of src/ that run during an exchange."""
        exchange()
        time.sleep(1)
        self.control("--zero")
        self.control("--instr=on")
        exchange()
        self.control("--instr=off")
        self.control("--dump")
        self.dumps += 1
        text = Path(f"{self.out}.{self.dumps}").read_text(encoding="utf-8", errors="replace")
        return ran(text)


def ran(text):
    """The files of the project with a counted line in this output of callgrind."""
    names, found, now = {}, set(), None
    for line in text.splitlines():
        if match := FILE.match(line):
            kind, number, name = match.groups()
            if name:
                names[number] = name
            # A file of a called function is only named here.
            if not kind.startswith("c"):
                now = names[number]
        elif line[:1] in "0123456789+-*" and now and "/src/" in now:
            path = now if now.startswith("/") else str(ROOT / now)
            if path.startswith(f"{ROOT}/src/"):
                found.add(path.removeprefix(f"{ROOT}/"))
    return found


def walks(traced):
    """Each walk's files."""
    publisher, reader = Client(traced.address), Client(traced.address)
    publisher.send(op="advertise", topic="/chat", type="std_msgs/String")
    reader.subscribe("/chat")
    rest = traced.files(lambda: time.sleep(1))

    def message():
        publisher.send(op="publish", topic="/chat", msg={"data": "hello"})
        reader.until(op="publish", topic="/chat")

    def setpoint():
        publisher.send(op="publish", topic="/joint_trajectory", msg={"points": [{"positions": [0.1, 0.2]}]})
        # Its effect, by an answer that comes after it.
        publisher.call("/arm_sim/pause")

    def goal():
        publisher.call("/ik_action/send_goal", x=1.2, y=0.5, success_hold=0.0)
        reader.until(op="publish", topic="/ik_action/result")

    found = {
        "message": traced.files(message) - rest,
        "call": traced.files(lambda: publisher.call("/arm_sim/set_params", gravity=9.81)) - rest,
        "setpoint": traced.files(setpoint) - rest,
    }
    reader.subscribe("/joint_states")

    def joint_states():
        # More than have come between the two exchanges.
        for _ in range(90):
            reader.until(op="publish", topic="/joint_states")

    found["joint state"] = traced.files(joint_states)
    reader.unsubscribe("/joint_states")
    publisher.call("/pid_controller/enable", data=True)
    reader.subscribe("/ik_action/result")
    found["goal and its result"] = traced.files(goal) - rest
    return found


def listed(found):
    """The lists as Markdown: the files of each folder in one line."""
    parts = []
    for what, files in found.items():
        folders = {}
        for file in sorted(files):
            folder, name = file.rsplit("/", 1)
            folders.setdefault(folder, []).append(f"`{name}`")
        lines = sum(len((ROOT / file).read_text(encoding="utf-8").splitlines()) for file in files)
        rows = [f"- `{folder}/`: {', '.join(names)}" for folder, names in folders.items()]
        parts.append(f"A {what}: {len(files)} files with {lines:,} lines.\n\n" + "\n".join(rows) + "\n")
    return "\n".join(parts)


def main():
    subprocess.run(BUILD, cwd=ROOT, check=True)
    with tempfile.TemporaryDirectory() as folder:
        traced = Traced(folder)
        try:
            text = listed(walks(traced))
        finally:
            traced.process.kill()
            traced.process.wait()
    print(text)
    if "--keep" in sys.argv:
        before, rest = PAPER.read_text(encoding="utf-8").split("<!-- scripts/trace.py -->\n")
        _, after = rest.split("<!-- end -->", 1)
        PAPER.write_text(f"{before}<!-- scripts/trace.py -->\n{text}<!-- end -->{after}", encoding="utf-8")


main()

"""Two hosts with a Zenoh router each, arm and bridge on the near one, subscribers (watchers) on the far one: hosts.py
ARM BRIDGE [--bench].

The hosts are network namespaces, connected only by a pair of virtual interfaces. They end with this program. They
need root, `ip`, `unshare` and `nsenter`; if one is missing, the program reports it and ends. Without `--bench` it
checks what must hold on every machine. With it, it measures for longer and prints tables.
"""

import contextlib
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

from programs import Process, run, say, start_router, wait_for

ARM, BRIDGE = sys.argv[1:3]
IS_BENCH = "--bench" in sys.argv
DOMAIN = 7
KEY = f"{DOMAIN}/joint_states/**"
# Addresses reserved for documentation, which no host has. Each host has its own ports.
NEAR, FAR = "192.0.2.1", "192.0.2.2"
HERE = "tcp/127.0.0.1:7447"
COUNTS = [1, 10, 50] if IS_BENCH else [1, 50]
# The number of messages in a measurement: 20 s or 2 s.
MESSAGES = 1200 if IS_BENCH else 120
# Time without the killed router [s]. A searching client makes increasing pauses.
AWAY = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0] if IS_BENCH else [1.0]


def reason_against_hosts():
    """Why hosts cannot be made here; `None` if they can."""
    missing = [name for name in ["ip", "unshare", "nsenter"] if not shutil.which(name)]
    if missing:
        return f"no {missing[0]} here"
    command = ["unshare", "--net", "ip", "link", "add", "link0", "type", "veth", "peer", "name", "link1"]
    tried = subprocess.run(command, capture_output=True, text=True)
    return tried.stderr.strip() if tried.returncode else None


class Host:
    """A network namespace. It exists as long as its process, which ends with this program."""

    def __init__(self):
        self.holder = subprocess.Popen(["unshare", "--net", "cat"], stdin=subprocess.PIPE)
        self.proc = Path(f"/proc/{self.holder.pid}")
        ours = os.readlink("/proc/self/ns/net")
        wait_for("a network namespace", lambda: os.readlink(self.proc / "ns/net") != ours)
        self.before = ["nsenter", f"--net={self.proc / 'ns/net'}"]
        self.do("ip", "link", "set", "lo", "up")

    def do(self, *command):
        subprocess.run([*self.before, *command], check=True)

    def join(self, other):
        pid = str(other.holder.pid)
        self.do("ip", "link", "add", "link0", "type", "veth", "peer", "name", "link0", "netns", pid)
        for host, address in [(self, NEAR), (other, FAR)]:
            host.do("ip", "address", "add", f"{address}/30", "dev", "link0")
            host.do("ip", "link", "set", "link0", "up")

    def sent(self):
        """Bytes sent to the other host."""
        rows = (line.split(":") for line in (self.proc / "net/dev").read_text().splitlines()[2:])
        return next(int(numbers.split()[8]) for name, numbers in rows if name.strip() == "link0")

    def start(self, *command, stream="stderr", **more):
        return Process(*self.before, *command, stream=stream, **more)

    def watch(self, *arguments):
        program = Path(__file__).with_name("watchers.py")
        return Watchers(self.start(sys.executable, program, *arguments, stream="stdout", stdin=subprocess.PIPE))


class Watchers:
    """Watchers and their received messages."""

    def __init__(self, program):
        self.program = program
        program.said("ready")

    def ask(self, word):
        before = len(self.program.lines)
        self.program.process.stdin.write(f"{word}\n")
        self.program.process.stdin.flush()
        wait_for("an answer", lambda: len(self.program.lines) > before)
        return self.program.lines[-1]

    def begin(self):
        self.ask("begin")

    def read(self):
        return json.loads(self.ask("read"))

    def wait_until_each_has(self, count):
        def get():
            received = self.read()
            return received if all(one["count"] >= count for one in received["watchers"]) else None

        return wait_for(f"{count} messages for each", get)


def processor_time(program):
    """Run time of its threads in nanoseconds, from the scheduler."""
    ran = 0
    for task in Path(f"/proc/{program.process.pid}/task").iterdir():
        # A thread may have ended since it was listed.
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            ran += int((task / "schedstat").read_text().split()[0])
    return ran


def spread(values):
    """Median and 99th percentile."""
    ordered = sorted(values)
    return statistics.median(ordered), ordered[math.ceil(0.99 * len(ordered)) - 1]


class Scene:
    """All programs on both hosts."""

    def __init__(self):
        self.near, self.far = Host(), Host()
        self.near.join(self.far)
        self.start_near_router()
        self.start_far_router()
        arm = self.near.start(ARM, "--bind", "127.0.0.1:0", "--log", "off", stream="stdout")
        self.address = arm.said("listening on ").removeprefix("listening on ")
        bridge = self.near.start(BRIDGE, "--connect", self.address, "--router", HERE, "--domain", DOMAIN)
        bridge.said("is in domain")
        self.programs = {"arm": arm, "bridge": bridge}
        # Delays are those of the first watcher, which has its own process.
        self.watchers = [self.far.watch("graph", HERE, KEY, 1)]

    def start_near_router(self):
        self.near_router = start_router([HERE, f"tcp/{NEAR}:7447"], before=self.near.before)

    def start_far_router(self):
        self.far_router = start_router(HERE, f"tcp/{NEAR}:7447", before=self.far.before)

    def count(self):
        return sum(len(one.read()["watchers"]) for one in self.watchers)

    def bring(self, count):
        """Starts watchers up to this number, and waits until all get messages."""
        more = count - self.count()
        if more > 0:
            self.watchers.append(self.far.watch("graph", HERE, KEY, more))
        for one in self.watchers:
            one.wait_until_each_has(1)

    def messages_and_bytes(self):
        """The first watcher's messages and the bytes on the link, at nearly the same time."""

        def get():
            before = self.watchers[0].read()["watchers"][0]["count"]
            sent = self.near.sent()
            after = self.watchers[0].read()["watchers"][0]["count"]
            # Two readings take about a twentieth of a second, unless the machine is busy.
            return (before, sent) if after - before < 10 else None

        return wait_for("a moment's figures", get)

    def measure(self):
        """One row of figures."""
        programs = {**self.programs, "near router": self.near_router, "far router": self.far_router}
        # The first one is last, because its messages and the bytes on the link are counted from here
        # on.
        for one in reversed(self.watchers):
            one.begin()
        began = time.monotonic()
        heard_before, sent_before = self.messages_and_bytes()
        ran = {name: processor_time(program) for name, program in programs.items()}
        first = self.watchers[0].wait_until_each_has(MESSAGES)
        took = time.monotonic() - began
        heard_then, sent_then = self.messages_and_bytes()
        sent, messages = sent_then - sent_before, heard_then - heard_before
        ran = {name: processor_time(program) - ran[name] for name, program in programs.items()}
        received = [one for watchers in self.watchers for one in watchers.read()["watchers"]]
        rows = first["rows"]
        return {
            "watchers": len(received),
            "rate": len(rows) / took,
            "missing": sum(one["missing"] for one in received),
            "bytes": sent / messages * len(rows) / took,
            "bytes a message": sent / messages,
            "hop": spread((came - gone) * 1e-6 for _, gone, came in rows),
            "processor": {name: 100e-9 * of / took for name, of in ran.items()},
        }

    def lateness(self):
        """The delay of a watcher compared with a rosbridge client on the arm's host [ms]."""
        client = self.near.watch("arm", self.address)
        self.watchers[0].begin()
        client.begin()
        rows = self.watchers[0].wait_until_each_has(MESSAGES)["rows"]
        direct = {stamp: came for stamp, _, came in client.read()["rows"]}
        client.program.end()
        return spread((came - direct[stamp]) * 1e-6 for stamp, _, came in rows if stamp in direct)

    def kill(self, name, away):
        """Seconds from a router's restart until all watchers get messages."""
        getattr(self, f"{name}_router").end()
        time.sleep(away)
        for one in self.watchers:
            one.begin()
        getattr(self, f"start_{name}_router")()
        back = time.time_ns()
        received = [one for watchers in self.watchers for one in watchers.wait_until_each_has(1)["watchers"]]
        return max(0.0, max((one["first"] - back) * 1e-9 for one in received))


def show(rows):
    print("\n| watchers | messages/s to each | lost | kB/s on the link | bytes a message | hop p50, p99 [ms] | "
          "arm, bridge, near, far router [% of a core] |\n| --- | --- | --- | --- | --- | --- | --- |")
    for row in rows:
        shown = [
            row["watchers"],
            f"{row['rate']:.1f}",
            row["missing"],
            f"{row['bytes'] / 1000:.1f}",
            f"{row['bytes a message']:.0f}",
            ", ".join(f"{value:.2f}" for value in row["hop"]),
            ", ".join(f"{value:.2f}" for value in row["processor"].values()),
        ]
        print("| " + " | ".join(str(one) for one in shown) + " |")
    print()


def main():
    if why := reason_against_hosts():
        say(f"SKIPPED: no hosts can be made here: {why}")
        assert not IS_BENCH, "nothing was measured"
        return
    began = time.monotonic()
    scene = Scene()
    rows = []
    for count in COUNTS:
        scene.bring(count)
        rows.append(scene.measure())
    show(rows)
    one, many = rows[0], rows[-1]
    # There is one stream for any number of watchers. 50 streams would be fifty times as much, and other traffic is far
    # less than twice.
    assert many["bytes a message"] < 2 * one["bytes a message"], rows
    median, high = scene.lateness()
    say(f"a watcher hears {median:.2f} ms (p50), {high:.2f} ms (p99) later than a client on the arm's host")
    for name in ["near", "far"]:
        pauses = ", ".join(f"{scene.kill(name, away):.1f}" for away in AWAY)
        gone = ", ".join(str(away) for away in AWAY)
        say(f"the {name} router was away for {gone} s; all watchers hear the arm {pauses} s after it listens again")
    say(f"all is well after {time.monotonic() - began:.0f} s, load {os.getloadavg()[0]:.1f}")


run(main)

#!/usr/bin/env python3
"""Round trip and processor time of calls, of each program named, in turn, three times: one after the other, and 100 a second.

    python3 benches/awake.py target/release/pendularm OTHER

shows what it costs and saves to stay awake after a call, where OTHER is built with `MOMENT` (src/actors/resources/awake.rs) of 0.
"""

import glob
import socket
import subprocess
import sys
import time

CALL = b'{"op":"call_service","service":"/arm_sim/set_params","args":{}}\n'


def processor(pid):
    """Processor time of all threads of a process, in nanoseconds, as the scheduler counts it."""
    return sum(int(open(name).read().split()[0]) for name in glob.glob(f"/proc/{pid}/task/*/schedstat"))


class Server:
    """A program that serves on a free port, a client of it, and what it takes at rest, in nanoseconds a second."""

    def __init__(self, path):
        self.process = subprocess.Popen([path, "--bind", "127.0.0.1:0", "--log", "off"], stdout=subprocess.PIPE, text=True)
        host, port = self.process.stdout.readline().split()[-1].rsplit(":", 1)
        self.socket = socket.create_connection((host, int(port)))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for _ in range(2000):
            self.call()
        before = processor(self.process.pid)
        time.sleep(2)
        self.at_rest = (processor(self.process.pid) - before) / 2

    def call(self):
        """Calls once; seconds until the answer."""
        began = time.perf_counter()
        self.socket.sendall(CALL)
        answer = b""
        while not answer.endswith(b"\n"):
            answer += self.socket.recv(65536)
        return time.perf_counter() - began

    def measure(self, calls, pause):
        """Median round trip and processor time a call beside what is taken at rest, in microseconds."""
        began, before, times = time.perf_counter(), processor(self.process.pid), []
        for _ in range(calls):
            times.append(self.call())
            if pause:
                time.sleep(pause)
        taken = processor(self.process.pid) - before - self.at_rest * (time.perf_counter() - began)
        return sorted(times)[calls // 2] * 1e6, taken / calls / 1e3


for _ in range(3):
    for path in sys.argv[1:]:
        server = Server(path)
        try:
            for what, calls, pause in [("one after the other", 20_000, 0.0), ("100 a second", 500, 0.01)]:
                median, taken = server.measure(calls, pause)
                print(f"{path:40} {what:20} median {median:6.1f} us, processor time {taken:6.1f} us a call", flush=True)
        finally:
            server.process.terminate()
            server.process.wait()

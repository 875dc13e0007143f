"""Starts and stops the runtime under test, and speaks to it over TCP past the page.

Invariant: the process that was started is the one that is stopped, by its id.
"""

import json
import math
import os
import signal
import socket
import subprocess

BINARY = os.environ.get("PENDULARM", "target/debug/pendularm")
# Far longer than every expected wait [s]. A longer wait is a failure.
PATIENCE = 30


class Runtime:
    """A pendularm process; use it with `with`. Without a port it takes a free one, and keeps it through `restart`."""

    def __init__(self, *options, links=2, port=0):
        self.options, self.links, self.port = options, links, port
        self.start()

    def start(self):
        command = [BINARY, "--links", str(self.links), "--bind", f"127.0.0.1:{self.port}", "--seed", "7", *self.options]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        line = self.process.stdout.readline()
        if not line.startswith("listening on "):
            raise RuntimeError(f"{command}: said {line!r}, status {self.process.wait(PATIENCE)}")
        self.port = int(line.rsplit(":", 1)[1])

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(PATIENCE)
        self.process.stdout.close()

    def restart(self, links=None):
        self.stop()
        self.links = links or self.links
        self.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.stop()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}/"

    def call(self, service, **args):
        """The response to a call."""
        return self.ask({"op": "call_service", "service": service, "args": args}, "service_response")

    def next(self, topic):
        """The next message on a topic."""
        return self.ask({"op": "subscribe", "topic": topic}, "publish")["msg"]

    def ask(self, frame, wanted):
        """Sends a frame over raw TCP, and gives the first one with the wanted `op` that comes."""
        with socket.create_connection(("127.0.0.1", self.port), PATIENCE) as tcp, tcp.makefile("rw") as lines:
            lines.write(json.dumps(frame) + "\n")
            lines.flush()
            while (answer := json.loads(lines.readline()))["op"] != wanted:
                pass
            return answer

    def joints(self):
        """Where each link ends [m], from the published state and the lengths: the base first, the end effector last."""
        lengths = self.call("/arm_sim/set_params")["values"]["lengths"]
        ends, angle = [(0.0, 0.0)], 0.0
        for length, q in zip(lengths, self.next("/joint_states")["position"]):
            angle += q
            x, y = ends[-1]
            ends.append((x + length * math.cos(angle), y + length * math.sin(angle)))
        return ends

    def end_effector(self):
        return self.joints()[-1]

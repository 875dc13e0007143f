"""Programs that tests start, their output, and waiting for it. Every wait ends with its condition, or fails after a
minute."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
import traceback
from pathlib import Path

LIMIT = 60.0


def say(text):
    print(f"{Path(sys.argv[0]).stem}: {text}", flush=True)


def wait_for(what, get):
    """Waits until `get` returns a value, and returns it."""
    deadline = time.monotonic() + LIMIT
    while not (found := get()):
        assert time.monotonic() < deadline, f"not within {LIMIT} s: {what}"
        time.sleep(0.05)
    return found


class Process:
    """A program and its output lines."""

    all = []

    def __init__(self, *command, stream="stderr", **more):
        pipes = {stream: subprocess.PIPE, **more}
        self.process = subprocess.Popen([str(part) for part in command], text=True, **pipes)
        Process.all.append(self.process)
        self.lines = []
        self.reader = threading.Thread(target=self.read, args=[getattr(self.process, stream)], daemon=True)
        self.reader.start()

    def read(self, stream):
        for line in stream:
            self.lines.append(line.rstrip("\n"))

    def said(self, text, times=1):
        """The last of this number of lines with that text."""

        def get():
            found = [line for line in self.lines if text in line]
            assert found or self.process.poll() is None, f"ended: {self.lines}"
            return found[-1:] if len(found) >= times else None

        return wait_for(f"{text!r} in {self.lines}", get)[0]

    def end(self):
        self.process.kill()
        self.process.wait()
        self.reader.join()


def start_router(listen, *connect, before=()):
    """A router that listens at one endpoint or several, and connects to others."""
    listen = [listen] if isinstance(listen, str) else listen
    options = [f"--connect={endpoint}" for endpoint in connect]
    program = Path(__file__).with_name("router.py")
    router = Process(*before, sys.executable, program, *listen, *options, stream="stdout")
    router.said("ready")
    return router


def open_session(endpoint):
    """A Zenoh session that connects only to this endpoint."""
    import zenoh

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


def run(main):
    """Runs `main`, ends all started programs, and ends, also after SIGTERM."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("told to end"))
    try:
        main()
        status = 0
    except BaseException:
        traceback.print_exc()
        status = 1
    for process in Process.all:
        process.kill()
    sys.stdout.flush()
    # Zenoh's sessions would search their routers for a long time.
    os._exit(status)

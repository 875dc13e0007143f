"""A live runtime for the tests, and a client of Python's standard library."""

import json
import signal
import socket
import subprocess
import sys
import sysconfig
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

# A limit far above every expected wait. A longer wait is a failure.
PATIENCE = 60.0

# A script that a shell starts in the background ignores SIGINT, and so would its child processes.
signal.signal(signal.SIGINT, signal.default_int_handler)


class Runtime:
    """The program of the wheel on a free port, and a connection to it."""

    def __init__(self, *arguments: str) -> None:
        program = Path(sysconfig.get_path("scripts")) / "pendularm"
        self.process = subprocess.Popen(
            [str(program), "--bind", "127.0.0.1:0", "--log", "off", *arguments], stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().removeprefix("listening on ").strip()
        host, port = self.address.rsplit(":", 1)
        self.socket = socket.create_connection((host, int(port)), timeout=PATIENCE)
        self.lines = self.socket.makefile()
        self.calls = 0

    def send(self, **op: object) -> None:
        self.socket.sendall(json.dumps(op).encode() + b"\n")

    def call(self, service: str, **args: object) -> dict:
        """Calls a service and returns its values."""
        self.calls += 1
        name = f"call-{self.calls}"
        self.send(op="call_service", service=service, args=args, id=name)
        for line in self.lines:
            response = json.loads(line)
            if response.get("op") == "service_response" and response.get("id") == name:
                assert response["result"], response
                return response["values"]
        raise AssertionError("the runtime has ended")

    def next_message(self, topic: str) -> dict:
        for line in self.lines:
            frame = json.loads(line)
            if frame.get("op") == "publish" and frame.get("topic") == topic:
                return frame["msg"]
        raise AssertionError("the runtime has ended")

    def end(self) -> None:
        self.lines.close()
        self.socket.close()
        self.process.terminate()
        assert self.process.wait(PATIENCE) == 0
        assert self.process.stdout is not None
        self.process.stdout.close()


@pytest.fixture(autouse=True)
def windows_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.fixture(params=[2, 3], ids=["2 links", "3 links"])
def links(request: pytest.FixtureRequest) -> int:
    return request.param


@pytest.fixture(params=["Pendularm-v0", "PendularmReach-v0"])
def name(request: pytest.FixtureRequest) -> str:
    """The name of an environment."""
    return request.param


@pytest.fixture
def runtime(links: int) -> Iterator[Runtime]:
    one = Runtime("--links", str(links))
    yield one
    one.end()


@pytest.fixture
def start_child() -> Iterator[Callable[[str], subprocess.Popen[str]]]:
    """Starts a script in a separate interpreter. It ends with the test or after a time limit, so no test waits for
    its next line for ever."""
    started = []

    def start(script: str) -> subprocess.Popen[str]:
        run = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        limit = threading.Timer(2 * PATIENCE, run.kill)
        limit.start()
        started.append((run, limit))
        return run

    yield start
    for run, limit in started:
        limit.cancel()
        run.kill()
        run.wait(PATIENCE)
        assert run.stdout is not None
        run.stdout.close()


@pytest.fixture
def play_notebook() -> Callable[..., None]:
    """Runs all cells of a notebook. It communicates with its kernel over files, because another process may take a
    chosen port."""

    def play(book: object, **options: object) -> None:
        import nbclient
        from traitlets.config import Config

        # The path of a socket's file may have only about a hundred characters.
        with tempfile.TemporaryDirectory() as folder:
            config = Config({"KernelManager": {"transport": "ipc", "ip": f"{folder}/kernel"}})
            nbclient.NotebookClient(book, timeout=300, config=config, **options).execute()

    return play


@pytest.fixture
def turns_of_another_thread() -> Callable[[Callable[[], object]], int]:
    """Counts the turns of another thread during a call, with an interpreter that never takes its lock from a thread.
    The call is repeated until there is a turn, at most 1000 times."""

    def count(call: Callable[[], object]) -> int:
        seen, done = 0, threading.Event()

        def watch() -> None:
            nonlocal seen
            while not done.is_set():
                seen += 1
                time.sleep(0.0001)

        watcher = threading.Thread(target=watch)
        interval = sys.getswitchinterval()
        try:
            watcher.start()
            sys.setswitchinterval(1000)
            before = seen
            for _ in range(1000):
                call()
                if seen > before:
                    break
            return seen - before
        finally:
            done.set()
            sys.setswitchinterval(interval)
            watcher.join()

    return count

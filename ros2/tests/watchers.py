"""Watchers of `/joint_states`: watchers.py graph ROUTER KEY COUNT, or watchers.py arm HOST:PORT.

In the graph each watcher has its own Zenoh session. At the arm it is a rosbridge client. Lines on standard input are
commands: `begin` discards the received messages, `read` prints them.
"""

import json
import socket
import struct
import sys
import threading
import time

from programs import open_session

# 60 a second for some minutes.
MOST_ROWS = 20_000


class Watcher:
    """The messages of one watcher."""

    def __init__(self, keeps_rows):
        self.keeps_rows = keeps_rows
        self.lock = threading.Lock()
        self.begin()

    def begin(self):
        with self.lock:
            self.count, self.missing, self.first, self.last_number = 0, 0, None, None
            # The arm's stamp, the time of sending by the bridge, and the time of arrival, all in
            # nanoseconds.
            self.rows = []

    def hear(self, number, stamp, sent):
        now = time.time_ns()
        with self.lock:
            self.count += 1
            self.first = self.first or now
            if self.last_number is not None:
                self.missing += number - self.last_number - 1
            self.last_number = number
            if self.keeps_rows and len(self.rows) < MOST_ROWS:
                self.rows.append([stamp, sent, now])

    def read(self):
        with self.lock:
            return {"count": self.count, "missing": self.missing, "first": self.first}


def watch_graph(router, key, count):
    import zenoh

    watchers, kept = [], []
    for index in range(int(count)):
        watcher = Watcher(keeps_rows=index == 0)

        def hear(sample, watcher=watcher):
            number, sent = struct.unpack_from("<qq", sample.attachment.to_bytes())
            # After four bytes for the encoding, the message begins with its stamp.
            seconds, nanoseconds = struct.unpack_from("<iI", sample.payload.to_bytes(), 4)
            watcher.hear(number, seconds * 10**9 + nanoseconds, sent)

        session = open_session(router)
        kept += [session, session.declare_subscriber(key, zenoh.handlers.Callback(hear, indirect=False))]
        watchers.append(watcher)
    return watchers, kept


def watch_arm(address):
    host, port = address.rsplit(":", 1)
    stream = socket.create_connection((host, int(port)))
    stream.sendall(b'{"op": "subscribe", "topic": "/joint_states"}\n')
    watcher = Watcher(keeps_rows=True)

    def hear():
        for number, line in enumerate(stream.makefile("rb")):
            frame = json.loads(line)
            if frame["op"] == "publish":
                stamp = frame["msg"]["header"]["stamp"]
                watcher.hear(number, stamp["sec"] * 10**9 + stamp["nanosec"], 0)

    threading.Thread(target=hear, daemon=True).start()
    return [watcher], stream


watchers, kept = {"graph": watch_graph, "arm": watch_arm}[sys.argv[1]](*sys.argv[2:])
print("ready", flush=True)
for line in sys.stdin:
    if line == "begin\n":
        for watcher in watchers:
            watcher.begin()
        print("begun", flush=True)
    else:
        rows = watchers[0].rows
        print(json.dumps({"watchers": [one.read() for one in watchers], "rows": list(rows)}), flush=True)

"""A Zenoh router, until it is killed: router.py LISTEN... [--connect=ENDPOINT]..."""

import json
import sys
import threading

import zenoh

connect = [word.removeprefix("--connect=") for word in sys.argv[1:] if word.startswith("--connect=")]
listen = [word for word in sys.argv[1:] if not word.startswith("--connect=")]
config = zenoh.Config()
config.insert_json5("mode", '"router"')
config.insert_json5("listen/endpoints", json.dumps(listen))
config.insert_json5("connect/endpoints", json.dumps(connect))
config.insert_json5("scouting/multicast/enabled", "false")
with zenoh.open(config):
    print("ready", flush=True)
    threading.Event().wait()

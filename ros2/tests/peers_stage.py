"""Support for peers.py: the arm, the bridge, sessions on the router, and nodes of the SDK."""

import socket
import subprocess
import sys
from pathlib import Path

from programs import LIMIT, Process, wait_for
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2Subscriber
from zenoh_ros2_sdk.qos import QosDurability, QosProfile

ARM, BRIDGE = sys.argv[1:]
DOMAIN = 7
JAZZY = get_typestore(Stores.ROS2_JAZZY)
LATCHED = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
kept_ports = []


def free_port():
    """A reserved port: a socket here holds it without listening, and allows other sockets to use the same number."""
    one = socket.socket()
    one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    one.bind(("127.0.0.1", 0))
    kept_ports.append(one)
    return one.getsockname()[1]


def start_arm(port, *more):
    arm = Process(ARM, "--bind", f"127.0.0.1:{port}", "--log", "off", *more, stream="stdout")
    return arm, arm.said("listening on ").removeprefix("listening on ")


def start_bridge(arm, router_port, *more):
    router = f"tcp/127.0.0.1:{router_port}"
    return Process(BRIDGE, "--connect", arm, "--router", router, "--domain", DOMAIN, *more)


def tokens(session, kind="*"):
    """The parts of the tokens of that kind in the domain: 8 is the node, 9 the name, 10 the type, 11 the hash."""
    replies = session.liveliness().get(f"@ros2_lv/{DOMAIN}/*/*/*/{kind}/**", timeout=LIMIT)
    return [str(reply.ok.key_expr).split("/") for reply in replies if reply.ok]


def hears_joint_states(session, namespace=""):
    """Waits for ten joint states of the arm in this namespace."""
    received = []
    watcher = session.declare_subscriber(f"{DOMAIN}{namespace}/joint_states/**", received.append)
    wait_for("joint states", lambda: len(received) >= 10)
    watcher.undeclare()


def command_line(port, *arguments):
    """The output of the SDK's command."""
    command = [Path(sys.executable).with_name("zenoh-ros2"), "--no-daemon", "--router", f"127.0.0.1:{port}"]
    command += ["--domain-id", str(DOMAIN), "--timeout", "5", *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=LIMIT).stdout


class Peer:
    """Nodes of the SDK."""

    def __init__(self, port):
        self.at = {"domain_id": DOMAIN, "router_ip": "127.0.0.1", "router_port": port}

    def message(self, name):
        definition, _ = JAZZY.generate_msgdef(name, ros_version=2)
        return {"msg_definition": definition, "type_hash": JAZZY.hash_rihs01(name), **self.at}

    def subscribe(self, topic, name, qos=None):
        received = []
        ROS2Subscriber(topic, name, received.append, qos=qos, **self.message(name))
        return received

    def publisher(self, topic, name):
        return ROS2Publisher(topic, name, **self.message(name))

    def service(self, name, kind, request, response, type_hash=None):
        """A client that computes the type's hash from the definitions, unless the hash is given."""
        definitions = {"request_definition": request, "response_definition": response}
        return ROS2ServiceClient(name, kind, timeout=LIMIT, type_hash=type_hash, **definitions, **self.at)

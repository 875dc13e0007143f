"""The command that comes with roslibpy, unmodified: `roslibpy_command.py HOST:PORT`."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

PATIENCE = 60
PROGRAM = Path(sys.executable).with_name("roslibpy")

host, port = sys.argv[1].rsplit(":", 1)


def run(words):
    """What the command says, line by line."""
    command = [PROGRAM, "--ros-host", host, "--ros-port", port, *words.split()]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 0, (words, ran.stderr)
    return ran.stdout.splitlines()


EXPECTED = {
    "topic list": "/joint_states",
    "topic type /joint_states": "sensor_msgs/msg/JointState",
    "topic find sensor_msgs/msg/JointState": "/joint_states",
    "msg info sensor_msgs/msg/JointState": "float64[] position",
    "service list": "/pid_controller/enable",
    "service type /pid_controller/enable": "pendularm_interfaces/srv/Enable",
    "service find pendularm_interfaces/srv/Enable": "/pid_controller/enable",
    "service info /ik/solve": "float64[] positions",
    "srv info pendularm_interfaces/srv/Solve": "float64 x",
    "param list": "/arm_sim:gravity",
    "param get gravity": "9.81",
}

# Each is a separate Python process that takes a second to start.
with ThreadPoolExecutor(4) as pool:
    for words, lines in zip(EXPECTED, pool.map(run, EXPECTED)):
        assert EXPECTED[words] in lines, (words, lines)

assert run("param set gravity 9.5") == []
assert run("param get gravity") == ["9.5"]
print("roslibpy's command: ok")

"""roslibpy and its command, unmodified, over WebSocket: `roslibpy_client.py HOST:PORT`."""

import subprocess
import sys
import threading
from pathlib import Path

import roslibpy

PATIENCE = 30


class Awaited:
    """A value that a callback brings."""

    def __init__(self, what):
        self.what, self.event, self.value = what, threading.Event(), None

    def __call__(self, *value):
        self.value = value[0] if value else None
        self.event.set()

    def get(self):
        assert self.event.wait(PATIENCE), f"{self.what} did not come"
        return self.value


host, port = sys.argv[1].rsplit(":", 1)
ros = roslibpy.Ros(host, int(port))
ros.run(timeout=PATIENCE)

topics = ros.get_topics()
assert "/joint_states" in topics and "/rosout" in topics, topics
details = ros.get_message_details("sensor_msgs/msg/JointState")
assert details["typedefs"][0]["fieldnames"][0] == "header", details
assert ros.get_time()["secs"] >= 0

gravity = roslibpy.Param(ros, "gravity")
assert gravity.get() == 9.81, gravity.get()
gravity.set(9.5)
params = roslibpy.Service(ros, "/arm_sim/set_params", "pendularm_interfaces/srv/SetParams")
assert params.call(roslibpy.ServiceRequest({}))["gravity"] == 9.5
try:
    params.call(roslibpy.ServiceRequest({"gravity": -1}))
    raise AssertionError("a negative gravity was taken")
except roslibpy.core.ServiceException as why:
    assert "gravity must be at least 0" in str(why), why

state = Awaited("a state")
states = roslibpy.Topic(ros, "/joint_states", "sensor_msgs/JointState")
states.subscribe(state)
assert state.get()["name"] == ["joint1", "joint2"]
states.unsubscribe()

enable = roslibpy.Service(ros, "/pid_controller/enable", "pendularm_interfaces/srv/Enable")
assert enable.call(roslibpy.ServiceRequest({"data": True})) == {"data": True}
setpoint = Awaited("its own setpoint")
trajectory = roslibpy.Topic(ros, "/joint_trajectory", "trajectory_msgs/JointTrajectory")
trajectory.subscribe(setpoint)
trajectory.publish(roslibpy.Message({"points": [{"positions": [0.2, 0.3]}]}))
assert setpoint.get()["points"][0]["positions"] == [0.2, 0.3]

result, feedback = Awaited("a result"), Awaited("feedback")
action = roslibpy.ActionClient(ros, "/ik_action", "pendularm_interfaces/action/MoveTo")
goal = roslibpy.Goal({"x": 0.5, "y": 1.2})
action.send_goal(goal, result, feedback, lambda error: print("refused:", error))
assert result.get()["values"]["outcome"] == "reached", result.value
assert feedback.event.is_set()

for words, expected in (("topic list", "/joint_states"), ("service find pendularm_interfaces/srv/Enable", "/pid_controller/enable"),
                        ("param set gravity 9.25", None), ("param get gravity", "9.25")):
    command = [Path(sys.executable).with_name("roslibpy"), "--ros-host", host, "--ros-port", port, *words.split()]
    lines = subprocess.run(command, capture_output=True, check=True, text=True, timeout=PATIENCE).stdout.splitlines()
    assert expected is None or expected in lines, (words, lines)

ros.terminate()
print("roslibpy: ok")

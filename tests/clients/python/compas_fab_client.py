"""compas_fab, unmodified, over WebSocket: `compas_fab_client.py HOST:PORT`: the arm's cell from its topics, and a path."""

import sys
import threading

import roslibpy
from compas_fab.backends import RosClient
from compas_fab.backends.ros.messages import Header, JointTrajectory, JointTrajectoryPoint, Time

PATIENCE = 30
ACTION = "/joint_trajectory_controller/follow_joint_trajectory"

host, port = sys.argv[1].rsplit(":", 1)
with RosClient(host, int(port)) as client:
    assert client.ros_distro.is_ros2, client.ros_distro
    cell = client.load_robot_cell()
    assert cell.robot_model.name == "pendularm"
    assert cell.get_configurable_joint_names() == ["joint1", "joint2"]
    assert cell.get_end_effector_link_name() == "hand"

    enable = roslibpy.Service(client, "/pid_controller/enable", "pendularm_interfaces/srv/Enable")
    enable.call(roslibpy.ServiceRequest({"data": True}))

    names = cell.get_configurable_joint_names()
    points = [
        JointTrajectoryPoint(positions=[0.1, -0.1], velocities=[0, 0], time_from_start=Time(secs=0, nsecs=400_000_000)),
        JointTrajectoryPoint(positions=[0.2, -0.3], velocities=[0, 0], time_from_start=Time(secs=1)),
    ]
    arrived, progress = threading.Event(), []

    def look(state):
        near = [abs(is_at - wanted) < 0.02 for is_at, wanted in zip(state["position"], points[-1].positions)]
        if all(near):
            arrived.set()

    roslibpy.Topic(client, "/joint_states", "sensor_msgs/msg/JointState").subscribe(look)
    # No callback: compas_fab 2.0.1 expects another form of a result than roslibpy 2.1 passes to it.
    client.follow_joint_trajectory(
        JointTrajectory(Header(), names, points), action_name=ACTION, feedback_callback=progress.append
    )
    assert arrived.wait(PATIENCE), "the arm did not come to the end of the path"
    assert progress, "no feedback"

print("compas_fab: ok")

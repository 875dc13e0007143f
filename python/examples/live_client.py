"""Moves the arm of a live runtime with roslibpy: live_client.py [HOST[:PORT]]. `pendularm` starts one; look at its page
meanwhile.

The library computes the joint positions, the runtime moves the arm there, and a topic of the runtime has the result.
"""

import sys
import threading

import roslibpy

import pendularm

TARGET = (0.9, 1.1)
PATIENCE = 60


def address(given: str = "127.0.0.1") -> tuple[str, int]:
    """Host and port. The default port is the runtime's."""
    host, _, port = given.partition(":")
    return host, int(port or 9095)


def main() -> None:
    ros = roslibpy.Ros(*address(*sys.argv[1:2]))
    ros.run(timeout=PATIENCE)

    params = roslibpy.Service(ros, "/arm_sim/set_params", "").call(roslibpy.ServiceRequest(), timeout=PATIENCE)
    arm = pendularm.Arm(
        len(params["lengths"]), lengths=params["lengths"], masses=params["masses"], gravity=params["gravity"]
    )
    goal = pendularm.inverse_kinematics(arm, *TARGET)
    print(f"target {TARGET} m, joints {goal.round(3)} rad")

    arrived = threading.Event()

    def watch(state: dict) -> None:
        away = abs(goal - state["position"]).max()
        if away < 0.01 and max(map(abs, state["velocity"])) < 0.05:
            arrived.set()

    states = roslibpy.Topic(ros, "/joint_states", "sensor_msgs/JointState")
    states.subscribe(watch)
    roslibpy.Service(ros, "/pid_controller/enable", "").call(roslibpy.ServiceRequest({"data": True}), timeout=PATIENCE)
    setpoint = roslibpy.Topic(ros, "/joint_trajectory", "trajectory_msgs/JointTrajectory")
    setpoint.publish(roslibpy.Message({"points": [{"positions": goal.tolist()}]}))
    here = arrived.wait(PATIENCE)
    print("it is there" if here else f"it is not there after {PATIENCE} s")
    states.unsubscribe()
    ros.close()
    sys.exit(0 if here else 1)


if __name__ == "__main__":
    main()

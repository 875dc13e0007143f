"""Actions of the bridge, for peers.py. The SDK has no action client, so each action is used through its services and
topics."""

import numpy
from control_msgs import CONTROL_MSGS
from peers_stage import JAZZY, LATCHED, tokens
from programs import wait_for
from zenoh_ros2_sdk import ROS2Subscriber

UUID = "unique_identifier_msgs/msg/UUID"
TIME = "builtin_interfaces/msg/Time"
GOAL_ID = "unique_identifier_msgs/UUID goal_id"
INSIDE = {
    "unique_identifier_msgs__UUID": "uint8[16] uuid",
    "builtin_interfaces__Time": "int32 sec\nuint32 nanosec",
}


def definition(fields, **inside):
    """A definition with those of its inner types, as text."""
    parts = ["=" * 80 + f"\nMSG: {name.replace('__', '/')}\n{text}" for name, text in inside.items()]
    return "\n".join([fields, *parts])


class ActionClient:
    """The services and the feedback of an action, with the hashes in the graph. `parts` are the types of its goal, its
    result and its feedback, and `inside` has the definitions of all its types."""

    def __init__(self, peer, session, place, action, parts, inside):
        self.peer, self.place, self.inside = peer, f"{place}/_action/", {**INSIDE, **inside}
        self.hashes = {token[9]: (token[10], token[11]) for kind in ["SS", "MP"] for token in tokens(session, kind)}
        goal, result, feedback = parts
        accepted = "bool accepted\nbuiltin_interfaces/Time stamp"
        self.send = self.service("send_goal", f"{action}_SendGoal", f"{GOAL_ID}\n{goal} goal", accepted)
        self.wait = self.service("get_result", f"{action}_GetResult", GOAL_ID, f"int8 status\n{result} result")
        self.received = []
        kind, text = f"{action}_FeedbackMessage", definition(f"{GOAL_ID}\n{feedback} feedback", **self.inside)
        options = {"msg_definition": text, "type_hash": self.hash_of("feedback", kind), **peer.at}
        ROS2Subscriber(f"{self.place}feedback", kind, self.received.append, **options)

    def hash_of(self, part, kind):
        dds, found = self.hashes[f"{self.place}{part}".replace("/", "%")]
        package, middle, name = kind.split("/")
        assert dds == f"{package}::{middle}::dds_::{name}_", dds
        return found

    def service(self, part, kind, request, response):
        texts = [definition(text, **self.inside) for text in (request, response)]
        return self.peer.service(f"{self.place}{part}", kind, *texts, self.hash_of(part, kind))


def test_a_goal_is_sent_as_an_action(peer, session):
    """The services and subscriptions of one action."""
    package = "pendularm_interfaces"
    inside = {
        f"{package}__MoveToGoal": "float64 x\nfloat64 y\nfloat64 phi\nfloat64 epsilon\nfloat64 success_hold",
        f"{package}__MoveToResult": f"string goal_id\nstring outcome\n{package}/Target target\nfloat64 final_distance",
        f"{package}__MoveToFeedback": f"string goal_id\n{package}/Target target\nfloat64[] positions\n"
        "float64 distance_remaining\nfloat64 elapsed",
        f"{package}__Target": "float64 x\nfloat64 y\nfloat64 phi",
        "action_msgs__GoalInfo": f"{GOAL_ID}\nbuiltin_interfaces/Time stamp",
    }
    parts = [f"{package}/MoveTo{part}" for part in ["Goal", "Result", "Feedback"]]
    client = ActionClient(peer, session, "/ik_action", f"{package}/action/MoveTo", parts, inside)
    send, wait, received = client.send, client.wait, client.received
    outcome = "int8 return_code\naction_msgs/GoalInfo[] goals_canceling"
    cancel = client.service("cancel_goal", "action_msgs/srv/CancelGoal", "action_msgs/GoalInfo goal_info", outcome)
    states = peer.subscribe(f"{client.place}status", "action_msgs/msg/GoalStatusArray", qos=LATCHED)
    of = send.session_mgr.store.types

    def goal(number, x, y, success_hold=0.0):
        name = of[UUID](uuid=numpy.full(16, number, dtype=numpy.uint8))
        goal_type = next(one for kind, one in of.items() if kind.endswith("MoveToGoal"))
        sent = send.call(goal_id=name, goal=goal_type(x=x, y=y, phi=0.0, epsilon=0.0, success_hold=success_hold))
        return name, sent.accepted

    name, accepted = goal(1, 1.0, 1.0)
    assert accepted
    ended = wait.call(goal_id=name)
    assert ended.status == 4 and ended.result.final_distance < 0.02, ended
    mine = wait_for("feedback", lambda: [one for one in received if list(one.goal_id.uuid) == [1] * 16])
    assert all(len(one.feedback.positions) == 2 for one in mine), received
    _, accepted = goal(2, 5.0, 5.0)
    assert not accepted, "five metres are out of reach"
    # A paused arm sends no feedback, and accepts the goal at once. It does not end by itself before it is cancelled.
    switch = ("pendularm_interfaces/srv/Pause", "bool data", "bool data\nbool success\nstring message")
    pause = peer.service("/arm_sim/pause", *switch)
    assert pause.call(data=True).data
    name, accepted = goal(3, -1.0, 0.5, success_hold=1e6)
    assert accepted and not pause.call(data=False).data
    everything = of["action_msgs/msg/GoalInfo"](goal_id=name, stamp=of[TIME](sec=0, nanosec=0))
    cancelled = cancel.call(goal_info=everything)
    assert cancelled.return_code == 0 and len(cancelled.goals_canceling) == 1, cancelled
    ended = wait.call(goal_id=name)
    assert ended.status == 5, ended
    wait_for("the states of both", lambda: states and [one.status for one in states[-1].status_list] == [4, 5])
    return len(mine)


def test_a_path_is_sent_as_an_action(peer, session, states):
    """Uses ROS 2's definition. Fields for other robots are empty."""
    goal, result, feedback = CONTROL_MSGS["action/FollowJointTrajectory.action"].split("---\n")
    inside = {
        "control_msgs__FollowGoal": goal,
        "control_msgs__FollowResult": result,
        "control_msgs__FollowFeedback": feedback,
        "control_msgs__JointTolerance": CONTROL_MSGS["msg/JointTolerance.msg"],
        "control_msgs__JointComponentTolerance": CONTROL_MSGS["msg/JointComponentTolerance.msg"],
    }
    for kind in [
        "trajectory_msgs/msg/JointTrajectory",
        "trajectory_msgs/msg/JointTrajectoryPoint",
        "trajectory_msgs/msg/MultiDOFJointTrajectory",
        "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint",
        "geometry_msgs/msg/Transform",
        "geometry_msgs/msg/Twist",
        "geometry_msgs/msg/Vector3",
        "geometry_msgs/msg/Quaternion",
        "std_msgs/msg/Header",
        "builtin_interfaces/msg/Duration",
    ]:
        definitions, _ = JAZZY.generate_msgdef(kind, ros_version=2)
        inside[kind.replace("/msg/", "__")] = definitions.split("=" * 80)[0].strip()
    parts = [f"control_msgs/Follow{part}" for part in ["Goal", "Result", "Feedback"]]
    place, action = "/joint_trajectory_controller/follow_joint_trajectory", "control_msgs/action/FollowJointTrajectory"
    client = ActionClient(peer, session, place, action, parts, inside)
    send, wait, received = client.send, client.wait, client.received
    of = send.session_mgr.store.types
    duration = of["builtin_interfaces/msg/Duration"]
    header = of["std_msgs/msg/Header"](stamp=of[TIME](sec=0, nanosec=0), frame_id="")
    nothing = numpy.array([], dtype=numpy.float64)
    goal = [0.2, 0.3]
    point = of["trajectory_msgs/msg/JointTrajectoryPoint"](
        positions=numpy.array(goal),
        velocities=nothing,
        accelerations=nothing,
        effort=nothing,
        time_from_start=duration(sec=1, nanosec=0),
    )
    of_one, of_many = of["trajectory_msgs/msg/JointTrajectory"], of["trajectory_msgs/msg/MultiDOFJointTrajectory"]
    path = of["control_msgs/msg/FollowGoal"](
        trajectory=of_one(header=header, joint_names=["joint1", "joint2"], points=[point]),
        multi_dof_trajectory=of_many(header=header, joint_names=[], points=[]),
        path_tolerance=[],
        component_path_tolerance=[],
        goal_tolerance=[],
        component_goal_tolerance=[],
        goal_time_tolerance=duration(sec=0, nanosec=0),
    )
    mine = of[UUID](uuid=numpy.full(16, 9, dtype=numpy.uint8))
    assert send.call(goal_id=mine, goal=path).accepted
    ended = wait.call(goal_id=mine)
    assert (ended.status, ended.result.error_code) == (4, 0), ended
    told = wait_for("feedback", lambda: [one.feedback for one in received])
    for one in told:
        assert one.joint_names == ["joint1", "joint2"] and len(one.actual.positions) == 2, one
        # These fields are for other robots, but CDR has them too.
        assert not one.multi_dof_joint_names and not one.multi_dof_error.transforms, one
    # A path ends within 0.05 rad of its goal, but perhaps not at rest. The goal above must be reached to 0.01 rad.
    wait_for("the end of the path", lambda: all(abs(a - b) < 0.01 for a, b in zip(states[-1].position, goal)))
    return len(told)

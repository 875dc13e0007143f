"""Actions of the bridge, for peers.py. The SDK has no action client, so each action is used through its services and
topics."""

import numpy
from peers_stage import JAZZY, LATCHED, tokens
from programs import wait_for
from zenoh_ros2_sdk import ROS2Subscriber

UUID = "unique_identifier_msgs/msg/UUID"
TIME = "builtin_interfaces/msg/Time"


def definition(fields, **inside):
    """A definition with those of its inner types, as text."""
    parts = ["=" * 80 + f"\nMSG: {name.replace('__', '/')}\n{text}" for name, text in inside.items()]
    return "\n".join([fields, *parts])


def test_a_goal_is_sent_as_an_action(peer, session):
    """The services and subscriptions of one action, with the hashes in the graph."""
    place = "/ik_action/_action/"
    hashes = {token[9]: (token[10], token[11]) for kind in ["SS", "MP"] for token in tokens(session, kind)}

    def found(part, kind):
        dds, found = hashes[f"%ik_action%_action%{part}"]
        package, middle, name = kind.split("/")
        assert dds == f"{package}::{middle}::dds_::{name}_", dds
        return found

    def service(part, kind, request, response):
        return peer.service(f"{place}{part}", kind, request, response, found(part, kind))

    uuid, stamp = {"unique_identifier_msgs__UUID": "uint8[16] uuid"}, {"builtin_interfaces__Time": "int32 sec\nuint32 nanosec"}
    target = {"pendularm_interfaces__Target": "float64 x\nfloat64 y\nfloat64 phi"}
    move = "pendularm_interfaces/action/MoveTo"
    send = service(
        "send_goal",
        f"{move}_SendGoal",
        definition(
            "unique_identifier_msgs/UUID goal_id\npendularm_interfaces/MoveToGoal goal",
            pendularm_interfaces__MoveToGoal="float64 x\nfloat64 y\nfloat64 phi\nfloat64 epsilon\nfloat64 success_hold",
            **uuid,
        ),
        definition("bool accepted\nbuiltin_interfaces/Time stamp", **stamp),
    )
    wait = service(
        "get_result",
        f"{move}_GetResult",
        definition("unique_identifier_msgs/UUID goal_id", **uuid),
        definition(
            "int8 status\npendularm_interfaces/MoveToResult result",
            pendularm_interfaces__MoveToResult="string goal_id\nstring outcome\npendularm_interfaces/Target target\n"
            "float64 final_distance",
            **target,
        ),
    )
    info = {"action_msgs__GoalInfo": "unique_identifier_msgs/UUID goal_id\nbuiltin_interfaces/Time stamp", **uuid, **stamp}
    cancel = service(
        "cancel_goal",
        "action_msgs/srv/CancelGoal",
        definition("action_msgs/GoalInfo goal_info", **info),
        definition("int8 return_code\naction_msgs/GoalInfo[] goals_canceling", **info),
    )
    received = []
    ROS2Subscriber(
        f"{place}feedback",
        f"{move}_FeedbackMessage",
        received.append,
        msg_definition=definition(
            "unique_identifier_msgs/UUID goal_id\npendularm_interfaces/MoveToFeedback feedback",
            pendularm_interfaces__MoveToFeedback="string goal_id\npendularm_interfaces/Target target\nfloat64[] positions\n"
            "float64 distance_remaining\nfloat64 elapsed",
            **uuid,
            **target,
        ),
        type_hash=found("feedback", f"{move}_FeedbackMessage"),
        **peer.at,
    )
    states = peer.subscribe(f"{place}status", "action_msgs/msg/GoalStatusArray", qos=LATCHED)
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
    name = "control_msgs/action/FollowJointTrajectory"
    place = "/joint_trajectory_controller/follow_joint_trajectory/_action/"
    hashes = {token[9]: token[11] for token in tokens(session, "SS")}

    def own(kind):
        return JAZZY.generate_msgdef(kind, ros_version=2)[0].split("=" * 80)[0].strip()

    inside = {
        "unique_identifier_msgs__UUID": "uint8[16] uuid",
        "control_msgs__FollowGoal": "trajectory_msgs/JointTrajectory trajectory\n"
        "trajectory_msgs/MultiDOFJointTrajectory multi_dof_trajectory\n"
        "control_msgs/JointTolerance[] path_tolerance\n"
        "control_msgs/JointComponentTolerance[] component_path_tolerance\n"
        "control_msgs/JointTolerance[] goal_tolerance\n"
        "control_msgs/JointComponentTolerance[] component_goal_tolerance\n"
        "builtin_interfaces/Duration goal_time_tolerance",
        "control_msgs__JointTolerance": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration",
        "control_msgs__JointComponentTolerance": "string joint_name\nuint16 component\nfloat64 position\n"
        "float64 velocity\nfloat64 acceleration",
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
        TIME,
        "builtin_interfaces/msg/Duration",
    ]:
        inside[kind.replace("/msg/", "__")] = own(kind)

    received = []
    feedback = definition(
        "unique_identifier_msgs/UUID goal_id\ncontrol_msgs/FollowFeedback feedback",
        control_msgs__FollowFeedback="std_msgs/Header header\nstring[] joint_names\n"
        "trajectory_msgs/JointTrajectoryPoint desired\ntrajectory_msgs/JointTrajectoryPoint actual\n"
        "trajectory_msgs/JointTrajectoryPoint error\nstring[] multi_dof_joint_names\n"
        "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_desired\n"
        "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_actual\n"
        "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_error",
        **inside,
    )
    hashed = next(token[11] for token in tokens(session, "MP") if token[9] == f"{place}feedback".replace("/", "%"))
    options = {"msg_definition": feedback, "type_hash": hashed, **peer.at}
    ROS2Subscriber(f"{place}feedback", f"{name}_FeedbackMessage", received.append, **options)

    def service(part, kind, request, response):
        hashed = hashes[f"{place}{part}".replace("/", "%")]
        return peer.service(f"{place}{part}", f"{name}_{kind}", request, response, hashed)

    uuid, stamp = {"unique_identifier_msgs__UUID": "uint8[16] uuid"}, {"builtin_interfaces__Time": own(TIME)}
    send = service(
        "send_goal",
        "SendGoal",
        definition("unique_identifier_msgs/UUID goal_id\ncontrol_msgs/FollowGoal goal", **inside),
        definition("bool accepted\nbuiltin_interfaces/Time stamp", **stamp),
    )
    wait = service(
        "get_result",
        "GetResult",
        definition("unique_identifier_msgs/UUID goal_id", **uuid),
        definition(
            "int8 status\ncontrol_msgs/FollowResult result",
            control_msgs__FollowResult="int32 error_code\nstring error_string",
        ),
    )
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

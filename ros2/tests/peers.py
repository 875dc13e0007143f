"""Tests the bridge with peers of other projects: peers.py ARM BRIDGE.

The router is eclipse-zenoh, the other ROS 2 nodes are zenoh-ros2-sdk, hashes and definitions are those of rosbags
(Jazzy).
"""

import contextlib
import json
import logging
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy
from peers_actions import test_a_goal_is_sent_as_an_action, test_a_path_is_sent_as_an_action
from peers_stage import (
    BRIDGE,
    DOMAIN,
    JAZZY,
    LATCHED,
    Peer,
    command_line,
    free_port,
    hears_joint_states,
    start_arm,
    start_bridge,
    tokens,
)
from programs import LIMIT, open_session, run, say, start_router, wait_for
from zenoh_ros2_sdk.attachment import Attachment


def list_with(port, kind, expected):
    """The lines of the SDK's list, once it has all of these. Its session may ask before the router knows the graph."""

    def get():
        listed = command_line(port, kind, "list", "-t").splitlines()
        return listed if expected <= set(listed) else None

    return wait_for(f"the {kind}s {expected}", get)


def test_topics_are_listed_with_their_types(port):
    topics = {
        "/joint_states [sensor_msgs/msg/JointState]",
        "/joint_trajectory [trajectory_msgs/msg/JointTrajectory]",
        "/clock [rosgraph_msgs/msg/Clock]",
        "/tf [tf2_msgs/msg/TFMessage]",
        "/tf_static [tf2_msgs/msg/TFMessage]",
        "/diagnostics [diagnostic_msgs/msg/DiagnosticArray]",
        "/robot_description [std_msgs/msg/String]",
        "/rosout [rcl_interfaces/msg/Log]",
        "/ik_trial/status [pendularm_interfaces/msg/TrialStatus]",
    }
    services = {
        "/arm_sim/set_integrator [pendularm_interfaces/srv/SetIntegrator]",
        "/arm_sim/get_parameters [rcl_interfaces/srv/GetParameters]",
        "/rosapi/topics [rosapi_msgs/srv/Topics]",
    }
    return f"{len(list_with(port, 'topic', topics))} topics, {len(list_with(port, 'service', services))} services"


def whole_graph(session):
    """The tokens of topics and services, once those of the last declared action are among them."""

    def get():
        found = [token for kind in ["MP", "MS", "SS"] for token in tokens(session, kind)]
        parts = {token[10].rsplit("_", 2)[-2] for token in found if "::action::" in token[10]}
        return found if {"SendGoal", "GetResult", "FeedbackMessage"} <= parts else None

    return wait_for("the graph with actions", get)


def test_hashes_of_standard_types_are_those_of_jazzy(session):
    checked = set()
    for token in whole_graph(session):
        package, _, name = token[10].partition("::msg::dds_::")
        name = f"{package}/msg/{name.removesuffix('_')}"
        if name in JAZZY.types:
            assert token[11] == JAZZY.hash_rihs01(name), token
            checked.add(name)
    assert len(checked) >= 7, checked
    return ", ".join(sorted(checked))


def test_hashes_are_those_that_ros_2_itself_has(session):
    """Checks every type in the graph, except types of packages that are not on PyPI."""
    if not Path(sys.prefix, "share/rosidl_generator_type_description").is_dir():
        return "SKIPPED: there are no packages of ROS 2 for this Python"
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        subprocess.run([BRIDGE, "--interfaces", folder], check=True, capture_output=True)
        answer = folder / "hashes.json"
        program = Path(__file__).with_name("jazzy.py")
        command = [sys.executable, program, folder / "pendularm_interfaces", answer]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, timeout=LIMIT)
        known = json.loads(answer.read_text())
    found = {}
    for token in whole_graph(session):
        name = token[10].replace("::dds_::", "/").replace("::", "/").removesuffix("_")
        assert found.setdefault(name, token[11]) == token[11], token
    strange = {name.split("/")[0] for name in found.keys() - known.keys()}
    absent = {"actionlib_msgs", "rosapi_msgs", "tf2_msgs", "tf2_web_republisher", "tf2_web_republisher_interfaces"}
    assert strange <= absent, strange
    wrong = {name: (token, known[name]) for name, token in found.items() if known.get(name, token) != token}
    assert not wrong, wrong
    for part in ["SendGoal", "GetResult", "FeedbackMessage"]:
        for action in ["control_msgs/action/FollowJointTrajectory", "pendularm_interfaces/action/MoveTo"]:
            assert f"{action}_{part}" in found, found.keys()
    checked = found.keys() & known.keys()
    ours = [name for name in checked if name.startswith("pendularm_interfaces/")]
    return f"{len(checked)} types have ROS 2's own hashes, {len(ours)} of them in the package that the bridge writes"


def test_joint_states_are_decoded_and_numbered(peer, session):
    attachments = []
    watcher = session.declare_subscriber(
        f"{DOMAIN}/joint_states/**", lambda sample: attachments.append(Attachment.from_bytes(sample.attachment.to_bytes()))
    )
    received = peer.subscribe("/joint_states", "sensor_msgs/msg/JointState")
    wait_for("120 joint states", lambda: len(received) >= 120)
    for state in received:
        assert state.name == ["joint1", "joint2"], state
        assert [len(state.position), len(state.velocity), len(state.effort)] == [2, 2, 2], state
    stamps = [state.header.stamp.sec + state.header.stamp.nanosec * 1e-9 for state in received]
    # After a late tick the next one follows at once, possibly before the arm has taken a step.
    assert stamps == sorted(stamps) and len(set(stamps)) >= 100, stamps
    wait_for("120 attachments", lambda: len(attachments) >= 120)
    watcher.undeclare()
    numbers = [one.sequence_id for one in attachments]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), numbers
    assert len({one.gid for one in attachments}) == 1
    assert all(len(one.gid) == 16 for one in attachments)
    assert all(abs(one.timestamp_ns * 1e-9 - time.time()) < LIMIT for one in attachments)
    return received


def test_a_late_subscriber_gets_the_last_description(peer):
    received = peer.subscribe("/robot_description", "std_msgs/msg/String", qos=LATCHED)
    wait_for("the description", lambda: received)
    assert "<robot" in received[-1].data, received[-1].data[:80]


def test_a_trajectory_moves_the_arm(peer, states):
    enable = peer.service(
        "/pid_controller/enable", "pendularm_interfaces/srv/Enable", "bool data", "bool data\nbool success\nstring message"
    )
    response = enable.call(data=True)
    assert response.data and response.success and not response.message, response
    publisher = peer.publisher("/joint_trajectory", "trajectory_msgs/msg/JointTrajectory")
    of = publisher.session_mgr.store.types
    time_type, duration_type = of["builtin_interfaces/msg/Time"], of["builtin_interfaces/msg/Duration"]
    goal = [0.5, -0.25]
    header = of["std_msgs/msg/Header"](stamp=time_type(sec=0, nanosec=0), frame_id="")
    nothing = numpy.array([], dtype=numpy.float64)
    point = of["trajectory_msgs/msg/JointTrajectoryPoint"](
        positions=numpy.array(goal),
        velocities=nothing,
        accelerations=nothing,
        effort=nothing,
        time_from_start=duration_type(sec=0, nanosec=0),
    )

    def is_there():
        # Published repeatedly, because a publisher's first message may be lost before the router has
        # registered it.
        publisher.publish(header=header, joint_names=["joint1", "joint2"], points=[point])
        # 0.01 rad: the remaining error after some seconds is far smaller.
        return all(abs(a - b) < 0.01 for a, b in zip(states[-1].position, goal))

    wait_for("the arm at the setpoint", is_there)
    return [round(float(one), 3) for one in states[-1].position]


def test_services_answer_and_say_what_is_wrong(peer):
    outcome = "bool success\nstring message"
    method = peer.service(
        "/arm_sim/set_integrator",
        "pendularm_interfaces/srv/SetIntegrator",
        "string method\nfloat64 timestep",
        f"string method\nfloat64 timestep\n{outcome}",
    )
    response = method.call(method="", timestep=0.0)
    assert response.success and response.timestep > 0, response
    before = response.timestep
    response = method.call(method="rk4", timestep=0.0)
    assert (response.method, response.timestep, response.success) == ("rk4", before, True), response
    response = method.call(method="magic", timestep=0.0)
    assert response.method == "rk4" and not response.success and "magic" in response.message, response
    params = peer.service(
        "/arm_sim/set_params",
        "pendularm_interfaces/srv/SetParams",
        "float64 gravity\nfloat64[] masses\nfloat64[] lengths",
        f"float64 gravity\nfloat64[] masses\nfloat64[] lengths\n{outcome}",
    )
    nothing = numpy.array([], dtype=numpy.float64)
    response = params.call(gravity=0.0, masses=nothing, lengths=nothing)
    assert response.success and response.gravity == 9.81 and len(response.masses) == 2, response
    run = peer.service(
        "/arm_sim/integration_step",
        "pendularm_interfaces/srv/IntegrationStep",
        "string function\nfloat64 x0\nfloat64 xdot0\nfloat64 dt\nuint64 steps\nstring integrator",
        f"float64[] times\nfloat64[] positions\nfloat64[] velocities\n{outcome}",
    )
    response = run.call(function="2", x0=0.0, xdot0=0.0, dt=0.5, steps=2, integrator="rk4")
    # 2 t^2 / 2, for which Runge-Kutta is exact.
    assert list(response.positions) == [0.0, 0.25, 1.0], response
    # Its response has no inner type, so the SDK does not fetch a definition.
    types = peer.service(
        "/arm_sim/get_parameter_types", "rcl_interfaces/srv/GetParameterTypes", "string[] names", "uint8[] types"
    )
    response = types.call(names=["gravity", "masses", "nonsense"])
    assert list(response.types) == [3, 8, 0], response
    # A type without a field for the reason: the request fails.
    kind = peer.service("/rosapi/topic_type", "rosapi_msgs/srv/TopicType", "string topic", "string type")
    assert kind.call(topic="/joint_states").type == "sensor_msgs/msg/JointState"


def test_a_service_without_a_place_for_reasons_refuses_with_one(peer, session):
    """The request fails at once, and the client logs the reason."""
    logged = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: logged.append(record.getMessage())
    logger = logging.getLogger("zenoh_ros2_sdk")
    told, logger.handlers = logger.handlers, [handler]
    hashed = next(token[11] for token in tokens(session, "SS") if token[9] == "%rosapi%message_details")
    # The response's fields need not be known, because there is no response.
    kind = ("rosapi_msgs/srv/MessageDetails", "string type", "string nothing", hashed)
    assert peer.service("/rosapi/message_details", *kind).call(type="nonsense/Nothing") is None
    logger.handlers = told
    assert any("type must name a type that this runtime knows" in line for line in logged), logged
    assert not any("timed out" in line for line in logged), logged
    # A truncated request fails too.
    key = f"{DOMAIN}/rosapi/message_details/rosapi_msgs::srv::dds_::MessageDetails_/{hashed}"
    cut = next(iter(session.get(key, payload=b"\0\1\0\0\xff"))).err
    assert cut and cut.payload.to_string(), cut
    return cut.payload.to_string()


def test_the_router_comes_back(port, bridge, router, states):
    router.end()
    bridge.said("lost the router at")
    router = start_router(f"tcp/127.0.0.1:{port}")
    bridge.said("connected to the router at", times=2)
    session = open_session(f"tcp/127.0.0.1:{port}")
    wait_for("the node", lambda: [token for token in tokens(session, "NN") if token[8] == "arm_sim"])
    hears_joint_states(session)
    return router, session


def test_the_arm_comes_back(port, bridge, arm, session):
    arm.end()
    wait_for("an empty graph", lambda: not [token for token in tokens(session) if token[8] == "arm_sim"])
    arm, address = start_arm(port)
    bridge.said("is in domain", times=2)
    hears_joint_states(session)
    return arm, address


def test_another_arm_has_its_namespace(address, port, session):
    left = start_bridge(address, port, "--namespace", "/left")
    left.said("is in domain")
    hears_joint_states(session, "/left")
    both = {("%", "%joint_states"), ("%left", "%left%joint_states")}
    wait_for("both arms", lambda: both <= {(token[7], token[9]) for token in tokens(session, "MP")})
    left.end()


def test_the_bridge_listens_nowhere(bridge):
    """Linux lists two connections, to the arm and to the router, and no listening socket."""
    folder = Path(f"/proc/{bridge.process.pid}")
    if not folder.exists():
        return
    open_files = set()
    for one in (folder / "fd").iterdir():
        # It may have been closed since it was listed.
        with contextlib.suppress(FileNotFoundError):
            open_files.add(os.readlink(one))
    states = []
    for table in ["tcp", "tcp6", "udp", "udp6"]:
        rows = [line.split() for line in (folder / "net" / table).read_text().splitlines()[1:]]
        states += [(table, row[3]) for row in rows if f"socket:[{row[9]}]" in open_files]
    assert states == [("tcp", "01")] * 2, states


def test_an_arm_with_a_token_requires_it(port):
    token = "sixteen-or-more-characters"
    arm, address = start_arm(0, "--token", token)
    without = start_bridge(address, port, "--namespace", "/right")
    say(without.said("no arm at"))
    with_it = start_bridge(address, port, "--namespace", "/right", "--token", token)
    with_it.said("is in domain")
    for one in [without, with_it, arm]:
        one.end()


def main():
    logging.disable(logging.INFO)
    began = time.monotonic()
    port, arm_port = free_port(), free_port()
    bridge = start_bridge(f"127.0.0.1:{arm_port}", port)
    # Neither is running: the three programs may start in any order.
    bridge.said("no arm at")
    bridge.said("no router at")
    router = start_router(f"tcp/127.0.0.1:{port}")
    arm, address = start_arm(arm_port)
    say(bridge.said("is in domain"))
    session = open_session(f"tcp/127.0.0.1:{port}")
    peer = Peer(port)
    say(test_topics_are_listed_with_their_types(port))
    say(test_hashes_are_those_that_ros_2_itself_has(session))
    say(f"hashes of {test_hashes_of_standard_types_are_those_of_jazzy(session)}")
    test_the_bridge_listens_nowhere(bridge)
    states = test_joint_states_are_decoded_and_numbered(peer, session)
    test_a_late_subscriber_gets_the_last_description(peer)
    say(f"the arm has gone to {test_a_trajectory_moves_the_arm(peer, states)}")
    test_services_answer_and_say_what_is_wrong(peer)
    say(f"refused: {test_a_service_without_a_place_for_reasons_refuses_with_one(peer, session)}")
    say(f"a goal with {test_a_goal_is_sent_as_an_action(peer, session)} messages of feedback")
    say(f"a path with {test_a_path_is_sent_as_an_action(peer, session, states)} messages of feedback")
    router, session = test_the_router_comes_back(port, bridge, router, states)
    arm, address = test_the_arm_comes_back(arm_port, bridge, arm, session)
    test_another_arm_has_its_namespace(address, port, session)
    test_an_arm_with_a_token_requires_it(port)
    for one in [bridge, arm, router]:
        one.end()
    say(f"all is well after {time.monotonic() - began:.0f} s")


run(main)

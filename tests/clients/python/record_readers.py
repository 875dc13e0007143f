"""Records of the built program as tools that nobody here wrote read them: `record_readers.py PROGRAM WHOLE KILLED`.

Makes the two: one record is ended as it should, the other is left by a program that is killed."""

import json
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import roslibpy
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

PATIENCE = 60
JAZZY = get_typestore(Stores.ROS2_JAZZY)

# A record that was ended ends as it begins.
MAGIC = b"\x89MCAP0\r\n"

OWN = {"/recorder/inputs", "/recorder/states", "/recorder/calls"}


def front_to_back(path):
    """The topics of a file without an index, message by message, as far as it goes; it has to end early."""
    received = []
    with path.open("rb") as file:
        reader = NonSeekingReader(file, decoder_factories=[DecoderFactory()])
        try:
            for _, channel, _, _ in reader.iter_decoded_messages(log_time_order=False):
                received.append(channel.topic)
        # In the middle of a number mcap 1.6.0 leaves the word to `struct`.
        except (EndOfFile, struct.error):
            return received
    raise AssertionError(f"{path} is whole")


def record(path, end):
    """A run with a call, a setpoint and a trial on record; `end` is called with its process."""
    program = subprocess.Popen(
        [sys.argv[1], "--bind", "127.0.0.1:0", "--log", "off", "--seed", "7", "--record", path],
        stdout=subprocess.PIPE, text=True)
    try:
        host, port = program.stdout.readline().removeprefix("listening on ").strip().rsplit(":", 1)
        ros = roslibpy.Ros(host, int(port))
        ros.run(timeout=PATIENCE)
        call = lambda name, args: roslibpy.Service(ros, name, "").call(roslibpy.ServiceRequest(args), timeout=PATIENCE)
        call("/pid_controller/enable", {"data": True})
        listed = call("/rosapi/topics_and_raw_types", {})
        for name, text in zip(listed["types"], listed["typedefs_full_text"]):
            for part, fields in get_types_from_msg(text, name).items():
                assert JAZZY.fielddefs.get(part, fields) == fields, part
        setpoints = roslibpy.Topic(ros, "/joint_trajectory", "trajectory_msgs/JointTrajectory")
        setpoints.publish(roslibpy.Message({"points": [{"positions": [0.1, 0.2]}]}))
        time.sleep(0.5)
        call("/ik_trial/start", {})
        time.sleep(2)
        end(program)
        ros.close()
        program.wait(PATIENCE)
    finally:
        program.kill()


def wait_until_it_is_written(path):
    deadline = time.monotonic() + PATIENCE
    while len(received := front_to_back(path)) < 150 or not {"/joint_states", "/diagnostics", *OWN} <= set(received):
        assert time.monotonic() < deadline, "nothing is written before the end"
        time.sleep(0.2)


def end_when_it_is_written(program):
    wait_until_it_is_written(whole)
    program.send_signal(signal.SIGTERM)


def kill_when_it_is_written(program):
    wait_until_it_is_written(killed)
    program.kill()


whole, killed = Path(sys.argv[2]), Path(sys.argv[3])
# The program ends within a second of SIGTERM in any case; if the disk blocks for that long, the record has no summary,
# and the test repeats it.
for _ in range(3):
    whole.unlink(missing_ok=True)
    record(whole, end_when_it_is_written)
    if whole.read_bytes().endswith(MAGIC):
        break
record(killed, kill_when_it_is_written)


def decoded(path):
    """Every message by `mcap` and `mcap-ros2-support`, with the index at the end of the file."""
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary.statistics.message_count > 100, summary.statistics
        metadata = {one.name: one.metadata for one in reader.iter_metadata()}
        messages = [
            (channel.topic, schema.name, message, ros)
            for schema, channel, message, ros in reader.iter_decoded_messages()
        ]
    assert len(messages) == summary.statistics.message_count
    assert metadata["pendularm"]["links"] == "2", metadata
    assert metadata["pendularm"]["seed"] == "7", metadata
    return messages


messages = decoded(whole)
by_topic = {}
for topic, type_name, message, ros in messages:
    by_topic.setdefault(topic, []).append((type_name, message, ros))

type_name, _, state = by_topic["/joint_states"][0]
assert type_name == "sensor_msgs/msg/JointState", type_name
assert list(state.name) == ["joint1", "joint2"], state
assert len(state.position) == len(state.velocity) == len(state.effort) == 2, state
assert {one.name for one in by_topic["/diagnostics"][0][2].status} >= {"arm_sim", "gateway"}
assert by_topic["/joint_trajectory"][0][2].points[0].positions[0] == 0.1
assert OWN <= set(by_topic), set(by_topic)
for topic, entries in by_topic.items():
    assert [one.sequence for _, one, _ in entries] == list(range(1, len(entries) + 1)), topic

assert "begin" in json.loads(by_topic["/recorder/inputs"][0][2].input)
assert json.loads(by_topic["/recorder/calls"][0][2].content) == {"data": True}
print(f"mcap, mcap-ros2-support: {len(messages)} messages on {len(by_topic)} topics")

# rosbags has the types of ROS, and reads this project's types from the file.
with AnyReader([whole], default_typestore=JAZZY) as reader:
    count = 0
    for connection, _, raw in reader.messages():
        message = reader.deserialize(raw, connection.msgtype)
        if connection.topic == "/joint_states":
            assert message.name == ["joint1", "joint2"], message
            assert message.position.dtype == "float64", message
        count += 1
    types = {connection.msgtype for connection in reader.connections}
assert count == len(messages), (count, len(messages))
print(f"rosbags: {count} messages, {len(types)} types")

# A file that was not ended has no index.
received = front_to_back(killed)
assert "/joint_states" in received and OWN <= set(received), set(received)
print(f"mcap on the record of a killed program: {len(received)} messages")

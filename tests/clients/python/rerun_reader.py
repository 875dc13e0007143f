"""Records of the built program as Rerun reads them: `rerun_reader.py WHOLE KILLED`, two files of `record_readers.py`."""

import os
import subprocess
import sys
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

# In CI, Rerun sends no usage data. The variable must be set before the import.
os.environ["CI"] = "true"
from rerun.chunk import McapReader  # noqa: E402

whole, killed = Path(sys.argv[1]), Path(sys.argv[2])
RERUN = Path(sys.executable).with_name("rerun")
FIELDS = ("position", "velocity", "effort")


def rerun(*command):
    """Output of Rerun's own command, which has to succeed."""
    return subprocess.run([RERUN, "mcap", *command], check=True, capture_output=True, text=True, timeout=60).stdout


# Every topic in order on every timeline, the time stamps of ROS included.
statuses = [line.split() for line in rerun("check", "--full", whole).splitlines() if "/" in line and "mcap" not in line]
topics = {words[3] for words in statuses}
assert {"/joint_states", "/tf", "/diagnostics", "/recorder/inputs"} <= topics, topics
assert all(words[0] == "ok" for words in statuses), statuses

plotted = {name: [] for name in FIELDS}
names = set()
paths = set()
for chunk in McapReader(whole).stream():
    paths.add(chunk.entity_path)
    field = chunk.entity_path.removeprefix("/joint_states/")
    if field not in plotted:
        continue
    columns = chunk.to_record_batch()
    if "Scalars:scalars" in columns.schema.names:
        times = columns["message_log_time"].cast("int64").to_pylist()
        plotted[field] += zip(times, columns["Scalars:scalars"].to_pylist(), strict=True)
    if "SeriesLines:names" in columns.schema.names:
        names |= {name for row in columns["SeriesLines:names"].to_pylist() for name in row or ()}

# The plots have what was published, value by value.
with whole.open("rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    published = [
        (one.log_time, state) for _, _, one, state in reader.iter_decoded_messages(topics=["/joint_states"])
    ]
for field in FIELDS:
    expected = [(time, list(getattr(state, field))) for time, state in published]
    assert sorted(plotted[field]) == sorted(expected), field
assert names >= {"joint1", "joint2"}, names
# The arm is drawn from its description.
assert {path for path in paths if "/visual_geometries/link2" in path}, sorted(paths)
print(f"Rerun: {len(statuses)} topics, {len(published)} states plotted")

# A file that was not ended has no index; Rerun makes one.
converted = killed.with_suffix(".rrd")
rerun("convert", "--recover", killed, "-o", converted)
assert converted.stat().st_size > 10_000
print("Rerun: the record of a killed program")

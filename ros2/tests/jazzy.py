"""Type hashes by ROS 2 Jazzy itself: jazzy.py PENDULARM_INTERFACES ANSWER.

The hashes are in its built packages, or its generator computes them from definitions. Both come from
PyPI, as packages `ros-...` (jazzy.txt). The answer is a file with the names of types and their hashes. Standard
output is the generator's.
"""

import json
import sys
import tempfile
from pathlib import Path

from control_msgs import CONTROL_MSGS
from rosidl_adapter import convert_to_idl
from rosidl_generator_type_description import generate_type_hash

SHARE = Path(sys.prefix, "share")


def hashes_in(folder):
    """The hashes of all types described in a folder, by name."""
    descriptions = (json.loads(path.read_text()) for path in folder.rglob("*.json"))
    lists = (one["type_hashes"] for one in descriptions if "type_hashes" in one)
    return {one["type_name"]: one["hash_string"] for types in lists for one in types}


def generate(package, source, scratch):
    """The hashes of a package's types by ROS 2's generator, from the definitions in a folder."""
    output = scratch / package / "output"
    definitions = sorted(path for kind in ["msg", "srv", "action"] for path in source.glob(f"{kind}/*.*"))
    converted = []
    for path in definitions:
        idl = convert_to_idl(source, package, path.relative_to(source), scratch / package)
        converted.append(f"{scratch / package}:{idl.relative_to(scratch / package)}")
    arguments = scratch / f"{package}.json"
    includes = [f"{folder.name}:{folder}" for folder in SHARE.iterdir() if folder.is_dir()]
    asked = {"package_name": package, "output_dir": str(output), "idl_tuples": converted, "include_paths": includes}
    arguments.write_text(json.dumps(asked))
    generate_type_hash(str(arguments))
    return hashes_in(output)


def main(ours, answer, scratch):
    control = scratch / "source"
    for path, text in CONTROL_MSGS.items():
        (control / path).parent.mkdir(parents=True, exist_ok=True)
        (control / path).write_text(text)
    known = {}
    for folder in SHARE.iterdir():
        known.update(hashes_in(folder))
    known.update(generate("control_msgs", control, scratch))
    known.update(generate("pendularm_interfaces", ours, scratch))
    answer.write_text(json.dumps(known))


with tempfile.TemporaryDirectory() as scratch:
    main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]), Path(scratch))

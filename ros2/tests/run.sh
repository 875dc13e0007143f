#!/usr/bin/env bash
# pendularm-ros2 against peers that nobody here wrote: run.sh ARM [BUILD_FOLDER]. Needs cargo, python3 and a network
# the first time. It installs into the build folder.
set -euo pipefail
program=$(realpath "$1")
target=$(realpath -m "${2:-target/ros2}")
cd "$(dirname "$0")/.."
environment=$target/peers

echo "test-ros2: the bridge, and its own tests"
cargo test --quiet --locked --target-dir "$target"
cargo build --quiet --locked --target-dir "$target"
[ -x "$environment/bin/python" ] || python3 -m venv "$environment"
"$environment/bin/pip" install --quiet --disable-pip-version-check --requirement tests/requirements.txt
timeout 300 "$environment/bin/python" tests/peers.py "$program" "$target/debug/pendularm-ros2"

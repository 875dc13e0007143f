#!/usr/bin/env bash
# Tests pendularm-ros2 with peers of other projects: run.sh ARM [BUILD_FOLDER]. It needs cargo, python3 and, the first
# time, a network. It installs into the build folder. BENCH=1 measures instead, with a release build. BENCH=quick only
# checks that the two hosts work.
set -euo pipefail
program=$(realpath "$1")
target=$(realpath -m "${2:-target/ros2}")
cd "$(dirname "$0")/.."
environment=$target/peers

# Python packages of ROS 2 Jazzy. Each lists its dependencies.
has_jazzy() {
    "$environment/bin/python" -c 'import platform, sys
sys.exit(not (platform.machine() == "x86_64" and (3, 11) <= sys.version_info < (3, 14)))'
}

[ -x "$environment/bin/python" ] || python3 -m venv "$environment"
"$environment/bin/pip" install --quiet --disable-pip-version-check --requirement tests/requirements.txt
if [ "${BENCH:-}" = 1 ]; then
    cargo build --quiet --release --locked --target-dir "$target"
    exec timeout 900 "$environment/bin/python" tests/hosts.py "$program" "$target/release/pendularm-ros2" --bench
fi
! has_jazzy || "$environment/bin/pip" install --quiet --disable-pip-version-check --no-deps --requirement tests/jazzy.txt
if [ "${BENCH:-}" = quick ]; then
    cargo build --quiet --locked --target-dir "$target"
    exec timeout 300 "$environment/bin/python" tests/hosts.py "$program" "$target/debug/pendularm-ros2"
fi
echo "test-ros2: the bridge, and its own tests"
cargo test --quiet --locked --target-dir "$target"
cargo build --quiet --locked --target-dir "$target"
timeout 300 "$environment/bin/python" tests/peers.py "$program" "$target/debug/pendularm-ros2"
timeout 300 "$environment/bin/python" tests/hosts.py "$program" "$target/debug/pendularm-ros2"

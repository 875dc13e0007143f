#!/usr/bin/env bash
# `make bench-ros2`: two hosts with a Zenoh router each, and up to 50 subscribers on the far one: bench.sh ARM
# BUILD_FOLDER. It needs root, because the hosts are network namespaces. It takes some minutes. ARGS=--quick takes
# seconds without measuring. KEEP=1 keeps the figures in benches/results/<date>-<processor>/ros2/.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
source "$root/benches/common.sh"
folder=$(results_folder)/ros2
mkdir -p "$folder"
{
    environment "make bench-ros2"
    echo "router:    $(grep eclipse-zenoh "$root/ros2/tests/requirements.txt"), Python; the bridge is a release build"
} | tee "$folder/environment.txt"
BENCH=${quick:+quick}
BENCH=${BENCH:-1} bash "$root/ros2/tests/run.sh" "$1" "$2" | tee "$folder/summary.txt"
[ "${KEEP:-}" != 1 ] || say "kept in benches/results/$(basename "$(dirname "$folder")")/ros2"

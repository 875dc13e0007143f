#!/usr/bin/env bash
# Clients of other projects, unmodified, against the built program: run.sh PROGRAM. Needs a network the first time,
# python3, node (20 or newer) with npm, cargo, and Chromium, which is installed if it is missing and this may be done.
# It installs into folders in here, which git ignores.
set -euo pipefail
program=$(realpath "$1")
cd "$(dirname "$0")"

echo "clients: installing"
[ -x .venv/bin/python ] || python3 -m venv .venv
.venv/bin/pip install --quiet --disable-pip-version-check --requirement python/requirements.txt
(cd node && npm ci --silent --no-audit --no-fund)
cargo build --quiet --locked --manifest-path roslibrust/Cargo.toml
command -v chromium >/dev/null || { apt-get update && apt-get install -y --no-install-recommends chromium; }
export PYTHONDONTWRITEBYTECODE=1

# Runs one client against a runtime of its own, so that none finds what another left.
runtime=
records=
trap '[ -z "$runtime" ] || kill "$runtime" 2>/dev/null || true; rm -rf "$records"' EXIT
against() {
    coproc RUNTIME { exec "$program" --bind 127.0.0.1:0 --log off; }
    runtime=$RUNTIME_PID
    local line
    read -r -t 20 line <&"${RUNTIME[0]}"
    timeout 120 "$@" "${line#listening on }"
    kill "$runtime"
    wait "$runtime" || true
    runtime=
}

for client in roslibpy_client compas_fab_client ros_mcp_client ros3d_client; do
    against .venv/bin/python "python/$client.py"
done
for client in roslib2 roslib1 lichtblick closed_loop; do
    against node "node/$client.mjs"
done
against roslibrust/target/debug/pendularm-client-roslibrust
records=$(mktemp -d)
timeout 300 .venv/bin/python python/record_readers.py "$program" "$records/whole.mcap" "$records/killed.mcap"
timeout 120 node node/mcap_core.mjs "$records/whole.mcap" "$records/killed.mcap"
timeout 120 .venv/bin/python python/rerun_reader.py "$records/whole.mcap" "$records/killed.mcap"

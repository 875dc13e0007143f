#!/usr/bin/env bash
# Clients that nobody here wrote, unmodified, against the built program: run.sh PROGRAM. Needs a network the first time,
# python3, node (20 or newer) with npm, and cargo. What it installs stays in here, in folders that git ignores.
set -euo pipefail
program=$(realpath "$1")
cd "$(dirname "$0")"

echo "clients: installing"
[ -x .venv/bin/python ] || python3 -m venv .venv
.venv/bin/pip install --quiet --disable-pip-version-check --requirement python/requirements.txt
(cd node && npm ci --silent --no-audit --no-fund)
cargo build --quiet --locked --manifest-path roslibrust/Cargo.toml

# Runs one client against a runtime of its own, so that none finds what another left.
runtime=
trap '[ -z "$runtime" ] || kill "$runtime" 2>/dev/null || true' EXIT
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

for client in roslibpy compas_fab; do
    against .venv/bin/python "python/${client}_client.py"
done
for client in roslib2 roslib1 lichtblick; do
    against node "node/$client.mjs"
done
against roslibrust/target/debug/pendularm-client-roslibrust
timeout 300 .venv/bin/python python/record_readers.py "$program"

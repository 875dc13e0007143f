#!/usr/bin/env bash
# `make bench-load`: messages between many clients, through pendularm, redis (pub/sub) and mosquitto, the same in one run.
# At 60 Hz also through bare actors: what any program of actors needs for a delivery.
#
# The servers run on one core in turn, the client on the others. pendularm is the shipped build, or PROGRAM.
#
# All run on free ports of loopback. Each is stopped by its process id, pendularm by the client that starts it.
# redis-server and mosquitto come from Debian's packages. As root they are installed if missing. Takes some
# twenty minutes.
# ARGS=--quick plays each scene for a moment, without bars, and ARGS=--scene=PART those with this in their name; KEEP=1 keeps the figures in
# benches/results/<date>-<processor>/load/.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
source "$root/benches/common.sh"
ship

# Three servers with 250 clients each, and both ends of a connection need a file.
needed_files=1024
[ "$(ulimit -n)" -ge $needed_files ] || ulimit -n $needed_files || fail "$needed_files open files are needed: raise ulimit -n"

scratch=$(mktemp -d)
pids=()
cleanup() {
    local pid
    for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
    wait
    rm -rf "$scratch"
}
trap cleanup EXIT

install_peers
say "building (profile $profile)"
[ -n "${PROGRAM:-}" ] || (cd "$root" && cargo build --profile "$profile" --locked --quiet)
(cd "$benches" && cargo build --profile "$profile" --locked --quiet --no-default-features --features bare --bin load --bin bare)
# With the servers' core, and the process id of the program itself.
program=$scratch/pendularm
echo "#!/bin/sh
exec ${pin[*]} '${PROGRAM:-$built/pendularm}'"' "$@"' >"$program"
chmod 755 "$program"

# Waits until a server listens on port $1. $2 is its expected name.
await() {
    local tries
    for tries in $(seq 600); do
        ! (exec 3<>"/dev/tcp/127.0.0.1/$1") 2>/dev/null || return 0
        sleep 0.1
    done
    cat "$scratch/$2.log" >&2
    fail "$2 does not listen"
}

{ read -r redis_port; read -r mosquitto_port; read -r bare_port; } < <("$built/load" ports)

# Every setting that would drop a message or write one to a disk is off.
"${pin[@]}" redis-server --bind 127.0.0.1 --port "$redis_port" --dir "$scratch" --save '' --appendonly no --maxclients 2000 \
    --client-output-buffer-limit "pubsub 0 0 0" >"$scratch/redis.log" 2>&1 &
redis=$!
pids+=("$redis")
cat >"$scratch/mosquitto.conf" <<CONF
listener $mosquitto_port 127.0.0.1
allow_anonymous true
set_tcp_nodelay true
max_connections -1
max_queued_messages 0
max_queued_bytes 0
persistence false
sys_interval 0
log_type error
CONF
# As root it switches to the user of that name, who must be able to read this for every umask.
chmod 755 "$scratch"
chmod 644 "$scratch/mosquitto.conf"
"${pin[@]}" mosquitto -c "$scratch/mosquitto.conf" >"$scratch/mosquitto.log" 2>&1 &
mosquitto=$!
pids+=("$mosquitto")
"${pin[@]}" "$built/bare" "$bare_port" 2>"$scratch/bare.log" &
bare=$!
pids+=("$bare")
await "$redis_port" redis
await "$mosquitto_port" mosquitto
await "$bare_port" bare

folder=$(results_folder)/load
mkdir -p "$folder"
{
    environment "make bench-load${ARGS:+ ARGS=$ARGS}"
    echo "pinned:    servers by ${pin[*]:-nothing}, client by ${pin_others[*]:-nothing}"
    echo "peers:     $(redis-server --version | sed 's/ sha=.*//'); $(mosquitto -h | sed -n 1p)"
} | tee "$folder/environment.txt"
# shellcheck disable=SC2086 # arguments, several
"${pin_others[@]}" "$built/load" "$program" "redis=127.0.0.1:$redis_port=$redis" \
    "mosquitto=127.0.0.1:$mosquitto_port=$mosquitto" "bare=127.0.0.1:$bare_port=$bare" ${ARGS:-} | tee "$folder/summary.txt"
[ "${KEEP:-}" != 1 ] || say "kept in benches/results/$(basename "$(dirname "$folder")")/load"

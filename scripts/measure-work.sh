#!/usr/bin/env bash
# Counts instructions and allocations of the work that a scene does or omits. It also counts those of the server with
# and without subscribers, the gateway's wake-ups, and the parts that a build without the web feature lacks. It writes
# DIRECTORY/work.csv for `pendularm report --only work`. It needs valgrind, and a minute besides building. usage:
# scripts/measure-work.sh DIRECTORY
set -euo pipefail

out=${1:?usage: scripts/measure-work.sh DIRECTORY}
root=$(cd "$(dirname "$0")/.." && pwd)
command -v valgrind >/dev/null || { echo "measure-work: valgrind is not installed; instruction counts are not measured" >&2; exit 0; }
mkdir -p "$out"
# Functions and symbols are counted by name, which a normal release build does not have.
export CARGO_PROFILE_RELEASE_STRIP=none
target=${CARGO_TARGET_DIR:-$root/target}
scratch=$(mktemp -d)
server=
trap 'if [ -n "$server" ]; then kill "$server" 2>/dev/null || true; fi; rm -rf "$scratch"' EXIT

(cd "$root/benches" && cargo build --release --locked --quiet --bin work --bin estimate --bin allocations)
program=$target/release/pendularm
if grep -q '^web = ' "$root/Cargo.toml"; then
    (cd "$root" && cargo build --release --locked --quiet --no-default-features --features runtime)
    cp "$program" "$scratch/bare"
fi
# Last, so that the remaining program is the complete one.
(cd "$root" && cargo build --release --locked --quiet)

instructions() { # command...: instructions executed
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$@" 2>&1 >/dev/null | awk '/Collected/ { print $NF }'
}

{
    echo "# $("$program" --version | awk '{ print $1, $2 }') on $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)"
    echo "name,value,unit"
} >"$scratch/work.csv"
put() { echo "$1,$2,$3" >>"$scratch/work.csv"; }

count_step() { # name, count, program that takes a count last...: instructions of a step, without the start
    local name=$1 count=$2 once twice
    shift 2
    once=$(instructions "$@" "$count")
    twice=$(instructions "$@" $((2 * count)))
    put "$name" "$(awk "BEGIN { print ($twice - $once) / $count }")" "instructions per step"
}

count=20000
for variant in step-2-{euler,midpoint,verlet,rk4}-free step-2-rk4-{weightless,pd,pi,pid,pushed,weightless-pd} \
    step-3-rk4-{free,weightless,pd,pid} particle-rk4-{constant,cosine}; do
    count_step "$variant" $count "$target/release/work" "$variant"
done
for links in 2 3; do
    count_step "estimate-$links-rk4" 1000 "$target/release/estimate" $links
done

# Instructions of the arm, in a step of the arm and in one of the 1-DOF service.
of_functions() { # pattern, file of callgrind: instructions in functions whose name matches, without what they call
    awk -v pattern="$1" '
        /^c?fn=/ { id = $1; sub(/^c?fn=/, "", id); name = $0; if (sub(/^[^ ]* /, "", name)) names[id] = name; if (/^fn=/) current = names[id]; next }
        /^calls=/ { getline; next }
        /^[0-9+*-]/ { if (current ~ pattern) sum += $2 }
        END { printf "%d", sum }' "$2"
}
calls_of() { # pattern, file of callgrind: calls of functions whose name matches
    awk -v pattern="$1" '
        /^c?fn=/ { id = $1; sub(/^c?fn=/, "", id); name = $0; if (sub(/^[^ ]* /, "", name)) names[id] = name; called = names[id]; next }
        /^calls=/ { calls = $1; sub(/^calls=/, "", calls); if (called ~ pattern) sum += calls }
        END { printf "%d", sum }' "$2"
}
for variant in step-2-rk4-free particle-rk4-constant; do
    valgrind --tool=callgrind --callgrind-out-file="$scratch/functions" "$target/release/work" "$variant" $count >/dev/null 2>&1
    put "arm-in-$variant" "$(awk "BEGIN { print $(of_functions 'Simulation|dynamics|articulated_body|work::step' "$scratch/functions") / $count }")" "instructions per step"
done
grep -q '^arm-in-step-2-rk4-free,0,' "$scratch/work.csv" && { echo "measure-work: the arm's functions have other names now" >&2; exit 1; }

# The output of the counting allocator: "2 links, rk4 PID true 1000000 steps 0 allocations".
"$target/release/allocations" >"$scratch/allocations"
put allocations-in-steps "$(awk '/steps/ { sum += $(NF - 1) } END { print sum }' "$scratch/allocations")" allocations
put steps-counted "$(awk '/steps/ { sum += $(NF - 3) } END { printf "%d", sum }' "$scratch/allocations")" steps
put allocations-per-subscriber "$(awk '/^200 bytes/ { print $3 }' "$scratch/allocations")" "allocations per message"

# The server under callgrind for some seconds of real time. Steps follow the clock, so counts are per second.
seconds=4
serve() { # name, frames to send first, subscribers of /joint_states
    local name=$1 first=$2 clients=$3 topic=/joint_states counts="$scratch/counts" client pids=()
    rm -f "$scratch/address"
    valgrind --tool=callgrind --callgrind-out-file="$counts" "$program" --bind 127.0.0.1:0 --log off >"$scratch/address" 2>"$scratch/log" &
    server=$!
    for _ in $(seq 600); do grep -qs listening "$scratch/address" && break || sleep 0.1; done
    local port
    port=$(sed -n 's/^listening on .*:\([0-9]*\)$/\1/p' "$scratch/address")
    exec 3<>"/dev/tcp/127.0.0.1/$port"
    printf '%s' "$first" >&3
    for ((client = 0; client < clients; client++)); do
        (exec 4<>"/dev/tcp/127.0.0.1/$port"; printf '{"op":"subscribe","topic":"%s"}\n' "$topic" >&4; exec cat <&4 >/dev/null) &
        pids+=($!)
    done
    sleep 1
    callgrind_control --zero "$server" >/dev/null 2>&1
    sleep $seconds
    callgrind_control --dump "$server" >/dev/null 2>&1
    sleep 0.5
    local total
    total=$(awk '/^(summary|totals):/ { print $2; exit }' "$counts".1 2>/dev/null || true)
    local survived=yes
    kill "$server" 2>/dev/null || survived=
    wait "$server" 2>/dev/null || true
    server=
    exec 3>&-
    for client in "${pids[@]}"; do kill "$client" 2>/dev/null || true; wait "$client" 2>/dev/null || true; done
    if [ -z "$survived" ]; then
        # Valgrind 3.19 cannot run programs that read a thread's clock, as a busy server does. Then this count is not
        # measured.
        echo "measure-work: $name: the program fails under Valgrind here" >&2
        rm -f "$counts"*
        return
    fi
    put "$name-encoded" "$(awk "BEGIN { print $(calls_of 'protocol::messages::publish$' "$counts".1) / $seconds }")" "messages per second"
    put "$name-json" "$(awk "BEGIN { printf \"%.0f\", $(of_functions 'serde_json|zmij|protocol::messages::(publish|respelled|message_text)' "$counts".1) / $seconds }")" "instructions per second"
    rm -f "$counts"*
    put "$name" "$(awk "BEGIN { printf \"%.0f\", ${total:-0} / $seconds }")" "instructions per second"
}
if command -v callgrind_control >/dev/null; then
    serve server-running "" 0
    serve server-paused '{"op":"call_service","service":"/arm_sim/pause","args":{"data":true}}
' 0
    serve server-1-subscriber "" 1
    serve server-11-subscribers "" 11
    grep -q '^server-1-subscriber-encoded,0,' "$scratch/work.csv" && { echo "measure-work: the functions that encode have other names now" >&2; exit 1; }
fi

# Timers: the number of wake-ups of the gateway's thread, which runs goals and trials. Nothing else happens there.
wakes() { # name, frames to send first
    rm -f "$scratch/address"
    "$program" --bind 127.0.0.1:0 --log off >"$scratch/address" 2>"$scratch/log" &
    server=$!
    for _ in $(seq 600); do grep -qs listening "$scratch/address" && break || sleep 0.1; done
    local port before after
    port=$(sed -n 's/^listening on .*:\([0-9]*\)$/\1/p' "$scratch/address")
    exec 3<>"/dev/tcp/127.0.0.1/$port"
    printf '%s' "$2" >&3
    sleep 1
    slept() { awk '/^voluntary/ { print $2 }' "/proc/$server/task/$server/status"; }
    before=$(slept)
    sleep $seconds
    after=$(slept)
    kill "$server"; wait "$server" 2>/dev/null || true
    server=
    exec 3>&-
    put "$1" "$(awk "BEGIN { print ($after - $before) / $seconds }")" "wake-ups per second"
}
if [ -r /proc/self/task ]; then
    wakes wakes-idle ""
    wakes wakes-trial '{"op":"subscribe","topic":"/ik_trial/status"}
{"op":"call_service","service":"/ik_trial/start"}
'
fi

if [ -e "$scratch/bare" ]; then
    put program-size-bare "$(stat -c %s "$scratch/bare")" bytes
    for variant in bare whole; do
        binary=$scratch/bare
        [ $variant = bare ] || binary=$program
        put "web-symbols-$variant" "$(nm -C "$binary" 2>/dev/null | grep -ciE 'tungstenite|hyper|websocket' || true)" symbols
    done
fi

put program-size "$(stat -c %s "$program")" bytes
mv "$scratch/work.csv" "$out/work.csv"
echo "measure-work: $out/work.csv"

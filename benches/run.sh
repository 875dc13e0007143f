#!/usr/bin/env bash
# `make bench`: all figures of pendularm itself, one after another, on the shipped build. `make bench-peers` compares
# with others. It ends with a table of figures and bars. ARGS=--quick is a short run for CI. KEEP=1 keeps the output
# with its environment in benches/results/<date>-<processor>/.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
source "$root/benches/common.sh"
ship

say "building pendularm and its benchmarks"
seconds=()
if [ -n "$quick" ]; then
    # Without the echo server, for which Tokio is built anew.
    build --bin idle
    seconds=(1)
else
    (cd "$root" && cargo build --profile "$profile" --locked --quiet)
    build --features echo
fi
program=$built/pendularm
folder=$(results_folder)
environment "make bench" >"$folder/environment.txt"

# The ratio of medians depends on the cores of the servers' threads, so there are several rounds, each with new servers.
roundtrips() {
    local round
    for round in 1 2 3 4 5; do
        echo "round $round"
        "$built/roundtrip" "$program" 8000
    done
}

# Figures beside their bars. A busy machine may cause "missed": see the load.
summary() {
    awk -v folder="$folder" '
        function verdict(name, figure, bar, good) { printf "%-62s %10s   %-18s  %s\n", name, figure, bar, good ? "held" : "MISSED" }
        function past(name) { file = folder "/" name ".txt" } # a part that has run
        BEGIN {
            past("roundtrip"); least = 1e9
            while ((getline line < file) > 0) if (split(line, x, " ") && line ~ /^ratio of medians/) {
                all = all " " x[4]; if (x[4] < least) least = x[4] }
            verdict("call / bare echo, least of rounds (" substr(all, 2) ")", least, "at most 1.5", least <= 1.5)
            past("idle")
            while ((getline line < file) > 0) { split(line, x, " ")
                if (line ~ /^idle/) verdict("idle, % of one core", x[4], "under 0.3", x[4] < 0.3)
                if (line ~ /^resident/) verdict("resident, MB", x[2], "under 10", x[2] < 10)
                if (line ~ /^sim time/) verdict("simulation time / wall time", x[6], "within 0.001 of 1", x[6] > 0.999 && x[6] < 1.001) }
            past("allocations")
            while ((getline line < file) > 0) { split(line, x, " ")
                if (line ~ / steps /) steps += x[n = split(line, x, " ") - 1]
                if (line ~ / bytes: /) verdict("allocations per delivered message of " x[1], x[3], "at most 2", x[3] <= 2) }
            verdict("allocations in 16 million physics steps", steps + 0, "0", steps == 0)
        }'
}

part() {
    local name=$1
    shift
    printf '\n=== %s\n' "$name"
    "$@" | tee "$folder/$name.txt"
}

{
    cat "$folder/environment.txt"
    [ -n "$quick" ] || part roundtrip roundtrips
    part idle "$built/idle" "$program" "${seconds[@]}"
    [ -n "$quick" ] || part allocations "$built/allocations"
    [ -n "$quick" ] || part summary summary
}
[ "${KEEP:-}" != 1 ] || say "kept in benches/results/$(basename "$folder")"

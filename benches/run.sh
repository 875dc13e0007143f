#!/usr/bin/env bash
# `make bench`: every figure of our own, one after another, on the release build. `make bench-peers` compares with others.
# Ends in a table of figures and bars. ARGS=--quick is a short pass for CI. KEEP=1 keeps the output, with what it hangs on, in benches/results/<date>-<processor>/.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
source "$root/benches/common.sh"

# Instructions per call: exact on a given compiler, whatever else the machine does.
instructions() {
    command -v valgrind >/dev/null || { echo "valgrind is not installed: no instruction counts"; return; }
    echo "instructions per call, gravity 9.81"
    printf '%-10s %8s %8s\n' "" "2 links" "3 links"
    local what links count
    for what in forward euler midpoint verlet rk4; do
        printf '%-10s' "$what"
        for links in 2 3; do
            count=$(valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect=dynamics::counted \
                "$built/dynamics" count "$links" 9.81 "$what" 2>&1 | sed -n 's/.*Collected : \([0-9]*\).*/\1/p')
            [ -n "$count" ] || fail "callgrind counted nothing for $what"
            printf ' %8s' "$(((count + 500) / 1000))" # of 1000 calls
        done
        echo
    done
}

say "building pendularm and its benchmarks"
seconds=() runs=() words=()
if [ -n "$quick" ]; then
    # Without the echo server, for which Tokio is built anew, and what is counted by Valgrind.
    build --bin dynamics --bin idle --bin fairness --bin arm_thread --bin reading
    seconds=(1) runs=(20) words=(spaces)
else
    (cd "$root" && cargo build --release --locked --quiet)
    build --features echo
fi
program=$built/pendularm
folder=$(results_folder)
environment "make bench" >"$folder/environment.txt"

# The ratio of medians wanders with where the system puts the servers' threads, so several rounds, each with new servers.
roundtrips() {
    local round
    for round in 1 2 3 4 5; do
        echo "round $round"
        "$built/roundtrip" "$program" 8000
    done
}

# Figures next to what they should be. "Missed" may be the machine's doing: see the load, and what fairness measures alone.
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
                if (line ~ /^idle/) verdict("idle, % of one core", x[4], "under 0.5", x[4] < 0.5)
                if (line ~ /^resident/) verdict("resident, MB", x[2], "under 15", x[2] < 15)
                if (line ~ /^sim time/) verdict("simulation time / wall time", x[6], "within 0.001 of 1", x[6] > 0.999 && x[6] < 1.001) }
            past("fairness")
            while ((getline line < file) > 0) if (line ~ /^a client computes/) { n = split(line, x, " ")
                what = line; sub(/ later than.*/, "", what)
                verdict(what ", longest delay, ms", x[n - 1], "at most 5", x[n - 1] <= 5) }
            past("arm_thread"); longest = 0
            while ((getline line < file) > 0) if (match(line, /bytes +[0-9.]+ us/)) { n = split(substr(line, RSTART), x, " ")
                if (x[2] > longest) longest = x[2] }
            verdict("the arm\047s thread, held up by 4 MB of a client, microseconds", longest, "under 100", longest > 0 && longest < 100)
            past("allocations")
            while ((getline line < file) > 0) { split(line, x, " ")
                if (line ~ / steps /) steps += x[n = split(line, x, " ") - 1]
                if (line ~ / bytes: /) verdict("allocations per delivered message of " x[1], x[3], "at most 2", x[3] <= 2) }
            verdict("allocations in 16 million physics steps", steps + 0, "0", steps == 0)
            past("reading"); slowest = 1e9
            while ((getline line < file) > 0) if (match(line, /[0-9]+ MB\/s/)) { rate = substr(line, RSTART) + 0; if (rate < slowest) slowest = rate }
            verdict("reading the nastiest of inputs, MB/s", slowest, "at least 200", slowest >= 200)
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
    part dynamics pinned "$built/dynamics" "${runs[@]}"
    [ -n "$quick" ] || { part instructions instructions; part roundtrip roundtrips; }
    part idle "$built/idle" "$program" "${seconds[@]}"
    part fairness "$built/fairness" "$program" "${seconds[@]}"
    part arm_thread "$built/arm_thread"
    [ -n "$quick" ] || part allocations "$built/allocations"
    part reading pinned "$built/reading" "${words[@]}"
    [ -n "$quick" ] || part summary summary
}
[ "${KEEP:-}" != 1 ] || say "kept in benches/results/$(basename "$folder")"

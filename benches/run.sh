#!/usr/bin/env bash
# `make bench`: every figure of our own, one after another, on the release build. `make bench-peers` compares with others.
# KEEP=1 keeps the output, with what it hangs on, in benches/results/<date>-<processor>/.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
source "$root/benches/common.sh"

# The last core, which interrupts visit least; without taskset, wherever the system likes.
core=${CORE:-$(($(getconf _NPROCESSORS_ONLN) - 1))}
pinned() { if command -v taskset >/dev/null; then taskset -c "$core" "$@"; else "$@"; fi; }

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

say "building pendularm and its benchmarks (release)"
(cd "$root" && cargo build --release --locked --quiet)
(cd "$benches" && cargo build --release --locked --quiet)
program=${CARGO_TARGET_DIR:-$root/target}/release/pendularm
folder=$(results_folder)
environment "make bench" >"$folder/environment.txt"

part() {
    local name=$1
    shift
    printf '\n=== %s\n' "$name"
    "$@" 2>&1 | tee "$folder/$name.txt"
}

{
    cat "$folder/environment.txt"
    part dynamics pinned "$built/dynamics"
    part instructions instructions
    part roundtrip "$built/roundtrip" "$program"
    part idle "$built/idle" "$program"
    part fairness "$built/fairness" "$program"
    part allocations "$built/allocations"
} | tee "$folder/summary.txt"
[ "${KEEP:-}" != 1 ] || say "kept in benches/results/$(basename "$folder")"

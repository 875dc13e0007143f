#!/usr/bin/env bash
# Compares the instructions of one physics step with the recorded ones in scripts/work-counts.csv. A difference of more
# than 1 % fails. Counts are exact for one compiler. With another one, or without valgrind, nothing is compared, and a
# line reports this. usage: scripts/check-work.sh [--record]
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
recorded=$root/scripts/work-counts.csv
toolchain=$(rustc -vV | awk '/^(release|host):/ { print $2 }' | paste -sd ' ')
command -v valgrind >/dev/null || { echo "check-work: skipped: valgrind is not installed"; exit 0; }
if [ "${1:-}" != --record ] && ! grep -qx "# $toolchain" "$recorded"; then
    echo "check-work: skipped: counts are those of $(sed -n 's/^# //p' "$recorded"), and this is $toolchain"
    exit 0
fi

target=${CARGO_TARGET_DIR:-$root/target}
(cd "$root/benches" && cargo build --release --locked --quiet --bin work)

# The difference between two runs, which excludes the start of the program.
short=5000 long=15000
instructions() { # variant, steps
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$target/release/work" "$1" "$2" 2>&1 >/dev/null | awk '/Collected/ { print $NF }'
}
per_step() { # variant
    local few many
    few=$(instructions "$1" $short)
    many=$(instructions "$1" $long)
    awk "BEGIN { print ($many - $few) / ($long - $short) }"
}

# Only steps of the arm and a constant force, because they do not use the system's sine and cosine, which
# vary.
variants=(step-{2,3}-{euler,midpoint,verlet,rk4}-free step-{2,3}-rk4-{pid,weightless} particle-rk4-constant)
if [ "${1:-}" = --record ]; then
    { echo "# $toolchain"; echo "step,instructions"; for variant in "${variants[@]}"; do echo "$variant,$(per_step "$variant")"; done; } >"$recorded.part"
    mv "$recorded.part" "$recorded"
    echo "check-work: $recorded"
    exit 0
fi

failed=0
while IFS=, read -r variant expected; do
    case $variant in "#"* | step) continue ;; esac
    seen=$(per_step "$variant")
    verdict=$(awk "BEGIN { d = 100 * ($seen / $expected - 1); printf \"%+.2f %%%s\", d, (d > 1 || d < -1) ? \": more than 1 %\" : \"\" }")
    echo "check-work: $variant: $seen instructions, $expected recorded, $verdict"
    case $verdict in *more*) failed=1 ;; esac
done <"$recorded"
[ $failed = 0 ] || { echo "check-work: if the change is intended, record it: scripts/check-work.sh --record" >&2; exit 1; }

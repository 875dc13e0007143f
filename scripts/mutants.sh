#!/usr/bin/env bash
# Makes single small changes to the code of a layer (cargo-mutants), and counts the changes that a test notices.
# Usage: scripts/mutants.sh [math|protocol|actors] [--check] [options of cargo mutants, such as --re pid.rs]
#
# A mutant of math or protocol first meets the layer's quick tests, built without optimising: some seconds each. The
# survivors meet more tests. `actors` is src/actors with src/live, src/services and src/web; its tests take a minute or
# two, so select a part: `--re ':\d*7:\d+: '` has the lines that end in 7. Outcomes are in target/mutants/<layer>.
# `--check` only builds the layer's tests. It fails below 90 %: (caught + timed out) / (all - those that do not compile).
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
bar=90
fail() { echo "mutants: $*" >&2; exit 1; }

layers=(math protocol)
case "${1:-}" in math | protocol | actors) layers=("$1"); shift ;; esac
check=
[ "${1:-}" != --check ] || { check=1; shift; }
[ -n "$check" ] || cargo mutants --version >/dev/null 2>&1 || fail "needs cargo-mutants: cargo install --locked cargo-mutants"

cd "$root"
export PROPTEST_CASES=64 PROPTEST_MAX_SHRINK_ITERS=0

# Tries mutants with these options. `--cargo-arg` selects the tests of builds too, which would have all of the package.
try() {
    local status=0
    cargo mutants --output "$out" --colors never "${files[@]}" --cargo-arg=--locked "$@" || status=$?
    # 2 and 3: some were missed, or timed out.
    case $status in 0 | 2 | 3) ;; *) fail "$layer: cargo mutants ended with status $status" ;; esac
}

low=0
plain=--cargo-arg=--config=profile.dev.package.pendularm.opt-level=0
for layer in "${layers[@]}"; do
    # Skipped tests take long, and have others beside them.
    folders=("$layer") quick=() more=(--test-package pendularm,pendularm-actor-tests --cargo-arg=--package=pendularm-actor-tests)
    case $layer in
        math) more=(--test-package pendularm --no-default-features --features batch --cargo-arg=--test=math)
            quick=("$plain" "${more[@]}" -- -- --skip default_gains --skip the_closed_loop --skip a_lane_has_the_bits
                --skip rounding_errors --skip expression::size --skip every_angle)
            more+=(--cargo-arg=--lib -- -- --skip default_gains) ;;
        protocol) quick=("$plain" "${more[@]}" --cargo-arg={--lib,--test=protocol})
            more=("$plain" "${more[@]}" --cargo-arg=--test=actors -- -- --skip arm_steps --skip kernel::every --skip pacing --skip study) ;;
        actors) folders+=(live services web) more+=(--cargo-arg={--lib,--test=actors,--test=protocol,--test=study,--test=wire}) ;;
    esac
    if [ -n "$check" ]; then
        printf '%s\n' "${quick[@]}" "${more[@]}" | sed -nE 's/^--cargo-arg=(--(package|lib|test))/\1/p' |
            sort -u | xargs cargo test --locked --no-run --package=pendularm
        continue
    fi
    files=() out=target/mutants/$layer
    for folder in "${folders[@]}"; do files+=(--file "src/$folder/**"); done
    rm -rf "$out"
    mkdir -p "$out"
    if [ "${#quick[@]}" != 0 ]; then
        try "$@" "${quick[@]}"
        cat "$out/mutants.out/timeout.txt" >>"$out/mutants.out/caught.txt"
    fi
    try "$@" --iterate "${more[@]}"
    # The first trial's outcomes are in `mutants.out.old`.
    count() { cat "$out"/$1.txt | sort -u | wc -l; }
    noticed=$(count 'mutants.out*/caught') late=$(count mutants.out/timeout) missed=$(count mutants.out/missed)
    echo "mutants: $layer: $((noticed + late)) noticed, $missed missed, $(count 'mutants.out*/unviable') do not compile"
    [ $((100 * (noticed + late))) -ge $((bar * (noticed + late + missed))) ] || low=1
done
[ "$low" = 0 ] || fail "below $bar %"

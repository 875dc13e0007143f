#!/usr/bin/env bash
# Makes single small changes to the code of a layer (cargo-mutants), and counts the changes that a test notices.
# Usage: scripts/mutants.sh [math|protocol|actors] [--check] [options of cargo mutants, such as --re pid.rs]
#
# A mutant of math or protocol first meets the layer's quick tests, built without optimising: some seconds each. The
# survivors are tried again with all tests of the layer. `actors` is src/actors with src/live, src/services and src/web;
# its tests take a minute or two, so select a part: `--re ':\d*7:\d+: '` has the lines that end in 7. Outcomes are in
# target/mutants/<layer>. `--check` only builds the layer's tests. It fails below 90 %: (caught + timed out) / (all -
# those that do not compile).
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
for layer in "${layers[@]}"; do
    folders=("$layer") tests=(--package=pendularm-actor-tests --lib --test="$layer") in=pendularm,pendularm-actor-tests
    case $layer in
        # Without tests that are long without optimising.
        math) tests=(--no-default-features --features=batch --lib --test=math) in=pendularm
            quick=(--test-package pendularm --no-default-features --features batch --cargo-arg=--test=math -- -- --skip default_gains
                --skip the_closed_loop --skip a_lane_has_the_bits --skip rounding_errors --skip expression::size --skip every_angle) ;;
        protocol) tests+=(--test=actors) # has the tests of the outbox over time
            quick=(--test-package pendularm-actor-tests --cargo-arg={--package=pendularm-actor-tests,--test=protocol}) ;;
        actors) folders+=(live services web) tests+=(--test=wire) ;;
    esac
    if [ -n "$check" ]; then cargo test --locked --no-run --package=pendularm "${tests[@]}"; continue; fi
    files=() out=target/mutants/$layer
    for folder in "${folders[@]}"; do files+=(--file "src/$folder/**"); done
    rm -rf "$out"
    mkdir -p "$out"
    [ "$layer" = actors ] || try "$@" --cargo-arg=--config=profile.dev.package.pendularm.opt-level=0 "${quick[@]}"
    # `default_gains` has many long runs.
    try "$@" --iterate --test-package "$in" "${tests[@]/#/--cargo-arg=}" -- -- --skip default_gains
    # The first trial's outcomes are in `mutants.out.old`.
    count() { cat "$out"/$1.txt | sort -u | wc -l; }
    noticed=$(count 'mutants.out*/caught') late=$(count mutants.out/timeout) missed=$(count mutants.out/missed)
    echo "mutants: $layer: $((noticed + late)) noticed, $missed missed, $(count 'mutants.out*/unviable') do not compile"
    [ $((100 * (noticed + late))) -ge $((bar * (noticed + late + missed))) ] || low=1
done
[ "$low" = 0 ] || fail "below $bar %"

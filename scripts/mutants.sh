#!/usr/bin/env bash
# Makes single small changes to the code of a layer (cargo-mutants), and counts the changes that a test notices.
# Usage: scripts/mutants.sh [math|protocol|actors] [--check] [options of cargo mutants, such as --shard 0/20 or --file
# src/math/pid.rs]
#
# `actors` is src/actors with src/live, src/services and src/web. Its tests take minutes for each mutant, so select a
# part: `--shard k/n` is always the same one. `--iterate` skips mutants that an earlier run has caught. Outcomes are in
# target/mutants/<layer>/mutants.out. `--check` only builds the layer's tests. It fails below 90 %: (caught + timed out)
# / (all - those that do not compile).
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
low=0
for layer in "${layers[@]}"; do
    folders=("$layer") tests=(--lib --test "$layer") skipped=()
    case $layer in
        # Tests with many long runs.
        math) skipped=(--skip default_gains) ;;
        actors) folders+=(live services web) tests+=(--test wire) ;;
    esac
    if [ -n "$check" ]; then cargo test --locked --no-run "${tests[@]}"; continue; fi
    files=()
    for folder in "${folders[@]}"; do files+=(--file "src/$folder/**"); done
    out=target/mutants/$layer
    mkdir -p "$out"
    status=0
    # A property test has 64 random cases, without shrinking.
    PROPTEST_CASES=64 PROPTEST_MAX_SHRINK_ITERS=0 cargo mutants --output "$out" --colors never "${files[@]}" "$@" \
        --test-package pendularm,pendularm-actor-tests -- --locked "${tests[@]}" -- "${skipped[@]}" || status=$?
    # 2 and 3: some were missed, or timed out.
    case $status in 0 | 2 | 3) ;; *) fail "$layer: cargo mutants ended with status $status" ;; esac
    count() { wc -l <"$out/mutants.out/$1.txt"; }
    noticed=$(($(count caught) + $(count timeout))) missed=$(count missed)
    echo "mutants: $layer: $noticed noticed, $missed missed, $(count unviable) do not compile"
    [ $((100 * noticed)) -ge $((bar * (noticed + missed))) ] || low=1
done
[ "$low" = 0 ] || fail "below $bar %"

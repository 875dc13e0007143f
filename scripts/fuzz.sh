#!/usr/bin/env bash
# `make fuzz`: builds and runs the fuzz targets. Arguments select targets. It stops at the first failure.
#
# By default it searches for TIME seconds per target (60), guided by coverage, and differs in every run. Interesting
# inputs are kept in the target folder, and the next search continues from them. It needs cargo-fuzz.
#
# With RUNS=n it repeats fixed mutations of the kept seeds: RUNS times the target's share, without guidance by coverage.
# A guided search differs from run to run, because hash tables and processors differ. This repetition executes the same
# inputs on every machine. CI uses it. It needs a C++ compiler, but no cargo-fuzz.
#
# There is no sanitizer, because this code has no unsafe. A sanitizer would also halve the speed and need a nightly
# compiler. Debug assertions and overflow checks are on instead (fuzz/Cargo.toml).
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${TIME:-60}
runs=${RUNS:-}
folder=${CARGO_TARGET_DIR:-target}/fuzz
all="frame op fields cbor http session"

say() { echo "fuzz: $*"; }
fail() { echo "fuzz: $*" >&2; exit 1; }

[[ "$seconds" =~ ^[1-9][0-9]*$ ]] || fail "TIME must be a number of seconds, got '$seconds'"
[[ "$runs" =~ ^([1-9][0-9]*)?$ ]] || fail "RUNS must be a number of executions, got '$runs'"
for target in "$@"; do
    [[ " $all " == *" $target "* ]] || fail "no target '$target': there are $all"
done

say "building"
if [ -n "$runs" ]; then
    # A build without coverage counters, in the tests' profile and folder, where dependencies are already built.
    "${CARGO:-cargo}" build --locked --manifest-path fuzz/Cargo.toml --target-dir "${CARGO_TARGET_DIR:-target}"
    programs=${CARGO_TARGET_DIR:-target}/debug
else
    cargo fuzz --version >/dev/null 2>&1 || fail "cargo-fuzz is missing: cargo install cargo-fuzz --locked"
    cargo fuzz build --sanitizer none --target-dir "$folder/build"
    programs=$folder/build/$(rustc -vV | sed -n 's/^host: //p')/release
fi
mkdir -p "$folder"
table=$folder/table.txt
: >"$table"

# Runs a target with these arguments, and appends to the log.
run() {
    local target=$1 words=json
    shift
    [ "$target" != http ] || words=http
    # No target needs 2 GB.
    "$programs/$target" "$@" -dict="fuzz/dictionaries/$words.dict" -rss_limit_mb=2048 -print_final_stats=1 \
        -artifact_prefix="$folder/failures/$target/" >>"$log" 2>&1
}

# No input may take 20 s; inputs grow quickly from short to long.
search() {
    mkdir -p "$folder/corpus/$1"
    run "$1" "$folder/corpus/$1" "fuzz/seeds/$1" -max_total_time="$seconds" -timeout=20 -len_control=10
}

# Mutates each kept seed separately, in the order of names, because without coverage the fuzzer would use only the
# first one. The targets themselves check the processor time of an input, so wall time is not limited here.
repeat() {
    local seeds seed number=0 each
    mapfile -t seeds < <(LC_ALL=C ls "fuzz/seeds/$1")
    each=$((runs * $(share "$1") / ${#seeds[@]}))
    for seed in "${seeds[@]}"; do
        number=$((number + 1))
        run "$1" -seed_inputs="fuzz/seeds/$1/$seed" -keep_seed=1 -cross_over=0 -seed="$number" -runs="$each" \
            -timeout=600 -len_control=0 || return 1
    done
}

# Executions of a target per unit of RUNS: about five milliseconds each.
share() {
    case $1 in
        session) echo 20 ;;
        http) echo 50 ;;
        *) echo 100 ;;
    esac
}

for target in ${*:-$all}; do
    mkdir -p "$folder/failures/$target"
    log=$folder/$target.log
    : >"$log"
    if [ -n "$runs" ]; then
        say "$target: $((runs * $(share "$target"))) executions"
        how=repeat
    else
        say "$target: $seconds s"
        how=search
    fi
    began=$SECONDS
    if ! "$how" "$target"; then
        grep -a -A 3 'panicked at\|ERROR: libFuzzer' "$log" >&2 || tail -n 20 "$log" >&2
        input=$(sed -n 's/.*Test unit written to //p' "$log")
        cat >&2 <<TEXT
fuzz: $target failed; the log is $log, the input $input
fuzz: see it again:  $programs/$target $input
fuzz: make it small: cargo fuzz tmin --sanitizer none --target-dir $folder/build $target $input
fuzz: then write what it does as a test in tests/, with the input in it as source, and mend the code
TEXT
        exit 1
    fi
    awk -v target="$target" -v took="$((SECONDS - began))" '/^stat::number_of_executed_units:/ { runs += $2 }
        / cov: / { for (i = 1; i < NF; i++) if ($i == "cov:") edges = $(i + 1) }
        END { printf "%-20s %12d %8d %8d\n", target, runs, took, edges }' "$log" >>"$table"
done

say "no failure"
printf '%-20s %12s %8s %8s\n' target executions seconds edges
cat "$table"

#!/usr/bin/env bash
# Builds the fuzz targets and runs each for TIME seconds (60); arguments pick targets. Stops at the first failure.
#
# No sanitizer: our own code has no unsafe in it, which is all that one would look into, and it would cost half of the
# speed and a nightly compiler. Debug assertions and overflow checks are on instead (fuzz/Cargo.toml): they fail where our
# own reasoning does.
#
# What the fuzzer finds interesting is kept in the target folder, and the next run goes on from there.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${TIME:-60}
folder=${CARGO_TARGET_DIR:-target}/fuzz
all="frame series op fields expression inverse_kinematics simulation study outbox cbor http connection websocket runtime"

say() { echo "fuzz: $*"; }
fail() { echo "fuzz: $*" >&2; exit 1; }

[[ "$seconds" =~ ^[1-9][0-9]*$ ]] || fail "TIME must be a number of seconds, got '$seconds'"
cargo fuzz --version >/dev/null 2>&1 || fail "cargo-fuzz is missing: cargo install cargo-fuzz --locked"
for target in "$@"; do
    [[ " $all " == *" $target "* ]] || fail "no target '$target': there are $all"
done

say "building"
cargo fuzz build --sanitizer none --target-dir "$folder/build"
host=$(rustc -vV | sed -n 's/^host: //p')
table=$folder/table.txt
: >"$table"

for target in ${*:-$all}; do
    mkdir -p "$folder/corpus/$target" "$folder/failures/$target"
    log=$folder/$target.log
    case $target in
        inverse_kinematics | simulation | study | outbox) words=() ;;
        expression | http) words=(-dict="fuzz/dictionaries/$target.dict") ;;
        *) words=(-dict="fuzz/dictionaries/json.dict") ;;
    esac
    say "$target: $seconds s"
    # No input may take 20 s; none of these needs 2 GB; inputs grow quickly from short to long.
    if ! "$folder/build/$host/release/$target" "$folder/corpus/$target" "fuzz/seeds/$target" \
        "${words[@]}" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=2048 -len_control=10 \
        -print_final_stats=1 -artifact_prefix="$folder/failures/$target/" >"$log" 2>&1; then
        grep -a -A 3 'panicked at\|ERROR: libFuzzer' "$log" >&2 || tail -n 20 "$log" >&2
        input=$(sed -n 's/.*Test unit written to //p' "$log")
        cat >&2 <<TEXT
fuzz: $target failed; the log is $log, the input $input
fuzz: see it again:  $folder/build/$host/release/$target $input
fuzz: make it small: cargo fuzz tmin --sanitizer none --target-dir $folder/build $target $input
fuzz: then write what it does as a test in tests/, with the input in it as source, and mend the code
TEXT
        exit 1
    fi
    awk -v target="$target" '/^stat::number_of_executed_units:/ { runs = $2 } /^stat::average_exec_per_sec:/ { rate = $2 }
        / cov: / { for (i = 1; i < NF; i++) if ($i == "cov:") edges = $(i + 1) }
        END { printf "%-20s %12d %10d %8d\n", target, runs, rate, edges }' "$log" >>"$table"
done

say "no failure"
printf '%-20s %12s %10s %8s\n' target executions per_s edges
cat "$table"

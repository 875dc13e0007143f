#!/usr/bin/env bash
# `make simulate`: the whole runtime in one thread and in virtual time, driven by seeds. Exit status: 0 if every seed
# passes, 1 for a wrong result, 2 for a panic, 3 for no progress. The first line is the command for the same seeds. The
# last line of a failure is the command that repeats it.
#
# Without FROM the commit's hash selects the first seed, so every commit has new seeds, and everyone has the same ones.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo=${CARGO:-cargo}
if [ -z "${SEED:-}${SEEDS:-}${MINUTES:-}" ]; then
    SEEDS=1000
fi
if [ -z "${FROM:-}" ]; then
    commit=$(git rev-parse --verify HEAD 2>/dev/null) || commit=1
    FROM=$((16#${commit:0:12}))
fi
program=$("$cargo" test --locked --no-run --test simulate --message-format=short 2>&1 |
    sed -n 's/^ *Executable tests.simulate.main.rs (\(.*\))$/\1/p')
if [ -z "$program" ]; then
    exec "$cargo" test --locked --no-run --test simulate
fi
export SEED=${SEED:-} SEEDS=${SEEDS:-} MINUTES=${MINUTES:-} FROM
exec "$program"

#!/usr/bin/env bash
# `make simulate`: the whole runtime in one thread and in virtual time, driven by seeds. Exit status: 0 if every seed holds, 1 if something
# that came is wrong, 2 if something panicked, 3 if something does not end. The first line is the command that plays the same seeds again,
# the last line of a failure the one that repeats it.
#
# Without FROM the seeds begin where the commit's hash says: new ones with every commit, and the same for everybody who has it.
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

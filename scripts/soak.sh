#!/usr/bin/env bash
# `make soak`: mixed clients, most of them badly behaved, against the release program on a free port, for MINUTES (1, fractions too).
# SEED=n makes the same choices again. ALLOCATOR=default leaves the program's allocator alone, which is otherwise told to give freed
# memory back at once, so that a leak shows. The program is a child of the soak and ends with it. Exit status 1 if anything failed.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
source "$root/benches/common.sh"

(cd "$root" && cargo build --release --locked --quiet)
(cd "$benches" && cargo build --release --locked --quiet --bin soak)
environment "make soak MINUTES=${MINUTES:-1}${SEED:+ SEED=$SEED}${ALLOCATOR:+ ALLOCATOR=$ALLOCATOR}"
exec "$built/soak" "${CARGO_TARGET_DIR:-$root/target}/release/pendularm"

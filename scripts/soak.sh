#!/usr/bin/env bash
# `make soak`: attacks picked at random against the release program on a free port, for MINUTES (1, fractions too).
# SEED=n repeats the same choices. ONLY="pings,calls" plays only attacks with these words in their names.
# The program is a child of the soak and ends with it. Exit status 1 if a bar is missed.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
source "$root/benches/common.sh"

(cd "$root" && cargo build --release --locked --quiet)
(cd "$benches" && cargo build --release --locked --quiet --no-default-features --bin soak)
environment "make soak MINUTES=${MINUTES:-1}${SEED:+ SEED=$SEED}${ONLY:+ ONLY=$ONLY}"
exec "$built/soak" "$built/pendularm"

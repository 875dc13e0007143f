#!/usr/bin/env bash
# Checks that the archive builds and starts without a network and without a Cargo cache.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
cd "$root"
archive=${1:-submission.tar.gz}

say() { echo "test-submission: $*"; }
fail() { echo "test-submission: $*" >&2; exit 1; }

work=$(mktemp -d)
. scripts/try-program.sh
finish() {
    stop_program
    rm -rf "$work"
}
trap finish EXIT

# The project's root is the archive's root, and no file is extracted outside.
tar -tzf "$archive" >"$work/entries"
grep -qx 'Makefile' "$work/entries" || fail "Makefile is not a direct member of $archive"
! grep -nE '^\.?/?$|^/|(^|/)\.\.(/|$)|^\./' "$work/entries" || fail "the entries above are not plain relative names"
mkdir "$work/project" "$work/cargo-home"
tar -xzf "$archive" -C "$work/project"

# A namespace without a network, if the system allows one. Cargo is offline in any case.
cut=()
if unshare -n true 2>/dev/null; then
    cut=(unshare -n)
elif unshare -rn true 2>/dev/null; then
    cut=(unshare -rn)
else
    say "note: no network namespace to be had here; relying on Cargo's own offline mode"
fi
unset CARGO_TARGET_DIR CARGO_BUILD_TARGET_DIR CARGO_BUILD_TARGET MAKEFLAGS MAKELEVEL MFLAGS
export CARGO_HOME=$work/cargo-home
cd "$work/project"
say "building with an empty CARGO_HOME and no network (${cut[*]:-offline mode only})"
CARGO_NET_OFFLINE=true "${cut[@]}" make build
"${cut[@]}" cargo build --release --locked --offline
[ ! -e "$CARGO_HOME/registry" ] || fail "Cargo fetched something: $(ls "$CARGO_HOME/registry")"

say "starting the program on a free port"
try_program '{"op":"call_service","service":"/arm_sim/set_params","id":1}' '*"lengths":\[*,*,*\]*"result":true*' \
    env ARM_SIM_BIND=127.0.0.1:0 ARM_SIM_LINKS=3 ./target/release/pendularm
say "ok: $archive builds offline, starts, answers, and ends with status 0"

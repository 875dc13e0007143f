#!/usr/bin/env bash
# Shows that the archive builds and starts where there is no network and no cache of Cargo's: as at an offline grader's.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
cd "$root"
archive=${1:-submission.tar.gz}

say() { echo "test-submission: $*"; }
fail() { echo "test-submission: $*" >&2; exit 1; }

work=$(mktemp -d)
server=
finish() {
    [ -z "$server" ] || kill -KILL "$server" 2>/dev/null || true
    rm -rf "$work"
}
trap finish EXIT

# The project's root is the archive's root, and nothing lands outside.
tar -tzf "$archive" >"$work/entries"
grep -qx 'Makefile' "$work/entries" || fail "Makefile is not a direct member of $archive"
! grep -nE '^\.?/?$|^/|(^|/)\.\.(/|$)|^\./' "$work/entries" || fail "the entries above are not plain relative names"
mkdir "$work/project" "$work/cargo-home"
tar -xzf "$archive" -C "$work/project"

# A namespace without any network, where the system lets us have one. Cargo is told to stay offline in any case.
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
ARM_SIM_BIND=127.0.0.1:0 ARM_SIM_LINKS=3 ./target/release/pendularm >"$work/out" 2>"$work/err" &
server=$!
for _ in $(seq 600); do
    grep -q '^listening on 127\.0\.0\.1:[1-9]' "$work/out" && break
    kill -0 "$server" 2>/dev/null || break
    sleep 0.1
done
grep '^listening on 127\.0\.0\.1:[1-9]' "$work/out" || fail "no listening line within 60 s: $(cat "$work/out" "$work/err")"
port=$(sed -n 's/^listening on .*://p' "$work/out")
exec 3<>"/dev/tcp/127.0.0.1/$port"
echo '{"op":"call_service","service":"/arm_sim/set_params","id":1}' >&3
IFS= read -r -t 60 reply <&3 || fail "no response within 60 s: $(cat "$work/err")"
echo "$reply"
[[ $reply == *'"lengths":['*,*,*']'*'"result":true'* ]] || fail "not the parameters of a 3-link arm"
kill -TERM "$server"
status=0
wait "$server" || status=$?
server=
[ "$status" -eq 0 ] || fail "exit status $status after SIGTERM: $(cat "$work/err")"
say "ok: $archive builds offline, starts, answers, and ends with status 0"

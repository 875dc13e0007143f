#!/usr/bin/env bash
# `make attack`: measures the service of a healthy client of the release program during attacks, one after the other.
#
# Everything runs on free ports of loopback, bounded in time and connections. Started programs are stopped by id. It
# takes about eight minutes. ARGS="--only=pings,step" selects attacks, ARGS=--list lists them. ARGS=--quick takes two
# minutes, has longer limits, and repeats late attacks up to twice. KEEP=1 keeps the table in
# benches/results/<date>-<processor>/attack/. Exit status 1 if a bar is missed.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
source "$root/benches/common.sh"

say "building (release)"
[ -n "${PROGRAM:-}" ] || (cd "$root" && cargo build --release --locked --quiet)
(cd "$benches" && cargo build --release --locked --quiet --no-default-features --bin attack)
case " ${ARGS:-} " in *" --list "*) exec "$built/attack" --list ;; esac

folder=$(results_folder)/attack
mkdir -p "$folder"
environment "make attack${ARGS:+ ARGS=\"$ARGS\"}" | tee "$folder/environment.txt"
status=0
# shellcheck disable=SC2086 # arguments, several
"$built/attack" "${PROGRAM:-$built/pendularm}" ${ARGS:-} | tee "$folder/table.txt" || status=$?
[ "${KEEP:-}" != 1 ] || say "kept in benches/results/$(basename "$(dirname "$folder")")/attack"
exit $status

#!/usr/bin/env bash
# `make attack`: the service of a healthy client of the release program during hostile ones, one attack after the other.
#
# Everything runs on free ports of loopback, bounded in time and connections; what is started is stopped by its id. Some seven minutes.
# ARGS="--only=pings,step" picks attacks, ARGS=--list lists them. ARGS=--quick takes two minutes, is lenient about times
# and plays what is late up to twice more. KEEP=1 keeps the table in benches/results/<date>-<processor>/attack/. Exit status 1 if a bar is missed.
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

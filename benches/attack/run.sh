#!/usr/bin/env bash
# `make attack`: the service of a healthy client of the release program during hostile ones, one attack after the other.
# The same is measured of redis and mosquitto under the attacks that apply to them.
#
# Everything runs on free ports of loopback, bounded in time and connections; what is started is stopped by its id. redis-server and mosquitto
# come from Debian's packages: as root they are installed if missing; where they can't be, ours is attacked alone. Some ten minutes.
# ARGS="--only=pings,step" picks attacks, ARGS=--list lists them, ARGS=--quick takes two minutes, leaves out the other two, is lenient about times
# and plays what is late up to twice more; KEEP=1 keeps the table in benches/results/<date>-<processor>/attack/. Exit status 1 if a bar is missed.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
source "$root/benches/common.sh"

# Both ends of 1,100 connections, and those that return while the last ones end.
needed_files=4096
[ "$(ulimit -n)" -ge $needed_files ] || ulimit -n $needed_files || fail "$needed_files open files are needed: raise ulimit -n"

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

say "building (release)"
[ -n "${PROGRAM:-}" ] || (cd "$root" && cargo build --release --locked --quiet)
(cd "$benches" && cargo build --release --locked --quiet --no-default-features --bin attack)
program=${PROGRAM:-$built/pendularm}

arguments=()
case " ${ARGS:-} " in
    *" --list "*) exec "$built/attack" --list ;;
    *" --quick "*) ;;
    *) if (install_peers); then PATH=$PATH:/usr/sbin; arguments+=(--peers); else say "ours alone"; fi ;;
esac

folder=$(results_folder)/attack
mkdir -p "$folder"
{
    environment "make attack${ARGS:+ ARGS=\"$ARGS\"}"
    [ ${#arguments[@]} -eq 0 ] || echo "peers:     $(redis-server --version | sed 's/ sha=.*//'); $(mosquitto -h | sed -n 1p)"
} | tee "$folder/environment.txt"
status=0
# shellcheck disable=SC2086 # arguments, several
"$built/attack" "$program" "${arguments[@]}" ${ARGS:-} | tee "$folder/table.txt" || status=$?
[ "${KEEP:-}" != 1 ] || say "kept in benches/results/$(basename "$(dirname "$folder")")/attack"
exit $status

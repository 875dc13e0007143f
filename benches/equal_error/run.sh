#!/usr/bin/env bash
# The second half of `make bench-peers`: the price of an error in pendularm, MuJoCo, Pinocchio, scipy, heyoka and the
# crate ode_solvers.
#
# Uses the venv of benches/peers (its run.sh makes it) and adds requirements.txt to it; compiles this folder's programs, then runs
# equal_error.py on one core. KEEP=1 keeps times and table in benches/results/<date>-<processor>/equal-error/.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
source "$root/benches/common.sh"
here=$benches/equal_error
install_wheels "$benches/peers" "$here"

out=$target/equal-error
mkdir -p "$out"
say "compiling"
"${c[@]}" -O3 -march=native "$here/mujoco.c" -o "$out/mujoco" "$mujoco" -lm -Wl,-rpath,"$(dirname "$mujoco")"
# From the headers, with the flags of this machine, Pinocchio is fastest.
if [ ! -e "$out/pinocchio" ] || [ -n "$(find "$here" "$benches/peers" -maxdepth 1 -type f -newer "$out/pinocchio" -print -quit)" ]; then
    "${pinocchio[@]}" -march=native "$here/pinocchio.cpp" -o "$out/pinocchio" -L"$prefix/lib" -lboost_serialization \
        -Wl,-rpath,"$prefix/lib"
fi
# Beside the benches' own, so that what both need is built once.
(cd "$here" && CARGO_TARGET_DIR=$target cargo build --release --locked --quiet)

folder=$(results_folder)/equal-error
rm -rf "$folder"
mkdir -p "$folder"
{
    environment "make bench-peers"
    echo "compilers: $("$cc" --version | head -n 1); $("$cxx" --version | head -n 1)"
    echo "peers:     $(grep -hE '^(libpinocchio|mujoco|scipy|numba|heyoka)' "$benches/peers/requirements.txt" "$here/requirements.txt" | paste -sd ' '); $(cd "$here" && cargo tree --locked --depth 1 --prefix none | grep -E '^ode_solvers' | cut -d' ' -f1,2 | paste -sd ' ')"
    echo
} >"$folder/environment.txt"
{
    cat "$folder/environment.txt"
    pinned "$venv/bin/python" "$here/equal_error.py" "$folder" "$built/pendularm-equal-error" "$out/mujoco" "$out/pinocchio"
} | tee "$folder/summary.txt"
[ "${KEEP:-}" != 1 ] || say "kept in benches/results/$(basename "$(dirname "$folder")")/equal-error"

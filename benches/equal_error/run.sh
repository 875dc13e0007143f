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
venv=$benches/peers/.venv
cc=${CC:-gcc}
cxx=${CXX:-g++}

for tool in python3 "$cc" "$cxx" cargo; do
    command -v "$tool" >/dev/null || fail "$tool is needed"
done
say "installing the peers into benches/peers/.venv"
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
wanted=$(cat "$benches/peers/requirements.txt" "$here/requirements.txt")
if [ "$wanted" != "$(cat "$venv/installed-equal-error.txt" 2>/dev/null)" ]; then
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --only-binary :all: --no-deps \
        -r "$benches/peers/requirements.txt" -r "$here/requirements.txt"
    echo "$wanted" >"$venv/installed-equal-error.txt"
fi
packages=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("platlib"))')
prefix=$packages/cmeel.prefix
mujoco=$(echo "$packages"/mujoco/libmujoco.so.*)
[ -e "$mujoco" ] || fail "the wheel of MuJoCo has no library for this system"

out=$target/equal-error
mkdir -p "$out"
say "compiling"
"$cc" -std=c11 -O3 -march=native -Wall -Wextra -D_POSIX_C_SOURCE=200809L -isystem "$packages/mujoco/include" \
    "$here/mujoco.c" -o "$out/mujoco" "$mujoco" -lm -Wl,-rpath,"$(dirname "$mujoco")"
# The definitions are those of Pinocchio's own CMake files; from the headers, with the flags of this machine, it is fastest.
if [ ! -e "$out/pinocchio" ] || [ -n "$(find "$here" "$benches/peers/rod_arm.hpp" -maxdepth 1 -type f -newer "$out/pinocchio" -print -quit)" ]; then
    "$cxx" -std=c++17 -O3 -march=native -DNDEBUG -w -DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_LIMIT_VECTOR_SIZE=30 \
        -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_FUSION_INVOKE_MAX_ARITY=12 \
        -isystem "$prefix/include" -isystem "$prefix/include/eigen3" \
        "$here/pinocchio.cpp" -o "$out/pinocchio" -L"$prefix/lib" -lboost_serialization -Wl,-rpath,"$prefix/lib"
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

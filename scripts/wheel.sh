#!/usr/bin/env bash
# Builds the Python wheel: wheel.sh PROGRAM. The release program goes in as it is, beside the library; maturin comes
# from PyPI into python/.venv. The wheel is left in python/target/wheels/, alone.
set -euo pipefail
program=$(realpath "$1")
cd "$(dirname "$0")/../python"
root=$PWD
maturin=1.16.0

say() { echo "wheel: $*"; }
fail() { echo "wheel: $*" >&2; exit 1; }

if [ "$(.venv/bin/maturin --version 2>/dev/null)" != "maturin $maturin" ]; then
    say "installing maturin $maturin into python/.venv"
    [ -x .venv/bin/python ] || python3 -m venv .venv
    .venv/bin/pip install --quiet --disable-pip-version-check "maturin==$maturin"
fi

rm -rf target/wheel-data target/wheels
bash ../scripts/install.sh "$program" target/wheel-data/data
mv target/wheel-data/data/bin target/wheel-data/scripts

# On Linux the wheel says which C library it needs at least, and maturin looks at what it builds itself only.
compatibility=()
if [ "$(uname -s)" = Linux ]; then
    command -v objdump >/dev/null || fail "objdump (binutils) is needed"
    glibc=$(objdump -T "$program" | grep -o 'GLIBC_[0-9][0-9.]*' | sort -Vu | tail -n 1)
    glibc=${glibc#GLIBC_}
    compatibility=(--compatibility "manylinux_${glibc//./_}")
fi
.venv/bin/maturin build --quiet --release --locked --out target/wheels "${compatibility[@]}" ${WHEEL_ARGS:-}
wheel=$(echo target/wheels/*.whl)
say "${wheel#"$root"/}: $(wc -c <"$wheel") bytes"

#!/usr/bin/env bash
# Builds the Python wheel: wheel.sh PROGRAM. It contains the release program and the library. maturin comes from
# PyPI into python/.venv. The wheel is the only file in python/target/wheels/.
#
# It also contains the page in one file, where that can be built; PAGE=pendularm.html names one that is already built.
#
# On Linux with PORTABLE=1 the wheel is for every system with a C library of 2012 or later (glibc 2.17). The program
# is the static one. Zig links the library, because it has the symbols of each release. This needs another release
# build.
set -euo pipefail
portable=${PORTABLE:-}
[ -n "$portable" ] || program=$(realpath "$1")
cd "$(dirname "$0")/../python"
root=$PWD
maturin=1.16.0
oldest=2.17

say() { echo "wheel: $*"; }
fail() { echo "wheel: $*" >&2; exit 1; }

python=$(command -v python3 || command -v python)
[ -d .venv ] || "$python" -m venv .venv
tools=$root/.venv/bin
# On Windows the tools are in another folder.
[ -d "$tools" ] || tools=$root/.venv/Scripts
if [ "$("$tools/maturin" --version 2>/dev/null)" != "maturin $maturin" ]; then
    say "installing maturin $maturin into python/.venv"
    "$tools/python" -m pip install --quiet --disable-pip-version-check "maturin==$maturin"
fi
# An empty list is expanded with `+`, because the bash of macOS (3.2) calls it unset.
linker=()
if [ -n "$portable" ]; then
    [ "$(uname -s)" = Linux ] || fail "PORTABLE=1 is for Linux: elsewhere the wheel is as portable without it"
    program=$(bash ../scripts/static.sh)
    # The folder that is searched for Zig.
    export PATH=$tools:$PATH
    target=$(uname -m)-unknown-linux-gnu
    linker=(--zig --target "$target")
fi

rm -rf target/wheel-data target/wheels
bash ../scripts/install.sh "$program" target/wheel-data/data
mv target/wheel-data/data/bin target/wheel-data/scripts
# maturin takes licences from the folder of pyproject.toml.
cp ../LICENSE-MIT ../LICENSE-APACHE .
"$python" ../scripts/notices.py --notices NOTICE-THIRD-PARTY.txt
if [ -n "${PAGE:-}" ]; then
    cp "../$PAGE" package/pendularm/pendularm.html
else
    bash ../scripts/page.sh python/package/pendularm/pendularm.html || say "without the page, which could not be built here"
fi

# On Linux the wheel's name has the required C library, but maturin checks only its own build.
compatibility=()
if [ "$(uname -s)" = Linux ]; then
    command -v objdump >/dev/null || fail "objdump (binutils) is needed"
    # A static program has no symbol table.
    glibc=$({ echo "GLIBC_$oldest"; objdump -T "$program" 2>/dev/null | grep -o 'GLIBC_[0-9][0-9.]*' || true; } | sort -Vu | tail -n 1)
    glibc=${glibc#GLIBC_}
    [ -z "$portable" ] || [ "$glibc" = "$oldest" ] || fail "the program needs glibc $glibc"
    compatibility=(--compatibility "manylinux_${glibc//./_}")
fi
"$tools/maturin" build --quiet --release --locked --out target/wheels ${compatibility[@]+"${compatibility[@]}"} ${linker[@]+"${linker[@]}"} ${WHEEL_ARGS:-}
wheel=$(echo target/wheels/*.whl)
say "${wheel#"$root"/}: $(wc -c <"$wheel") bytes"

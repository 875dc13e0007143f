#!/usr/bin/env bash
# Builds the Python wheel: wheel.sh PROGRAM. The release program goes in as it is, beside the library; maturin comes
# from PyPI into python/.venv. The wheel is left in python/target/wheels/, alone.
#
# On Linux with PORTABLE=1, both are built anew for every system whose C library is of 2012 or later (glibc 2.17): Zig links
# them, which has the symbols of each release, and comes from PyPI too. It takes a release build more.
set -euo pipefail
portable=${PORTABLE:-}
[ -n "$portable" ] || program=$(realpath "$1")
cd "$(dirname "$0")/../python"
root=$PWD
maturin=1.16.0
zigbuild=0.24.0
zig=0.17.0
oldest=2.17

say() { echo "wheel: $*"; }
fail() { echo "wheel: $*" >&2; exit 1; }

if [ "$(.venv/bin/maturin --version 2>/dev/null)" != "maturin $maturin" ]; then
    say "installing maturin $maturin into python/.venv"
    [ -x .venv/bin/python ] || python3 -m venv .venv
    .venv/bin/pip install --quiet --disable-pip-version-check "maturin==$maturin"
fi
linker=()
if [ -n "$portable" ]; then
    [ "$(uname -s)" = Linux ] || fail "PORTABLE=1 is for Linux: elsewhere the wheel is as portable without it"
    if [ "$(.venv/bin/cargo-zigbuild --version 2>/dev/null)" != "cargo-zigbuild $zigbuild" ]; then
        say "installing cargo-zigbuild $zigbuild and Zig $zig into python/.venv"
        .venv/bin/pip install --quiet --disable-pip-version-check "cargo-zigbuild==$zigbuild" "ziglang==$zig"
    fi
    # Where Zig is looked for.
    export PATH=$root/.venv/bin:$PATH
    target=$(uname -m)-unknown-linux-gnu
    say "the program for glibc $oldest: some minutes"
    cargo-zigbuild zigbuild --release --locked --manifest-path ../Cargo.toml --target "$target.$oldest" --target-dir target/portable
    program=$root/target/portable/$target/release/pendularm
    linker=(--zig --target "$target")
fi

rm -rf target/wheel-data target/wheels
bash ../scripts/install.sh "$program" target/wheel-data/data
mv target/wheel-data/data/bin target/wheel-data/scripts
# maturin takes licences from beside pyproject.toml.
cp ../LICENSE-MIT ../LICENSE-APACHE .

# On Linux the wheel says which C library it needs at least, and maturin looks at what it builds itself only.
compatibility=()
if [ "$(uname -s)" = Linux ]; then
    command -v objdump >/dev/null || fail "objdump (binutils) is needed"
    glibc=$({ echo "GLIBC_$oldest"; objdump -T "$program" | grep -o 'GLIBC_[0-9][0-9.]*'; } | sort -Vu | tail -n 1)
    glibc=${glibc#GLIBC_}
    [ -z "$portable" ] || [ "$glibc" = "$oldest" ] || fail "the program needs glibc $glibc"
    compatibility=(--compatibility "manylinux_${glibc//./_}")
fi
.venv/bin/maturin build --quiet --release --locked --out target/wheels "${compatibility[@]}" "${linker[@]}" ${WHEEL_ARGS:-}
wheel=$(echo target/wheels/*.whl)
say "${wheel#"$root"/}: $(wc -c <"$wheel") bytes"

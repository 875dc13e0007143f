#!/usr/bin/env bash
# Builds the shipped program for every Linux on this processor, with any C library. Zig, from PyPI in python/.venv,
# links it against musl. The last line of standard output is the program's path.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
zigbuild=0.24.0
zig=0.17.0
target=$(uname -m)-unknown-linux-musl
tools=$root/python/.venv

say() { echo "static: $*" >&2; }
fail() { say "$*"; exit 1; }

[ "$(uname -s)" = Linux ] || fail "this is for Linux"
if [ "$("$tools/bin/cargo-zigbuild" --version 2>/dev/null)" != "cargo-zigbuild $zigbuild" ]; then
    say "installing cargo-zigbuild $zigbuild and Zig $zig into python/.venv"
    [ -x "$tools/bin/python" ] || python3 -m venv "$tools"
    "$tools/bin/pip" install --quiet --disable-pip-version-check "cargo-zigbuild==$zigbuild" "ziglang==$zig"
fi
libraries=$(rustc --print sysroot)/lib/rustlib/$target
[ -d "$libraries" ] || rustup target add "$target" >&2 || fail "needs Rust's libraries for $target: rustup target add $target"
# The folder that is searched for Zig.
export PATH=$tools/bin:$PATH
# A given allocator library of the system belongs to another C library.
unset JEMALLOC_OVERRIDE
cargo-zigbuild zigbuild --profile dist --locked --target "$target" --target-dir python/target/static >&2
echo "$root/python/target/static/$target/dist/pendularm"

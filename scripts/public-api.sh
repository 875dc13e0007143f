#!/usr/bin/env bash
# Compares the public items of the library (`math`, `study` and the feature `batch`) with the kept list docs/public-api.txt.
# A difference fails, because semantic versioning holds for these items. usage: scripts/public-api.sh [--keep]
#
# Rustdoc's JSON has a format for each compiler. With another compiler than the list's nothing is compared, and a line reports this.
set -euo pipefail
cd "$(dirname "$0")/.."

kept=docs/public-api.txt
cargo=${CARGO:-cargo}
folder=${CARGO_TARGET_DIR:-target}
compiler="# rustc $("${RUSTC:-rustc}" -vV | sed -n 's/^release: //p'), features: batch"
if [ "${1:-}" != --keep ] && [ "$(head -n 1 "$kept")" != "$compiler" ]; then
    echo "public-api: skipped: the list is of $(head -n 1 "$kept" | cut -c3-), and this is ${compiler:2}"
    exit 0
fi

# The variable allows the compiler to write JSON, which only nightly ones do by default.
RUSTC_BOOTSTRAP=1 "$cargo" rustdoc --locked --quiet --lib --no-default-features --features batch --target-dir "$folder/api" -- \
    -Z unstable-options --output-format json
{
    echo "$compiler"
    "$cargo" run --locked --quiet --manifest-path benches/public_api/Cargo.toml --target-dir "$folder/api" -- "$folder/api/doc/pendularm.json"
} >"$folder/api/list.txt"
if [ "${1:-}" = --keep ]; then
    cp "$folder/api/list.txt" "$kept"
    echo "public-api: $(($(wc -l <"$kept") - 1)) items in $kept"
else
    diff "$kept" "$folder/api/list.txt" || {
        echo "public-api: items differ from $kept: mention them in CHANGELOG.md, then make public-api KEEP=1" >&2
        exit 1
    }
    echo "public-api: the $(($(wc -l <"$kept") - 1)) items of $kept"
fi

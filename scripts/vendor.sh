#!/usr/bin/env bash
# Fetches the sources of the locked dependencies into vendor/ and points Cargo at them through .cargo/config.toml.
# Both are ignored by git. To go back to the registry, delete .cargo/config.toml.
# With another folder that has Cargo.toml and Cargo.lock, it does the same there.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
cd "${1:-$root}"
config=.cargo/config.toml
signature='# Written by scripts/vendor.sh.'

fail() { echo "vendor: $*" >&2; exit 1; }

# A user's own settings are not overwritten.
if [ -e "$config" ] && ! grep -qxF "$signature" "$config"; then
    fail "$config exists and was not written by this script: move it away first"
fi

# The copy of Cargo.lock beside the sources shows the lock file that they were fetched for.
if cmp -s Cargo.lock vendor/.Cargo.lock; then
    echo "vendor: vendor/ has the sources of Cargo.lock"
else
    echo "vendor: fetching the sources of the locked dependencies into vendor/"
    rm -rf vendor.new
    trap 'rm -rf vendor.new' EXIT
    cargo vendor --quiet --locked --versioned-dirs vendor.new >/dev/null
    cp Cargo.lock vendor.new/.Cargo.lock
    rm -rf vendor
    mv vendor.new vendor
fi

mkdir -p .cargo
cat >"$config" <<END
$signature
[source.crates-io]
replace-with = "vendored-sources"

[source.vendored-sources]
directory = "vendor"
END
echo "vendor: Cargo builds from vendor/ in $PWD"

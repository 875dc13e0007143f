#!/usr/bin/env bash
# Writes the files of a release to dist/: the program and the wheel for this system, and checksums. On Linux also the
# page in one file, the sources with their dependencies, and a bill of materials. `make dist` builds pendularm.html and
# submission.tar.gz first.
set -euo pipefail
cd "$(dirname "$0")/.."
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
system=$(uname -s | tr '[:upper:]' '[:lower:]' | sed 's/^mingw.*/windows/')-$(uname -m)
name=pendularm-$version-$system

say() { echo "dist: $*"; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
rm -rf dist
mkdir dist

case $system in
linux-*)
    export PORTABLE=1 PAGE=pendularm.html
    program=$(bash scripts/static.sh)
    cp pendularm.html dist/
    # In one folder of its own, as an archive of sources is expected to be.
    mkdir "$work/pendularm-$version"
    tar -xzf submission.tar.gz -C "$work/pendularm-$version"
    tar -czf "dist/pendularm-$version-sources.tar.gz" -C "$work" "pendularm-$version"
    python3 scripts/notices.py --sbom "dist/pendularm-$version.cdx.json"
    ;;
*)
    cargo build --profile dist --locked
    program=${CARGO_TARGET_DIR:-target}/dist/pendularm
    [ -e "$program" ] || program=$program.exe
    ;;
esac

bash scripts/wheel.sh "$program"
cp python/target/wheels/*.whl dist/

bash scripts/install.sh "$program" "$work/$name"
cp LICENSE-MIT LICENSE-APACHE CHANGELOG.md SECURITY.md packaging/README.md packaging/pendularm@.service python/NOTICE-THIRD-PARTY.txt "$work/$name"
# What README.md links to.
cp -R docs course "$work/$name"
mkdir "$work/$name/python"
cp -R python/examples "$work/$name/python"
tar -czf "dist/$name.tar.gz" -C "$work" "$name"

if command -v sha256sum >/dev/null; then sums=(sha256sum); else sums=(shasum -a 256); fi
(cd dist && "${sums[@]}" -- * >"$work/SHA256SUMS" && mv "$work/SHA256SUMS" .)
for file in dist/*; do say "$file: $(wc -c <"$file") bytes"; done

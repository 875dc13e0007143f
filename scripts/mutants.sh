#!/usr/bin/env bash
# Changes src/math, src/protocol, src/actors and src/web one small thing at a time (cargo-mutants) and counts how many changes a test notices: the
# mutation score.
# usage: scripts/mutants.sh [--fresh] [math|protocol|actors] [--sample N] [--near] [--check] [options of cargo mutants, such as --file src/math/pid.rs]
#
# `--sample N` takes N mutants out of all, drawn by their names, so that the same ones come again when other lines have moved theirs.
#
# `actors`, only when it is asked for, is src/actors with src/live, src/services and src/web. The layers below (src/math,
# src/protocol, src/study and so on) are a crate of their own, compiled once. Mutants that their own tests miss are tried again,
# unless --near is given: with the simulation's seeds, and on the wire, against the built program. A mutant that is noticed only
# there is `elsewhere`.
#
# `--check` only lays the layers out and checks that each compiles alone; it needs no cargo-mutants.
#
# The whole project would take minutes per mutant. So a layer is laid out alone, as a crate of its own under
# target/mutants (or MUTANTS_DIR). Its integration tests are modules: one file to compile, incrementally, and one
# program to link and run. It ends at its first failed test. Fewer tests run than in `make test`, which can only lower
# the score. There are no documentation tests, and not the long runs of tests/math/default_gains.rs. A property test
# that takes its number from proptest (256) has 64 random cases.
#
# Outcomes are kept. A later run takes up where the last one ended, and redoes what was missed and what is in a source file that has changed. A test
# that was taken away does not show: --fresh forgets the outcomes.
# Fails below 90 %: (caught + timed out + elsewhere) / (all - those that do not compile).
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
bar=90
# Processor time of one run of a layer's tests, which need about 2, 0.6 and 35 s. A mutant that loops is caught so,
# however busy the machine is.
declare -A cpu_seconds=([math]=10 [protocol]=6 [actors]=150)
base=${MUTANTS_DIR:-$root/target/mutants}
# Each layer builds in its own folder.
unset CARGO_TARGET_DIR RUSTFLAGS

fail() { echo "mutants: $*" >&2; exit 1; }

fresh=0
[ "${1:-}" != --fresh ] || { fresh=1; shift; }
layers=(math protocol)
case "${1:-}" in math | protocol | actors) layers=("$1"); shift ;; esac
sample=
[ "${1:-}" != --sample ] || { sample=$2; shift 2; }
near=0
[ "${1:-}" != --near ] || { near=1; shift; }
check=0
[ "${1:-}" != --check ] || { check=1; shift; }
[ "$check" = 1 ] || cargo mutants --version >/dev/null 2>&1 || fail "needs cargo-mutants: cargo install --locked cargo-mutants"

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

# The actors are compiled again for each mutant; these are not, being a crate of their own that no mutant changes.
below=(command logging math protocol record report study)

# Lays out what the actors are made of, what they are laid together with, and the programs that try the whole.
lay_out_around() { # folder
    local part
    rm -rf "$1"/{below,page,client,fuzz,docs,scripts}
    mkdir -p "$1/below/src" "$1/fuzz" "$1/tmp"
    for part in "${below[@]}"; do cp -R "$root/src/$part" "$1/below/src/"; echo "pub mod $part;"; done >"$1/below/src/lib.rs"
    find "$1/below/src" -name '*.rs' -exec sed -i -E 's/\bpub\(crate\) (mod|fn|const|struct|enum|[a-z_]+:)/pub \1/' {} +
    {
        echo '[package]'; echo 'name = "below"'; grep '^\(edition\|version\)' "$root/Cargo.toml"
        section features; section dependencies
    } >"$1/below/Cargo.toml"
    cp -R "$root"/{page,client,docs,scripts} "$root"/*.md "$1/"
    cp -R "$root/fuzz/src" "$1/fuzz/"
    cp -R "$root"/src/{live,services,web,options,main.rs,plan.rs} "$1/src/"
    cp -R "$root"/tests/{faults,simulate,wire} "$1/tests/"
    printf 'examine_globs = ["src/actors/**", "src/live/**", "src/services/**", "src/web/**"]\n' >"$1/.cargo/mutants.toml"
    # Unit tests don't get it from Cargo.
    printf '[env]\nCARGO_TARGET_TMPDIR = "%s"\n' "$1/tmp" >"$1/.cargo/config.toml"
}

lay_out() { # layer, folder
    local test name
    mkdir -p "$2/.cargo"
    rm -rf "$2/src" "$2/tests" "$2/.cargo/config.toml"
    mkdir "$2/src" "$2/tests"
    # New files, with new times: a mutant that an interrupted run left behind was compiled after the original was written.
    cp -R "$root/src/$1" "$2/src/"
    cp -R "$root/tests/$1" "$root"/tests/{data,support} "$2/tests/"
    cp "$root/Cargo.lock" "$2/"
    if [ "$1" = actors ]; then lay_out_around "$2"; fi
    {
        echo '[package]'; echo 'name = "pendularm"'; grep '^\(edition\|version\|description\)' "$root/Cargo.toml"; echo 'autotests = false'; echo '[workspace]'
        if [ "$1" = actors ]; then
            section features; section dependencies; echo 'below = { path = "below" }'; section dev-dependencies | grep -v pendularm-wasm
            for test in faults simulate wire; do
                echo '[[test]]'; echo "name = \"$test\""; echo "path = \"tests/$test/main.rs\""
                if [ "$test" = simulate ]; then echo 'harness = false'; fi
            done
        else
            # The whole layer, with all features and what they depend on.
            section features | sed -nE 's/^([a-z]+) = .*/\1 = []/p' | sed -e '1i[features]' -e '/^default/d'
            echo 'default = ["batch", "cli", "record", "report", "runtime", "web"]'
            echo '[dependencies]'; dependencies "$1" dependencies | sed 's/, optional = true//'
            echo '[dev-dependencies]'; dependencies "$1" dev-dependencies
        fi
        echo '[profile.dev]'; echo 'debug = false'; echo 'lto = "off"'
        # The actors compute little: the layers that they call are optimised, and the crate below, being a member of the
        # workspace, is not in "*".
        if [ "$1" = actors ]; then echo '[profile.dev.package]'; echo '"*".opt-level = 1'; echo 'below.opt-level = 1'; else echo 'opt-level = 1'; fi
    } >"$2/Cargo.toml"
    {
        echo 'extern crate self as pendularm;'
        if [ "$1" = actors ]; then
            echo "pub use below::{$(IFS=,; echo "${below[*]}")};"
            echo 'pub mod live; pub mod options; pub mod plan; pub mod services; pub mod web;'
        fi
        echo "pub mod $1;"
        echo '#[cfg(test)] mod idle;'
        # Modules that the tests share stand at the root of their crate, under their own names.
        sed -n 's|^#\[path = "../support/\(.*\)\.rs"\]$|#[cfg(test)] #[path = "../tests/support/\1.rs"] mod \1;|p' "$root/tests/$1/main.rs"
        sed -n 's/^mod \([a-z_]*\);$/\1/p' "$root/tests/$1/main.rs" | while read -r name; do
            if [ "$name" = default_gains ] || [ "$name" = kernel ] || [ -e "$root/tests/support/$name.rs" ]; then continue; fi
            # Tests run in the order of their names: unit tests come first, those that take a second last.
            case $name in
                expression | arm_turns | memory | memory_kinds | pacing | recorder | replay | slow | study) order=zz ;;
                *) order=z ;;
            esac
            test="../tests/$1/$name"
            if [ -d "$2/src/$test" ]; then test=$test/mod; fi
            echo "#[cfg(test)] #[path = \"$test.rs\"] mod ${order}_$name;"
            # Other tests call it by the name that it has beside them.
            if grep -rq "crate::$name\b" "$root/tests/$1"; then echo "#[cfg(test)] use ${order}_$name as $name;"; fi
        done
    } >"$2/src/lib.rs"
    cat >"$2/src/idle.rs" <<'RUST'
//! Ends the program when a test waits for what does not come: one that works takes processor time, however busy the machine is.
//! **Invariant:** set before `main`.
use std::time::Duration;
/// No test waits by the wall's clock for more than a few seconds.
const IDLE: Duration = Duration::from_secs(15);
/// Processor time that a program takes in that time at most if it only looks whether it may go on, in hundredths of a second.
const NEXT_TO_NONE: u64 = 20;
#[used]
#[unsafe(link_section = ".init_array")]
static BEFORE_MAIN: extern "C" fn() = watch;
extern "C" fn watch() {
    std::thread::spawn(|| {
        let mut before = None;
        while before.replace(processor_time()).is_none_or(|before| processor_time() > before + NEXT_TO_NONE) {
            std::thread::sleep(IDLE);
        }
        // Past the capture of libtest, which would be lost.
        let _ = std::io::Write::write_all(&mut std::io::stderr(), b"the tests wait for what does not come\n");
        std::process::exit(101);
    });
}
/// Of this process, in hundredths of a second.
fn processor_time() -> u64 {
    let line = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = line.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(11).take(2).filter_map(|ticks| ticks.parse::<u64>().ok()).sum()
}
RUST
    {
        echo "[target.'cfg(unix)']"
        echo 'runner = "./bounded.sh"'
        for linker in mold lld; do
            if command -v "$linker" >/dev/null; then echo "rustflags = [\"-Clink-arg=-fuse-ld=$linker\"]"; break; fi
        done
    } >>"$2/.cargo/config.toml"
    # The first failure ends it: libtest has that under an option that it calls unstable, and proptest would look for a smaller case.
    cat >"$2/bounded.sh" <<SH
#!/bin/sh
ulimit -t ${cpu_seconds[$1]}
ulimit -v 4000000
export RUSTC_BOOTSTRAP=1 PROPTEST_MAX_SHRINK_ITERS=0
# Which crates the project is made of is no question for a layer of it.
exec "\$@" -Zunstable-options --fail-fast --skip no_crate_of_the_web_door_is_built_in
SH
    chmod +x "$2/bounded.sh"
    # A file's version is that of its code: unit tests stand behind it.
    (cd "$2" && find src -name '*.rs' | while read -r file; do
        printf '%s\t%s\n' "$file" "$(sed '/^#\[cfg(test)\]/,$d' "$file" | cksum | tr ' ' -)"
    done) >"$2/versions.tsv"
}

# Adds what the last run found to known.tsv: the file's version, the outcome, the mutant. The last outcome of a mutant counts.
keep_outcomes() { # folder, the word for what was caught
    local outcome
    [ -f "$1/versions.tsv" ] || return 0
    for outcome in caught missed timeout unviable; do
        [ -f "$1/mutants.out/$outcome.txt" ] || continue
        awk -v outcome="${outcome/caught/$2}" 'BEGIN { FS = "\t" } NR == FNR { version[$1] = $2; next }
            { file = $0; sub(/:.*/, "", file); print version[file] "\t" outcome "\t" $0 }' "$1/versions.tsv" "$1/mutants.out/$outcome.txt"
    done >>"$1/known.tsv"
    rm -f "$1"/mutants.out/{caught,missed,timeout,unviable,previously_caught}.txt
    awk -F '\t' '{ line[$1 FS $3] = $0 } END { for (key in line) print line[key] }' "$1/known.tsv" | sort >"$1/known.part"
    mv "$1/known.part" "$1/known.tsv"
}

# Lists the mutants that there are now, each with its outcome, or `open`.
outcomes() { # folder
    (cd "$1" && cargo mutants --list) |
        awk -F '\t' 'FILENAME == ARGV[1] { version[$1] = $2; next } FILENAME == ARGV[2] { known[$1 FS $3] = $2; next }
            { file = $0; sub(/:.*/, "", file); key = version[file] FS $0; print (key in known ? known[key] : "open") "\t" $0 }' \
            "$1/versions.tsv" "$1/known.tsv" -
}

# Of the mutants on standard input, those of the sample: the first ones when they are sorted by a hash of their names.
# Line and column are left out of a name, and equal names are numbered.
sampled() {
    if [ -z "$sample" ]; then cat; return; fi
    awk -F '\t' '{ name = $2; sub(/:[0-9]+:[0-9]+:/, ":", name); print name " " ++alike[name] "\t" $0 }' |
        sort -t $'\t' -k 1,1R --random-source=<(yes) | awk -v sample="$sample" 'NR <= sample' | cut -f 2-
}

# Runs the tests of these targets for the mutants of the sample whose outcome is one of those.
try_mutants() { # layer, folder, outcomes, the word for what is caught, targets, options
    local layer=$1 folder=$2 wanted=$3 caught=$4 targets=$5 status=0
    shift 5
    mkdir -p "$folder/mutants.out"
    outcomes "$folder" >"$folder/outcomes.tsv"
    sampled <"$folder/outcomes.tsv" | grep -P "^($wanted)\t" >"$folder/wanted.tsv" || return 0
    # cargo mutants passes over those that it finds in this file.
    awk -F '\t' 'NR == FNR { wanted[$0]; next } !($0 in wanted) { print $2 }' "$folder/wanted.tsv" "$folder/outcomes.tsv" >"$folder/mutants.out/previously_caught.txt"
    # Its status says that something was missed; the score is ours to judge. A layer whose own tests fail can't be
    # judged.
    (cd "$folder" && cargo mutants --in-place --iterate --timeout 300 "--cargo-arg=$targets" --colors never "$@") || status=$?
    case $status in 0 | 2 | 3) ;; *) fail "$layer: cargo mutants ended with status $status" ;; esac
    keep_outcomes "$folder" "$caught"
}

low=0
for layer in "${layers[@]}"; do
    folder=$base/$layer
    [ "$fresh" = 0 ] || rm -rf "$folder/known.tsv" "$folder/mutants.out"
    keep_outcomes "$folder" caught
    lay_out "$layer" "$folder"
    touch "$folder/known.tsv"
    if [ "$check" = 1 ]; then (cd "$folder" && cargo check --quiet --tests); continue; fi
    PROPTEST_CASES=64 RUST_TEST_THREADS=1 try_mutants "$layer" "$folder" 'open|missed' caught --lib "$@"
    if [ "$layer" = actors ] && [ "$near" = 0 ]; then
        try_mutants "$layer" "$folder" missed elsewhere '--test=*' "$@"
    fi
    outcomes "$folder" | sampled >"$folder/outcomes.tsv"
    grep -P '^(missed|timeout|elsewhere)\t' "$folder/outcomes.tsv" || true
    awk -F '\t' -v layer="$layer" -v bar="$bar" '{ n[$1]++ }
        END {
            noticed = n["caught"] + n["timeout"] + n["elsewhere"]; viable = noticed + n["missed"]
            printf "mutants: %s: %d mutants: %d caught, %d timed out, %d noticed elsewhere, %d do not compile, %d missed, %d not run; score %.1f %%\n",
                layer, NR, n["caught"], n["timeout"], n["elsewhere"], n["unviable"], n["missed"], n["open"], viable ? 100 * noticed / viable : 0
            exit viable == 0 || 100 * noticed < bar * viable
        }' "$folder/outcomes.tsv" || low=1
done
[ "$low" = 0 ] || fail "below $bar %"

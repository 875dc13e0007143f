#!/usr/bin/env bash
# `make bench-peers`: the same 2- and 3-link rod arm in pendularm, Pinocchio, the C that Pinocchio generates for it (with CppADCodeGen), and
# MuJoCo, checked, then timed, in one run.
#
# Installs the peers' headers and libraries from PyPI into benches/peers/.venv, and changes nothing outside it. Compiles
# the programs of this folder against them, and compares all results. Then every program is timed in turn, PASSES
# times, on one core. ARGS=--quick makes one pass without the programs that compile Pinocchio themselves, which takes
# ten minutes. KEEP=1 keeps results and times in benches/results/<date>-<processor>/peers/. Needs python3, gcc and g++
# (or CC, CXX).
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
source "$root/benches/common.sh"
here=$benches/peers
passes=${PASSES:-5}
[ -z "$quick" ] || passes=1
install_wheels "$here"

# Compiles $1 from the source $2 with the rest, unless it is newer than all that is written here.
program() {
    local output=$target/peers/$1 source=$here/$2
    shift 2
    if [ ! -e "$output" ] || [ -n "$(find "$here" -maxdepth 1 -type f -newer "$output" -print -quit)" ]; then
        say "compiling ${output##*/}"
        "$@" "$source" -o "$output" "${libraries[@]}"
    fi
}
mkdir -p "$target/peers"
# With the library there is no -march, because it changes the alignment of Eigen's types, which must be the library's.
libraries=(-L"$prefix/lib" -lpinocchio_default -Wl,-rpath,"$prefix/lib")
program pinocchio-wheel pinocchio.cpp "${pinocchio[@]}" -DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION
libraries=("$mujoco" -Wl,-rpath,"$(dirname "$mujoco")")
program mujoco mujoco.c "${c[@]}" -O3 -march=native
systems=(pendularm "pinocchio wheel" mujoco "mujoco bare")
if [ -z "$quick" ]; then
    systems+=("pinocchio native" "generated plain" "generated native" "generated fast")
    libraries=(-L"$prefix/lib" -lboost_serialization -Wl,-rpath,"$prefix/lib")
    program pinocchio-native pinocchio.cpp "${pinocchio[@]}" -march=native
    # The C that Pinocchio generates, for each number of links. It is compiled for any x86-64 like our program, for this
    # machine, and with Pinocchio's own flags. These let the compiler reorder sums and vectorise sines.
    program generate generate.cpp "${pinocchio[@]}" -O0
    for links in 2 3; do
        forward=$target/peers/forward-$links.h
        "$target/peers/generate" "$links" >"$forward"
        generated() { # name, flags
            local name=$1
            shift
            "${c[@]}" "-DJOINTS=$links" "-DGENERATED=\"$forward\"" "$@" \
                "$here/generated.c" -o "$target/peers/generated-$name-$links" -lm
        }
        generated plain -O3
        generated native -O3 -march=native
        generated fast -Ofast -march=native
    done
fi
say "building ours"
build --bin peers

folder=$(results_folder)/peers
rm -rf "$folder"
mkdir -p "$folder"
cd "$folder"
{
    environment "make bench-peers"
    echo "compilers: $("$cc" --version | head -n 1); $("$cxx" --version | head -n 1)"
    echo "peers:     $(sed -n '/^libpinocchio\|^cmeel-eigen\|^cmeel-cppad\|^mujoco/p' "$here/requirements.txt" | paste -sd ' ')"
    echo "flags:     pendularm: one codegen unit; wheel, generated plain: -O3; native, mujoco: -O3 -march=native; generated fast: -Ofast -march=native; the wheels' libraries as they come"
    echo "passes:    $passes, one pinned core, every program in turn"
} >environment.txt

# Sets `command` to what runs a system, by its name in the tables: $1 name, $2 links, $3 check or time.
system() {
    local states=states-$2.txt
    case $1 in
        pendularm) command=("$built/peers" "$3" "$2" "$states") ;;
        "pinocchio wheel") command=("$target/peers/pinocchio-wheel" "$1" "$2" "$states" "$3") ;;
        "pinocchio native") command=("$target/peers/pinocchio-native" "$1" "$2" "$states" "$3") ;;
        generated*) command=("$target/peers/${1/ /-}-$2" "$1" "$2" "$states" "$3") ;;
        mujoco) command=("$target/peers/mujoco" "$1" "$2" "$states" "$3") ;;
        "mujoco bare") command=("$target/peers/mujoco" "$1" "$2" "$states" "$3" bare) ;;
    esac
}

for links in 2 3; do
    "$built/peers" states "$links" >"states-$links.txt"
    for name in "${systems[@]}"; do
        system "$name" "$links" check
        "${command[@]}" >"check-$links-$name.txt"
    done
done
echo 'system,links,"what",shortest_ns,median_ns' >times.csv
for ((pass = 1; pass <= passes; pass++)); do
    say "pass $pass of $passes, core $core"
    for links in 2 3; do
        for name in "${systems[@]}"; do
            system "$name" "$links" time
            pinned "${command[@]}" >>times.csv
        done
    done
done
{
    cat environment.txt
    echo
    "$built/peers" compare .
} | tee summary.txt
# Kept are times and verdict; the results can be made again, to the bit.
[ "${KEEP:-}" != 1 ] || { rm -f check-*.txt states-*.txt; say "kept in benches/results/$(basename "$(dirname "$folder")")/peers"; }

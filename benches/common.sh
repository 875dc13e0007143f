# Sourced by run.sh, load/run.sh, attack/run.sh, peers/run.sh, equal_error/run.sh and scripts/soak.sh: the folder of
# results, the environment of a measurement, and the programs to compare with. Needs: `root` (this project). Sets:
# `benches`, `target`, `profile`, `built`, `core`, and the commands `pin` and `pin_others`,
# which pin a program to that core and to those before it. A kept run names the processor, never the machine or a path.

benches=$root/benches
target=${CARGO_TARGET_DIR:-$root/target}
profile=release
built=$target/release

# ARGS=--quick is for CI. Its figures have no meaning.
quick=
case " ${ARGS:-} " in *" --quick "*) quick=1 ;; esac

# Measures the shipped build, except for --quick.
ship() { [ -n "$quick" ] || { profile=dist; built=$target/dist; }; }

# Builds our programs, given as --bin NAME: in the profile, or for --quick as the tests are built, with the same features. Sets `built`.
build() {
    if [ -n "$quick" ]; then
        built=$target/debug
        (cd "$root" && cargo build --locked --quiet -p pendularm --test house -p pendularm-benches "$@")
    else
        (cd "$benches" && cargo build --profile "$profile" --locked --quiet "$@")
    fi
}

# The last core, which has the fewest interrupts; without taskset, any core.
core=${CORE:-$(($(getconf _NPROCESSORS_ONLN) - 1))}
pin=() pin_others=()
if command -v taskset >/dev/null; then
    pin=(taskset -c "$core") pin_others=(taskset -c "0-$((core > 0 ? core - 1 : 0))")
fi
pinned() { "${pin[@]}" "$@"; }

say() { echo "bench: $*"; }
fail() { echo "bench: $*" >&2; exit 1; }

# The processor's name, as a file name.
machine() {
    local name
    name=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2>/dev/null | head -n 1)
    [ -n "$name" ] || name=$(uname -m)
    echo "$name-$(getconf _NPROCESSORS_ONLN)-cores" | tr '[:upper:]' '[:lower:]' | tr -cs 'a-z0-9\n' '-'
}

# The folder of this run: a kept one with KEEP=1, otherwise a temporary one.
results_folder() {
    if [ "${KEEP:-}" = 1 ]; then
        mkdir -p "$benches/results/$(date +%F)-$(machine)"
        echo "$benches/results/$(date +%F)-$(machine)"
    else
        mkdir -p "$target/results"
        echo "$target/results"
    fi
}

# Prints the environment of the figures. $1: the given command.
environment() {
    local changed
    # Without kept figures, because new ones may already be written over them.
    changed=$(git -C "$root" status --porcelain --untracked-files=no -- . ':!benches/results' 2>/dev/null || true)
    echo "command:   $1"
    echo "date:      $(date -u +%FT%TZ)"
    echo "commit:    $(git -C "$root" describe --always 2>/dev/null || echo unknown)${changed:+-dirty}"
    echo "processor: $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2>/dev/null | head -n 1), $(getconf _NPROCESSORS_ONLN) cores"
    echo "system:    $(uname -s) $(uname -r | cut -d- -f1)"
    echo "rustc:     $(cd "$root" && rustc --version), $(cd "$root" && rustc -vV | sed -n 's/^host: //p'), no flags beyond the profile $profile"
    echo "load:      $(cut -d' ' -f1-3 /proc/loadavg 2>/dev/null || uptime) (1, 5, 15 minutes, at the start)"
}

# Headers and libraries of arms in C and C++, from wheels in benches/peers/.venv, as the requirements.txt of each given
# folder names them. Sets `venv`, `packages`, `prefix` (where Pinocchio is), `mujoco` (its library), and the compilers'
# commands `cc`, `cxx`, `c` and `pinocchio`.
install_wheels() {
    local tool folder
    venv=$benches/peers/.venv
    cc=${CC:-gcc}
    cxx=${CXX:-g++}
    for tool in python3 "$cc" "$cxx" cargo; do
        command -v "$tool" >/dev/null || fail "$tool is needed"
    done
    say "installing the peers into benches/peers/.venv"
    [ -x "$venv/bin/python" ] || python3 -m venv "$venv"
    for folder in "$@"; do
        cmp -s "$folder/requirements.txt" "$venv/${folder##*/}.txt" && continue
        "$venv/bin/python" -m pip install --quiet --no-compile --disable-pip-version-check --only-binary :all: --no-deps \
            -r "$folder/requirements.txt"
        cp "$folder/requirements.txt" "$venv/${folder##*/}.txt"
    done
    packages=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("platlib"))')
    prefix=$packages/cmeel.prefix
    mujoco=$(echo "$packages"/mujoco/libmujoco.so.*)
    [ -e "$mujoco" ] || fail "the wheel of MuJoCo has no library for this system"
    c=("$cc" -std=c11 -Wall -Wextra -D_POSIX_C_SOURCE=200809L -isystem "$packages/mujoco/include")
    # The definitions are those of Pinocchio's own CMake files.
    pinocchio=("$cxx" -std=c++17 -O3 -DNDEBUG -w -DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_LIMIT_VECTOR_SIZE=30
        -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_FUSION_INVOKE_MAX_ARITY=12
        -isystem "$prefix/include" -isystem "$prefix/include/eigen3")
}

# Redis and mosquitto, from Debian's packages as root. Needs: `scratch` (a folder).
install_peers() {
    local missing=()
    PATH=$PATH:/usr/sbin
    command -v redis-server >/dev/null || missing+=(redis-server)
    command -v mosquitto >/dev/null || missing+=(mosquitto)
    [ ${#missing[@]} -gt 0 ] || return 0
    { [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; } || fail "missing: ${missing[*]}; install Debian's packages of that name"
    say "installing ${missing[*]}"
    # They are used as programs, not as services.
    { apt-get update --quiet=2 && DEBIAN_FRONTEND=noninteractive RUNLEVEL=1 apt-get install --quiet=2 --yes --no-install-recommends "${missing[@]}"; } \
        >"$scratch/apt.log" 2>&1 || { cat "$scratch/apt.log" >&2; fail "apt-get could not install ${missing[*]}"; }
}

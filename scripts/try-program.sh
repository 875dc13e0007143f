# shellcheck shell=bash
# Source this in scripts that test a program. They define `work`, a separate folder, and `fail`, and end with `stop_program`.
server=

stop_program() {
    [ -z "$server" ] || kill -KILL "$server" 2>/dev/null || true
}

# Starts a program that listens on a free port, sends one request, and ends it. Arguments: REQUEST, a pattern for the
# answer, the command.
try_program() {
    local request=$1 pattern=$2 port reply status=0
    shift 2
    "$@" >"$work/out" 2>"$work/err" &
    server=$!
    for _ in $(seq 600); do
        grep -q '^listening on 127\.0\.0\.1:[1-9]' "$work/out" && break
        kill -0 "$server" 2>/dev/null || break
        sleep 0.1
    done
    grep '^listening on 127\.0\.0\.1:[1-9]' "$work/out" || fail "no listening line within 60 s: $(cat "$work/out" "$work/err")"
    port=$(sed -n 's/^listening on .*://p' "$work/out")
    exec 3<>"/dev/tcp/127.0.0.1/$port"
    echo "$request" >&3
    IFS= read -r -t 60 reply <&3 || fail "no response within 60 s: $(cat "$work/err")"
    echo "$reply"
    # shellcheck disable=SC2053 # a pattern
    [[ $reply == $pattern ]] || fail "not the answer that was expected: $pattern"
    kill -TERM "$server"
    wait "$server" || status=$?
    server=
    [ "$status" -eq 0 ] || fail "exit status $status after SIGTERM: $(cat "$work/err")"
}

#!/usr/bin/env bash
# Installs the program and its completions: install.sh PROGRAM PREFIX. Without the feature cli only the program.
set -euo pipefail
program=$1
prefix=$2

mkdir -p "$prefix/bin"
# On Windows a program has an extension.
case $program in *.exe) file=pendularm.exe ;; *) file=pendularm ;; esac
# It makes a new file, because that of a running program cannot be written.
install -m 755 "$program" "$prefix/bin/$file"
"$program" completions --help >/dev/null 2>&1 || exit 0

completions() { # shell, folder, file
    mkdir -p "$prefix/share/$2"
    "$program" completions "$1" >"$prefix/share/$2/$3"
}
completions bash bash-completion/completions pendularm
completions fish fish/vendor_completions.d pendularm.fish
completions zsh zsh/site-functions _pendularm

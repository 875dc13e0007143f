#!/usr/bin/env bash
# Makes `pendularm.html`, the page in one file: the kernel as a WebAssembly module, then the page around it. $1 names the file.
#
# The module needs the standard library for wasm32-unknown-unknown: `rustup target add wasm32-unknown-unknown`. Without
# rustup, Debian's rustc-web, rust-web-src and lld can be used. That compiler is older than required, so unstable
# features are enabled.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo=${CARGO:-cargo}
target=wasm32-unknown-unknown
folder=${CARGO_TARGET_DIR:-target}/page
build=(build --locked --package pendularm-wasm --lib --profile page --target "$target" --target-dir "$folder")

has_target() {
    [ -d "$("${RUSTC:-rustc}" --print sysroot)/lib/rustlib/$target/lib" ]
}

if has_target || { command -v rustup >/dev/null && rustup target add "$target" && has_target; }; then
    "$cargo" "${build[@]}"
elif [ -x /usr/bin/rustc ] && [ -d "$(/usr/bin/rustc --print sysroot)/lib/rustlib/src/rust/library" ] && command -v wasm-ld >/dev/null; then
    echo "page: no $target from rustup; Debian's compiler builds its standard library"
    wrapper=$(mktemp -d)
    trap 'rm -rf "$wrapper"' EXIT
    printf '#!/bin/sh\nexec "$@" -Astable_features "-Zcrate-attr=feature(let_chains,unsigned_is_multiple_of)"\n' >"$wrapper/rustc"
    chmod +x "$wrapper/rustc"
    RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1 RUSTC_WORKSPACE_WRAPPER=$wrapper/rustc CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=wasm-ld \
        "$cargo" "${build[@]}" -Z build-std=std,panic_abort --ignore-rust-version
else
    echo "page: needs the standard library for $target: rustup target add $target, or Debian's rustc-web, rust-web-src and lld" >&2
    exit 1
fi
python3 scripts/notices.py --page "$folder/notices.txt"
python3 scripts/page.py "$folder/$target/page/pendularm_wasm.wasm" "$folder/notices.txt" "${1:-pendularm.html}"

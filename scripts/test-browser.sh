#!/usr/bin/env bash
# Tests the page in headless Chromium (Debian's `chromium`), which is installed if it is missing and if that is
# possible. PENDULARM names a built program; without it one is built. FORM=file tests the page in one file, without a
# program. BROWSER=firefox or webkit does that in Firefox, or in WebKitGTK on a screen in memory, as far as they can.
# Arguments go to the tests: `scripts/test-browser.sh -k trial`. Screenshots are left in the build folder's `browser/`.
set -euo pipefail
cd "$(dirname "$0")/.."

case ${BROWSER:=chromium} in
chromium) packages=(chromium); has() { command -v chromium; } ;;
firefox) packages=(firefox-esr); has() { command -v firefox-esr || command -v firefox; } ;;
webkit) packages=(webkit2gtk-driver xvfb); has() { command -v WebKitWebDriver && command -v Xvfb; } ;;
*) echo "test-browser: BROWSER is chromium, firefox or webkit, not $BROWSER" >&2; exit 1 ;;
esac
export BROWSER
if ! has >/dev/null; then
    echo "test-browser: installing ${packages[*]}"
    apt-get update && apt-get install -y --no-install-recommends "${packages[@]}" || {
        echo "test-browser: $BROWSER cannot be had here, so the page is not tested in it: install ${packages[*]}" >&2
        [ "$BROWSER" != chromium ] # the page must work in that one
        exit
    }
fi

# axe checks the page, with the same version everywhere.
[ -f node_modules/axe-core/axe.min.js ] || npm ci --silent --no-audit --no-fund
target=${CARGO_TARGET_DIR:-target}
[ "$BROWSER" = chromium ] || export FORM=file
if [ "${FORM:-}" = file ]; then
    bash scripts/page.sh
    export RUNS=$target/runs.txt
    "${CARGO:-cargo}" run --locked --quiet --package pendularm-wasm --example runs >"$RUNS"
elif [ -z "${PENDULARM:-}" ]; then
    "${CARGO:-cargo}" build --locked
    export PENDULARM="$target/debug/pendularm"
fi
ARTEFACTS="$target/browser" PYTHONDONTWRITEBYTECODE=1 python3 tests/browser/run.py "$@"
echo "test-browser: screenshots are in $target/browser/"

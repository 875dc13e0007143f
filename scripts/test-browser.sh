#!/usr/bin/env bash
# Tests the page in headless Chromium (Debian's `chromium`), which is installed if it is missing and if that is
# possible. PENDULARM names a built program; without it one is built. FORM=file tests the page in one file, without a
# program. Arguments go to the tests: `scripts/test-browser.sh -k trial`. Screenshots are left in the build folder's
# `browser/`.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! command -v chromium >/dev/null; then
    echo "test-browser: installing chromium"
    apt-get update && apt-get install -y --no-install-recommends chromium || {
        echo "test-browser: no chromium: install it, or put one on the PATH under that name" >&2
        exit 1
    }
fi

# axe checks the page, with the same version everywhere.
[ -f node_modules/axe-core/axe.min.js ] || npm ci --silent --no-audit --no-fund
target=${CARGO_TARGET_DIR:-target}
if [ "${FORM:-}" = file ]; then
    bash scripts/page.sh
elif [ -z "${PENDULARM:-}" ]; then
    "${CARGO:-cargo}" build --locked
    export PENDULARM="$target/debug/pendularm"
fi
ARTEFACTS="$target/browser" PYTHONDONTWRITEBYTECODE=1 python3 tests/browser/run.py "$@"
echo "test-browser: screenshots are in $target/browser/"

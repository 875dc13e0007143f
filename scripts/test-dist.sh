#!/usr/bin/env bash
# Installs and uses each file of dist/ in an empty environment. The program runs in an empty folder as its root, the
# wheel in a fresh virtual environment, and the page in Chromium from disk. `make test-submission` builds the sources
# without a network.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD

say() { echo "test-dist: $*"; }
fail() { echo "test-dist: $*" >&2; exit 1; }

work=$(mktemp -d)
. scripts/try-program.sh
finish() {
    stop_program
    rm -rf "$work"
}
trap finish EXIT

(cd dist && sha256sum --quiet --check SHA256SUMS) || fail "a checksum is wrong"
[ "$(cd dist && ls | grep -vc SHA256SUMS)" = "$(wc -l <dist/SHA256SUMS)" ] || fail "a file has no checksum"

say "the program, where there is no other file"
mkdir "$work/empty"
tar -xzf dist/pendularm-*-"$(uname -s | tr '[:upper:]' '[:lower:]')-$(uname -m)".tar.gz -C "$work"
cp "$work"/pendularm-*/bin/pendularm "$work/empty"
grep -q '^glam ' "$work"/pendularm-*/NOTICE-THIRD-PARTY.txt || fail "no notices"
for link in $(grep -o '](\([^):#]*\)[)#]' "$work"/pendularm-*/README.md | tr -d '()#]'); do
    [ -e "$(echo "$work"/pendularm-*)/$link" ] || fail "README.md links to $link, which the archive lacks"
done
[ "$(tar -tzf dist/pendularm-*-sources.tar.gz | cut -d/ -f1 | sort -u | wc -l)" = 1 ] || fail "the sources are not in one folder"
alone=(chroot "$work/empty")
"${alone[@]}" /pendularm --version 2>/dev/null || alone=(unshare -r chroot "$work/empty")
try_program '{"op":"call_service","service":"/ik/solve","args":{"x":1.2,"y":0.5}}' '*"result":true*' \
    "${alone[@]}" /pendularm --bind 127.0.0.1:0 --log off
[ "$("${alone[@]}" /pendularm conformance --list | grep -c '^method-')" = 8 ] || fail "no rules of conformance"

say "the wheel, in a fresh environment"
python3 -m venv "$work/environment"
"$work/environment/bin/pip" install --quiet --disable-pip-version-check dist/*.whl "cyclonedx-python-lib[json-validation]>=11,<12"
cd "$work"
environment/bin/python - "$root"/dist/*.cdx.json <<'END'
import importlib.metadata, pathlib, sys
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
import pendularm

run = pendularm.rollout(duration=1.0, reference=True)
assert run.error < 1e-6, run.error
files = [file.name for file in importlib.metadata.files("pendularm")]
assert "NOTICE-THIRD-PARTY.txt" in files, files
bill = pathlib.Path(sys.argv[1]).read_text(encoding="utf-8")
assert '"glam"' in bill
wrong = JsonStrictValidator(SchemaVersion.V1_5).validate_str(bill)
assert wrong is None, wrong
END
environment/bin/pendularm --version

say "the page, from disk"
cd "$root"
grep -q '^glam ' dist/pendularm.html || fail "the page has no notices"
FORM=file PAGE=dist/pendularm.html PYTHONDONTWRITEBYTECODE=1 python3 tests/browser/run.py -k sandboxed_frame -k mark_comes_after_the_guess
say "ok"

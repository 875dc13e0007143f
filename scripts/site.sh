#!/usr/bin/env bash
# Writes the files of the public pages: site.sh FOLDER. These are the page in one file as index.html, the lessons as
# HTML, the kept report, and the documentation of the library. It needs python3 and, the first time, a network.
set -euo pipefail
cd "$(dirname "$0")/.."
site=$1
target=${CARGO_TARGET_DIR:-target}

mkdir -p "$site/course" "$site/report"
bash scripts/page.sh "$site/index.html"
# The name in the links of the lessons.
cp "$site/index.html" "$site/pendularm.html"
[ -d "$target/lessons" ] || python3 -m venv "$target/lessons"
"$target/lessons/bin/pip" install --quiet --disable-pip-version-check "nbconvert==7.16.6"
"$target/lessons/bin/jupyter-nbconvert" --to html --output-dir "$site/course" course/*.ipynb
cp docs/report/*.svg docs/report/*.json docs/report/*.csv docs/report/README.md "$site/report/"
"${CARGO:-cargo}" doc --locked --no-deps --no-default-features --features batch,services
cp -R "$target/doc" "$site/api"
for file in index.html course/1-integrators.html report/README.md api/pendularm/index.html; do
    [ -s "$site/$file" ] || { echo "site: no $file" >&2; exit 1; }
done
echo "site: $(find "$site" -type f | wc -l) files, $(du -sk "$site" | cut -f1) kB"

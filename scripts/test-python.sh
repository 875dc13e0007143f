#!/usr/bin/env bash
# Installs the wheel of `make wheel` into a fresh virtual environment, and tests it there. Arguments are passed to
# pytest. With --learning first, it tests only the adapters to stable-baselines3 and Ray, with both installed.
set -euo pipefail
cd "$(dirname "$0")/../python"
wheel=$(realpath target/wheels/*.whl)
environment=target/test-environment

echo "test-python: a fresh environment with $(basename "$wheel")"
rm -rf "$environment"
python3 -m venv "$environment"
"$environment/bin/pip" install --quiet --disable-pip-version-check "$wheel" --requirement tests/requirements.txt
if [ "${1:-}" = --learning ]; then
    shift
    "$environment/bin/pip" install --quiet --disable-pip-version-check stable-baselines3==2.9.2 ray==2.60.0
    set -- tests/test_learning.py "$@"
fi
echo "test-python: the metadata, as PyPI checks it"
"$environment/bin/python" -m twine check --strict "$wheel"
"$environment/bin/python" -m pytest --quiet --durations 5 "$@"

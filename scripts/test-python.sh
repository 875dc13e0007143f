#!/usr/bin/env bash
# Installs the wheel of `make wheel` into a fresh virtual environment, and tests it there. Arguments are passed to
# pytest. With --learning first, it tests only with stable-baselines3, RLlib and Ray, and installs them. --quick
# after it installs neither torch nor Ray, and skips what needs them.
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
    more=(stable-baselines3==2.9.2 'ray[rllib]==2.60.0')
    [ "${1:-}" != --quick ] || { shift; more=(--no-deps stable-baselines3==2.9.2); }
    "$environment/bin/pip" install --quiet --disable-pip-version-check "${more[@]}"
    set -- tests/test_learning.py "$@"
fi
echo "test-python: the metadata, as PyPI checks it"
"$environment/bin/python" -m twine check --strict "$wheel"
"$environment/bin/python" -m pytest --quiet --durations 5 "$@"

#!/bin/sh
# Remakes requirements.lock from pyproject.toml: sh tools/lock.sh PYTHON [--upgrade]
# One set of versions for every Python we support, with the hashes of every platform's files.
set -eu
cd "$(dirname "$0")/.."
[ -x build/uv/bin/uv ] || "$1" -m venv --clear build/uv
build/uv/bin/pip install --quiet --disable-pip-version-check 'uv>=0.7'
shift

# hatchling asks for `editables` when it installs a checkout in place
build_requires='import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"], "editables", sep="\n")'
build/uv/bin/python -c "$build_requires" |
    build/uv/bin/uv pip compile pyproject.toml - --no-config --quiet --all-extras --universal \
        --python-version 3.11 --fork-strategy fewest --generate-hashes --no-annotate \
        --custom-compile-command "make lock" --output-file requirements.lock "$@"
echo "requirements.lock: $(grep -c '==' requirements.lock) packages"

#!/bin/sh
# Makes .venv with the locked packages and this checkout in it: sh tools/setup.sh [PYTHON]
# The system's Python stays as it is. `.venv/ready` says that all is done.
set -eu
cd "$(dirname "$0")/.."
python=${1:-python3}

# Two makes at once: the second waits, and then finds the work done.
mkdir -p build
exec 9>build/setup.lock
flock 9

fresh() {
    for input in pyproject.toml requirements.lock tools/setup.sh tools/system_packages.sh; do
        [ -z "$(find "$input" -newer .venv/ready)" ] || return 1
    done
}
if [ -f .venv/ready ] && fresh; then exit 0; fi
rm -f .venv/ready

version() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null; }
found=$(version "$python") || { echo "magfem needs Python 3.11 or newer, and '$python' does not run: make PYTHON=... names another" >&2; exit 1; }
if ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
    echo "magfem needs Python 3.11 or newer, '$python' is $found: make PYTHON=... names another" >&2
    exit 1
fi

sh tools/system_packages.sh venv "$python"
if [ "$(version .venv/bin/python || true)" != "$found" ] || ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
    echo "making .venv (Python $found)"
    "$python" -m venv --clear .venv
fi

export PIP_DISABLE_PIP_VERSION_CHECK=1
echo "installing the packages of requirements.lock"
.venv/bin/python -m pip install --quiet --no-deps -r requirements.lock
.venv/bin/python -m pip install --quiet --no-deps --no-build-isolation -e .
if ! misfits=$(.venv/bin/python -m pip check); then
    printf '%s\nrequirements.lock does not fit pyproject.toml: make lock\n' "$misfits" >&2
    exit 1
fi

sh tools/system_packages.sh graphics .venv/bin/python
touch .venv/ready

#!/bin/sh
# Makes build/mag_manip, an environment of its own with ETH's mag_manip, which tests hold MPEM files against:
#   sh tools/mag_manip.sh PYTHON
# It needs NumPy 1, and there are wheels for Linux on x86-64 alone; where it cannot be had, those tests are skipped.
set -eu
python=${1:-python3}
home=build/mag_manip

works() { "$home/bin/python" -c 'from mag_manip.mag_manip import ForwardModelMPEM' >/dev/null 2>&1; }

if works; then exit 0; fi
rm -rf "$home"
"$python" -m venv "$home" >/dev/null 2>&1 &&
    "$home/bin/python" -m pip install --quiet --disable-pip-version-check "numpy<2" &&
    "$home/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps "mag-manip==3.0.0" || true
if ! works; then
    rm -rf "$home"
    echo "going on without mag_manip: the tests that need it will be skipped" >&2
fi

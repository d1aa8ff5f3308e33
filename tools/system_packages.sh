#!/bin/sh
# Looks for what no Python package brings along, and installs it where allowed (root, on a Debian-like system):
#   sh tools/system_packages.sh venv PYTHON       ensurepip, which `python -m venv` needs
#   sh tools/system_packages.sh graphics PYTHON   the shared libraries of Gmsh, and off-screen rendering for VTK
#   sh tools/system_packages.sh browser           Chromium and its driver; without them the browser tests are skipped
#   sh tools/system_packages.sh octave            GNU Octave; without it the tests of MATLAB files are skipped
# What works already is left alone. Where nothing may be installed, it prints the line to type.
set -eu
need=${1:-}
python=${2:-python3}
skipped=

render='
import numpy, pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32))
plotter.add_mesh(pyvista.Sphere(), color="red")
assert numpy.ptp(plotter.screenshot(None)) > 0, "VTK draws an empty picture"
'

works() {
    case $need in
    venv) "$python" -c 'import ensurepip, venv' ;;
    graphics) "$python" -c 'import gmsh; gmsh.initialize(); gmsh.finalize()' && "$python" -c "$render" ;;
    browser) command -v chromium && command -v chromedriver ;;
    octave) command -v octave-cli || command -v octave ;;
    esac
}

case $need in
venv)
    missing="$python cannot make virtual environments"
    packages=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
    ;;
graphics)
    missing="Gmsh or VTK lacks a system library"
    packages="libegl1 libegl-mesa0 libfontconfig1 libgl1 libgl1-mesa-dri libglu1-mesa libgomp1"
    packages="$packages libx11-6 libxcursor1 libxext6 libxfixes3 libxft2 libxinerama1 libxrender1"
    ;;
browser)
    missing="no chromium with chromedriver"
    packages="chromium chromium-driver"
    skipped="the browser tests"
    ;;
octave)
    missing="no octave"
    packages="octave"
    skipped="the tests of MATLAB files"
    ;;
*)
    sed -n '2,7s/^# //p' "$0" >&2
    exit 2
    ;;
esac

log=$(mktemp)
trap 'rm -f "$log"' EXIT
if works >"$log" 2>&1; then exit 0; fi

# shellcheck disable=SC2086 # the list of packages is meant to be split
install() {
    exec 8>/run/magfem-packages.lock
    flock 8 # two makes at once: the second waits, and then finds the work done
    works >"$log" 2>&1 && return
    export DEBIAN_FRONTEND=noninteractive
    apt-get update -qq || echo "apt-get update failed, going on with the lists there are"
    apt-get install -y --no-install-recommends -o DPkg::Lock::Timeout=300 $packages
}

if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "$missing: installing $packages"
    (install) >"$log" 2>&1 </dev/null || tail -n 5 "$log" >&2
    if works >"$log" 2>&1; then exit 0; fi
fi

[ -n "$skipped" ] || tail -n 1 "$log" >&2
echo "$missing; type: sudo apt-get install -y --no-install-recommends $packages" >&2
if [ -n "$skipped" ]; then
    echo "going on: $skipped will be skipped" >&2
    exit 0
fi
exit 1

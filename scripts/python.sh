#!/bin/sh
# Makes a virtual environment with the readers of every format in the folder given.
set -eu

if ! python3 -c 'import venv, ensurepip' 2>/dev/null; then
    if ! command -v apt-get >/dev/null; then
        echo "Python 3 with its venv module is needed: install it." >&2
        exit 1
    fi
    root=$([ "$(id -u)" = 0 ] || echo sudo)
    $root apt-get update -qq
    DEBIAN_FRONTEND=noninteractive $root apt-get install -y -qq python3-venv >/dev/null
fi
python3 -m venv "$1"
"$1/bin/python" -m pip install --quiet numpy scipy h5py pandas pyarrow xarray zarr openpyxl colour-science
# Mitsuba is a large download, and one test's: SPECTROLL_MITSUBA=1 asks for both.
[ -z "${SPECTROLL_MITSUBA:-}" ] || "$1/bin/python" -m pip install --quiet mitsuba

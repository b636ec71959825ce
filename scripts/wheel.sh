#!/bin/sh
# Builds the wheel of this machine and tests it in a fresh environment: `wheel.sh VENV FOLDER [PYTEST ARGUMENTS]`, where
# VENV has Python and FOLDER takes what is made.
set -eu

venv=$1
folder=$2
shift 2
"$venv/bin/python" -m pip install --quiet 'maturin>=1.16,<2'
rm -rf "$folder"
mkdir -p "$folder"
# The build is `cargo build --release` in the folder of all others, so that little is compiled twice.
"$venv/bin/maturin" build --quiet --release --locked --interpreter "$venv/bin/python" --out "$folder"
"$venv/bin/python" -m venv "$folder/venv"
# One file, and what its adapters and tests work with. Dask's and Ray's clusters are for `make exhaustive`.
"$folder/venv/bin/python" -m pip install --quiet "$(echo "$folder"/*.whl)" -r python/tests/requirements.txt
"$folder/venv/bin/python" -m pytest -q "$@"

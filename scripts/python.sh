#!/usr/bin/env bash
# Runs Python in .venv with the packages of the snapshot test; makes it at first use.
#
# Usage: scripts/python.sh ARGUMENTS...
set -euo pipefail
folder="$(cd "$(dirname "$0")/.." && pwd)/.venv"
if [ ! -e "$folder/complete" ]; then
    rm -rf "$folder"
    python3 -m venv "$folder"
    "$folder/bin/python" -m pip install --quiet --disable-pip-version-check vtk numpy
    touch "$folder/complete"
fi
exec "$folder/bin/python" "$@"

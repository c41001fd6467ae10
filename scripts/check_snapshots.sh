#!/usr/bin/env bash
# A short run on two ranks, whose snapshots VTK's own reader then opens and checks.
#
# Usage: scripts/check_snapshots.sh PROGRAM
set -euo pipefail
cd "$(dirname "$0")/.."
# shellcheck source=scripts/environment.sh
. scripts/environment.sh
program=$1
run=$(mktemp -d)
trap 'rm -rf "$run"' EXIT

run_ranks 2 "$program" configs/quickstart.toml --output "$run/run" \
    --set stage.0.steps=2000 --set stage.1.steps=500 \
    --set 'output.snapshots=500 steps' --set output.snapshot_contacts=true --set output.plots=false \
    >"$run/log" 2>&1 || {
    cat "$run/log" >&2
    exit 1
}
scripts/python.sh tests/read_snapshots.py "$run/run"

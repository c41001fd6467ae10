#!/usr/bin/env bash
# Runs the quickstart on two ranks as the README types it, then says where the results are.
set -euo pipefail
cd "$(dirname "$0")/.."
# shellcheck source=scripts/environment.sh
. scripts/environment.sh
run=runs/quickstart

echo
echo "\$ mpirun -n 2 dem-mpi configs/quickstart.toml"
run_ranks 2 dem-mpi configs/quickstart.toml </dev/null

echo
echo "The run directory is $run:"
if [ -e "$run/plots/stress_strain.png" ]; then
    echo "  picture    $run/plots/stress_strain.png   (more beside it)"
fi
for series in "$run"/snapshots/*.series; do
    [ -e "$series" ] && echo "  ParaView   $series   (File > Open; README.md, \"Reading the output\")"
done
echo "  table      $run/history.csv"
echo "  digest     dem-mpi digest $run"
case ":$DEM_MPI_USER_PATH:" in
*":$cargo_bin:"*) ;;
*) echo "To call dem-mpi yourself, put it on the PATH:  export PATH=\"$cargo_bin:\$PATH\"" ;;
esac
if [ "$(id -u)" -eq 0 ]; then
    echo "As root, Open MPI wants:  export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1"
fi

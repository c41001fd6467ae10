#!/bin/bash
# A dem-mpi run under Slurm: MPI ranks with several threads each. Some minutes before the time limit
# Slurm sends a signal; dem-mpi then writes a checkpoint and ends with code 75, the job queues itself
# again and goes on from the checkpoint, until the run is complete.
#
#   sbatch jobscripts/slurm.sh configs/quickstart.toml [RUN_DIR]
#
# RUN_DIR is runs/<name of the configuration> by default. Options after it go to dem-mpi.
#SBATCH --job-name=dem-mpi
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=8
#SBATCH --cpus-per-task=4
#SBATCH --time=12:00:00
# The signal reaches this script 300 s before the limit: time for the step in progress, the collective
# write of the checkpoint and a slow file system. "B:" sends it here and to no program.
#SBATCH --signal=B:USR1@300
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.log
set -uo pipefail

# Adapt: one MPI and the parallel HDF5 that dem-mpi was built with.
# module load gcc openmpi hdf5-mpi

config=${1:?usage: sbatch slurm.sh CONFIG [RUN_DIR [OPTIONS...]]}
run=${2:-runs/$(basename "$config" .toml)}
options=("${@:3}")
requeue_code=75

threads=${SLURM_CPUS_PER_TASK:-1}
# srun no longer takes the threads per rank from sbatch by itself (Slurm 22.05 and newer).
export SRUN_CPUS_PER_TASK=$threads

arguments=("$config" --output "$run" --threads "$threads" ${options[@]+"${options[@]}"})
if compgen -G "$run/checkpoint-*.h5" >/dev/null; then
    arguments+=(--restart "$run")
fi

# In the background, because bash answers a signal only between commands or in `wait`; srun passes the
# signal on to every rank. Each rank keeps to its own cores.
srun --cpu-bind=cores dem-mpi "${arguments[@]}" &
launcher=$!
trap 'signalled=yes; kill -USR1 "$launcher" 2>/dev/null' USR1
# `wait` also returns when a signal comes; then wait again for the program's own end.
signalled=yes
while [ "$signalled" = yes ]; do
    signalled=no
    wait "$launcher"
    code=$?
done

if [ "$code" -eq "$requeue_code" ]; then
    echo "checkpoint written; job $SLURM_JOB_ID queues again"
    scontrol requeue "$SLURM_JOB_ID"
    exit 0
fi
exit "$code"

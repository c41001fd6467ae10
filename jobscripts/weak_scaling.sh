#!/bin/bash
# Weak scaling of dem-mpi under Slurm: a size per core on 1, 2, 4, ... ranks up to what the job holds, each
# rank with as many threads as the job gives a task. One after another, in this one job.
#
#   sbatch jobscripts/weak_scaling.sh [PARTICLES [DIR [OPTIONS...]]]
#   sbatch --nodes=16 jobscripts/weak_scaling.sh 100000
#
# PARTICLES per core are 100000, DIR is bench-weak by default; it must lie on a file system that all nodes see.
# OPTIONS go to `dem-mpi bench`. DIR then holds scaling.csv, speed_up.png and efficiency.png.
#SBATCH --job-name=dem-mpi-weak
#SBATCH --nodes=4
#SBATCH --ntasks-per-node=8
#SBATCH --cpus-per-task=4
#SBATCH --time=02:00:00
#SBATCH --exclusive
#SBATCH --output=%x-%j.log
set -euo pipefail

# Adapt: one MPI and the parallel HDF5 that dem-mpi was built with.
# module load gcc openmpi hdf5-mpi

particles=${1:-100000}
folder=${2:-bench-weak}
threads=${SLURM_CPUS_PER_TASK:-1}
tasks=${SLURM_NTASKS:-1}

# Powers of two, and all tasks of the job at the end.
layouts=
for ((ranks = 1; ranks < tasks; ranks *= 2)); do
    layouts+="${ranks}x$threads,"
done
layouts+="${tasks}x$threads"

dem-mpi bench --weak --particles "$particles" --layouts "$layouts" --output "$folder" \
    --launcher "srun -n {ranks} -c {threads} --cpu-bind=cores" "${@:3}"

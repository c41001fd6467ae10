#!/bin/bash
# A dem-mpi run under PBS: MPI ranks with several threads each. PBS sends no signal before the limit,
# so this script keeps the time itself: `grace` seconds before the end dem-mpi is told to write a
# checkpoint and ends with code 75; a following job is queued that goes on from it, until the run is
# complete.
#
#   qsub -v CONFIG=configs/quickstart.toml jobscripts/pbs.sh          (from the folder of the project)
#
# Variables for -v: CONFIG (needed), RUN_DIR (runs/<name of the configuration>), JOBSCRIPT (the path of
# this file for the following job, jobscripts/pbs.sh).
#PBS -N dem-mpi
#PBS -l select=2:ncpus=32:mpiprocs=8:ompthreads=4
#PBS -l walltime=12:00:00
#PBS -j oe
set -uo pipefail
cd "${PBS_O_WORKDIR:-.}" || exit 1

# Adapt: one MPI and the parallel HDF5 that dem-mpi was built with.
# module load gcc openmpi hdf5-mpi

config=${CONFIG:?usage: qsub -v CONFIG=file.toml jobscripts/pbs.sh}
run=${RUN_DIR:-runs/$(basename "$config" .toml)}
script=${JOBSCRIPT:-jobscripts/pbs.sh}
requeue_code=75
grace=300

ranks=$(wc -l <"$PBS_NODEFILE")
threads=${OMP_NUM_THREADS:-1}
# Seconds of wall time from HH:MM:SS (the job's own limit).
limit=$(qstat -f "$PBS_JOBID" | sed -n 's/.*Resource_List\.walltime = //p' | awk -F: '{ print ($1 * 60 + $2) * 60 + $3 }')

arguments=("$config" --output "$run" --threads "$threads")
if compgen -G "$run/checkpoint-*.h5" >/dev/null; then
    arguments+=(--restart "$run")
fi

# Open MPI: each rank gets `threads` cores of its own. With MPICH: mpiexec -n "$ranks" -bind-to core:"$threads".
# mpirun passes the signal on to every rank.
mpirun -n "$ranks" --map-by "slot:PE=$threads" --bind-to core dem-mpi "${arguments[@]}" &
launcher=$!
trap 'signalled=yes; kill -USR1 "$launcher" 2>/dev/null' USR1
alarm=
if [ "${limit:-0}" -gt "$grace" ]; then
    (
        trap 'kill "$!" 2>/dev/null' EXIT
        trap 'exit' TERM
        sleep $((limit - grace)) &
        wait "$!"
        kill -USR1 "$launcher" 2>/dev/null
    ) &
    alarm=$!
fi
# `wait` also returns when a signal comes; then wait again for the program's own end.
signalled=yes
while [ "$signalled" = yes ]; do
    signalled=no
    wait "$launcher"
    code=$?
done
if [ -n "$alarm" ]; then
    kill "$alarm" 2>/dev/null
fi

if [ "$code" -eq "$requeue_code" ]; then
    echo "checkpoint written; a following job goes on"
    qsub -W "depend=afterany:$PBS_JOBID" -v "CONFIG=$config,RUN_DIR=$run,JOBSCRIPT=$script" "$script"
    exit
fi
exit "$code"

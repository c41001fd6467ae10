# Sourced by the recipes and scripts: what the programs need to find each other on this machine.
# Changes nothing that the caller has set.
# shellcheck shell=bash

# The PATH as the user has it, for hints at the end.
export DEM_MPI_USER_PATH="${DEM_MPI_USER_PATH-$PATH}"

# cargo and the installed dem-mpi.
cargo_bin="${CARGO_HOME:-$HOME/.cargo}/bin"
case ":$PATH:" in
*":$cargo_bin:"*) ;;
*) export PATH="$cargo_bin:$PATH" ;;
esac

# Open MPI refuses to run as root unless told twice; containers often know no other user.
if [ "$(id -u)" -eq 0 ]; then
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
fi

# First directory of Debian's HDF5 flavours (openmpi, mpich, serial) that is installed.
debian_hdf5() {
    local flavour directory
    for flavour in "$@"; do
        for directory in /usr/lib/*/hdf5/"$flavour"; do
            if [ -e "$directory/include/hdf5.h" ]; then
                echo "$directory"
                return 0
            fi
        done
    done
    return 1
}

# Is this HDF5 include directory a parallel build?
is_parallel_hdf5() {
    cat "$1"/H5pubconf*.h 2>/dev/null | grep -E '^#define[[:space:]]+H5_HAVE_PARALLEL[[:space:]]+1' >/dev/null
}

# Is the MPI in use an MPICH?
mpi_is_mpich() {
    "${MPICC:-mpicc}" -show 2>/dev/null | grep -i mpich >/dev/null
}

# Include directory of the HDF5 that the build would take by itself.
default_hdf5_include() {
    if [ -n "${HDF5_DIR:-}" ]; then
        echo "$HDF5_DIR/include"
    else
        pkg-config --variable=includedir hdf5 2>/dev/null
    fi
}

# Where the parallel HDF5 is when the build would not find it by itself; nothing when it would.
parallel_hdf5_dir() {
    local wanted=openmpi include
    mpi_is_mpich && wanted=mpich
    include=$(default_hdf5_include)
    if [ -n "${HDF5_DIR:-}" ] || { [ -n "$include" ] && is_parallel_hdf5 "$include"; }; then
        return 0
    fi
    debian_hdf5 "$wanted" || true
}

# mpirun with what this machine needs: more ranks than cores are allowed where the flag exists.
run_ranks() {
    local ranks=$1 cores
    shift
    cores=$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 1)
    if [ "$ranks" -gt "$cores" ] && mpirun --version 2>/dev/null | grep -i 'open mpi' >/dev/null; then
        mpirun --oversubscribe -n "$ranks" "$@"
    else
        mpirun -n "$ranks" "$@"
    fi
}

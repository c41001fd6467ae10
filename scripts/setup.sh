#!/usr/bin/env bash
# Checks what the build needs and, on Debian and Ubuntu, installs what is missing. Quick and silent
# when nothing is.
#
# Usage: scripts/setup.sh [parallel|serial] [python]
#   parallel  Open MPI (or the MPI that is there), parallel HDF5, libclang        (default)
#   serial    HDF5 without MPI
#   python    also a Python that can make virtual environments, for the test of the snapshots
set -euo pipefail
cd "$(dirname "$0")/.."
# shellcheck source=scripts/environment.sh
. scripts/environment.sh

flavour=parallel
python=no
for word in "$@"; do
    case $word in
    parallel | serial) flavour=$word ;;
    python) python=yes ;;
    *)
        echo "usage: scripts/setup.sh [parallel|serial] [python]" >&2
        exit 2
        ;;
    esac
done

say() { echo "setup: $*"; }
has() { command -v "$1" >/dev/null 2>&1; }

# A file named like libclang itself: libclang-cpp, which comes with other packages, is another library.
is_libclang() {
    grep -v 'libclang-cpp' | grep 'libclang[-.]' >/dev/null
}

has_libclang() {
    compgen -G "${LIBCLANG_PATH:-/nowhere}/libclang*" | is_libclang && return 0
    compgen -G '/usr/lib/llvm-*/lib/libclang*.so*' | is_libclang && return 0
    compgen -G '/usr/lib*/libclang*.so*' | is_libclang && return 0
    has ldconfig && ldconfig -p | is_libclang && return 0
    has llvm-config && compgen -G "$(llvm-config --libdir)/libclang*" | is_libclang && return 0
    compgen -G '/Library/Developer/CommandLineTools/usr/lib/libclang*' | is_libclang
}

has_parallel_hdf5() {
    [ -n "$(parallel_hdf5_dir)" ] && return 0
    local include
    include=$(default_hdf5_include)
    [ -n "$include" ] && is_parallel_hdf5 "$include"
}

has_serial_hdf5() {
    debian_hdf5 serial >/dev/null && return 0
    local include
    include=$(default_hdf5_include)
    [ -n "$include" ] && [ -e "$include/hdf5.h" ] && ! is_parallel_hdf5 "$include"
}

has_venv() {
    has python3 && python3 -c 'import ensurepip, venv' 2>/dev/null
}

# What is missing: Debian packages, and the same in words for other systems.
packages=()
words=()
missing() {
    words+=("$1")
    shift
    packages+=("$@")
}

has make || missing "make" make
has cc || missing "a C compiler (cc)" gcc libc6-dev
has pkg-config || missing "pkg-config" pkg-config
if [ "$flavour" = parallel ]; then
    if has "${MPICC:-mpicc}" && mpi_is_mpich; then hdf5_package=libhdf5-mpich-dev; else hdf5_package=libhdf5-openmpi-dev; fi
    has "${MPICC:-mpicc}" || missing "an MPI library with its compiler wrapper (mpicc)" libopenmpi-dev
    has mpirun || has srun || missing "an MPI launcher (mpirun)" openmpi-bin
    has_libclang || missing "libclang" libclang-dev
    has_parallel_hdf5 || missing "parallel HDF5 (HDF5_DIR or pkg-config must lead to it)" "$hdf5_package"
else
    has_serial_hdf5 || missing "HDF5 (HDF5_DIR or pkg-config must lead to it)" libhdf5-dev
fi
if [ "$python" = yes ]; then
    has_venv || missing "Python 3 with venv" python3 python3-venv
fi

check_rust() {
    local wanted found
    wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
    if ! has cargo || ! has rustc; then
        say "Rust is missing: install it as https://rustup.rs says (no root needed), then run this again." >&2
        exit 1
    fi
    found=$(rustc --version | cut -d' ' -f2)
    if [ "$(printf '%s\n%s\n' "$wanted" "$found" | sort -V | head -n 1)" != "$wanted" ]; then
        say "Rust $found is older than $wanted: run 'rustup update stable', or see https://rustup.rs." >&2
        exit 1
    fi
}

name_what_to_do() {
    {
        say "missing:"
        printf '  - %s\n' "${words[@]}"
        if [ -n "${LMOD_CMD:-}${MODULESHOME:-}" ]; then
            echo "This looks like a cluster with modules: load one MPI and the parallel HDF5 built with it, for example"
            echo "  module load gcc openmpi hdf5-mpi llvm"
            echo "  export HDF5_DIR=...     # the folder that holds include/ and lib/ of this HDF5"
        elif has dnf; then
            echo "On Fedora:"
            echo "  sudo dnf install gcc make pkgconf openmpi-devel hdf5-openmpi-devel clang-devel"
            echo "  module load mpi/openmpi-\$(uname -m)"
        elif [ "$(uname -s)" = Darwin ]; then
            echo "On macOS with Homebrew:"
            echo "  brew install open-mpi hdf5-mpi llvm pkgconf"
            echo "  export HDF5_DIR=\$(brew --prefix hdf5-mpi)"
        fi
        echo "README.md, section \"What it needs\", says more."
    } >&2
    exit 1
}

install_packages() {
    local root=()
    if ! has apt-get; then name_what_to_do; fi
    if [ "$(id -u)" -ne 0 ]; then
        if ! has sudo; then
            say "as root, type: apt-get install ${packages[*]}" >&2
            name_what_to_do
        fi
        root=(sudo)
    fi
    say "installing ${packages[*]}"
    local apt=(${root[@]+"${root[@]}"} env DEBIAN_FRONTEND=noninteractive apt-get -q -y)
    local log
    log=$(mktemp)
    if ! { "${apt[@]}" update && "${apt[@]}" install --no-install-recommends "${packages[@]}"; } >"$log" 2>&1 </dev/null; then
        tail -n 20 "$log" >&2
        rm -f "$log"
        say "apt-get could not install them." >&2
        name_what_to_do
    fi
    rm -f "$log"
}

check_rust
if [ ${#words[@]} -gt 0 ]; then
    install_packages
fi

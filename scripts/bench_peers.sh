#!/usr/bin/env bash
# Runs LAMMPS, LIGGGHTS and dem-mpi on the same packings, interleaved, and prints the median rate of each and
# the ratios. Installs Debian's lammps and liggghts where they are missing.
#
# Usage: scripts/bench_peers.sh path/to/dem-mpi
# Variables: SIZES="10000 100000"  RANKS="1 2"  REPEATS=3  LAMMPS_NATIVE=/path/to/another/lmp
set -euo pipefail
cd "$(dirname "$0")/.."
program=${1:?usage: scripts/bench_peers.sh path/to/dem-mpi}
sizes=${SIZES:-10000 100000}
ranks=${RANKS:-1 2}
repeats=${REPEATS:-3}
work=${WORK:-target/peers}
mkdir -p "$work"
export OMP_NUM_THREADS=1
if [ "$(id -u)" -eq 0 ]; then
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
fi

missing=()
command -v lmp >/dev/null || missing+=(lammps)
command -v liggghts >/dev/null || missing+=(liggghts)
if [ ${#missing[@]} -gt 0 ]; then
    root=()
    [ "$(id -u)" -eq 0 ] || root=(sudo)
    "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -y update
    "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -y install --no-install-recommends "${missing[@]}"
fi

# Seconds of the timed steps, from the last line of each program that names them.
seconds() {
    sed -n -e 's/^Loop time of \([0-9.eE+-]*\) on.*/\1/p' -e 's/^loop \([0-9.eE+-]*\) s$/\1/p' "$1" | tail -n 1
}

run_one() {
    local code=$1 count=$2 data=$3 warm=$4 steps=$5 log=$6
    local mpi=(mpirun --bind-to core -n "$count")
    local variables=(-log none -var data "$data" -var warm "$warm" -var steps "$steps")
    case $code in
    lammps) "${mpi[@]}" lmp -in benches/peers/in.lammps "${variables[@]}" ;;
    native) "${mpi[@]}" "$LAMMPS_NATIVE" -in benches/peers/in.lammps "${variables[@]}" ;;
    liggghts) "${mpi[@]}" liggghts -in benches/peers/in.liggghts "${variables[@]}" ;;
    ranks) "${mpi[@]}" "$program" bench --packing "$data" --warm "$warm" --steps "$steps" ;;
    threads) "$program" bench --packing "$data" --warm "$warm" --steps "$steps" --threads "$count" ;;
    esac >"$log" 2>&1 || { tail -n 20 "$log" >&2; echo "bench_peers: $code failed" >&2; exit 1; }
}

codes=(lammps liggghts ranks threads)
if [ -n "${LAMMPS_NATIVE:-}" ]; then codes+=(native); fi
for size in $sizes; do
    data=$work/packing-$size.data
    [ -e "$data" ] || "$program" bench --write-data "$data" --particles "$size"
    # About the same work for each size.
    steps=$((10000000 / size + 10))
    warm=$((steps / 5 + 5))
    for count in $ranks; do
        rm -f "$work"/rates-*
        for ((repeat = 0; repeat < repeats; repeat++)); do
            for code in "${codes[@]}"; do
                run_one "$code" "$count" "$data" "$warm" "$steps" "$work/log-$code"
                awk -v n="$size" -v steps="$steps" -v s="$(seconds "$work/log-$code")" \
                    'BEGIN { printf "%.4f\n", n * steps / s / 1e6 }' >>"$work/rates-$code"
            done
        done
        best=0
        for code in "${codes[@]}"; do
            read -r median low high < <(sort -g "$work/rates-$code" | awk '{ v[NR] = $1 }
                END { print v[int((NR + 1) / 2)], v[1], v[NR] }')
            printf '%8d particles, %s core(s)  %-9s %8.2f million particle-steps/s  [%s, %s]\n' \
                "$size" "$count" "$code" "$median" "$low" "$high"
            declare "rate_$code=$median"
        done
        best=$(printf '%s\n%s\n' "$rate_ranks" "$rate_threads" | sort -g | tail -n 1)
        for code in "${codes[@]}"; do
            case $code in ranks | threads) continue ;; esac
            name=rate_$code
            awk -v ours="$best" -v theirs="${!name}" -v code="$code" -v size="$size" -v count="$count" \
                'BEGIN { printf "%8d particles, %s core(s)  dem-mpi is %.2f times %s\n", size, count, ours / theirs, code }'
        done
    done
done

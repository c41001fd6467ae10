#!/usr/bin/env python3
"""Compare programs on cores that nobody else uses.

    python3 benches/compare.py SECONDS "[NAME=][CORES*]COMMAND" ...

Runs the commands in turn, each bound to one core or as many as it names, for so many seconds, and prints quartiles of the
particle-steps/s and the ratio of the medians to the first command's. A command is one of `dem-mpi bench`, LAMMPS or LIGGGHTS:

    python3 benches/compare.py 60 "dem-mpi bench --packing p.data --steps 600" "lmp=lmp -in benches/peers/in.lammps -var ..."
    python3 benches/compare.py 60 "dem-mpi bench --packing p.data" "2*dem-mpi bench --packing p.data --threads 2"

On a shared machine somebody else may run on the core's other hardware thread, which takes up to half of its speed. A loop
of one short instruction and a jump, which then takes two cycles a turn instead of one, tells: runs count only if it was fast
right before and right after, on each of the cores. Needs a C compiler (cc) and Linux.
"""
import os, re, statistics, subprocess, sys, tempfile, time

SPIN = r"""
#include <stdio.h>
#include <time.h>
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }
int main(void) {
    double least = 1e99;
    for (int part = 0; part < 4; part++) {
        double start = now();
        for (long turn = 0; turn < 6000000; turn++) __asm__ volatile("");
        double rate = 6e6 / (now() - start);
        if (rate < least) least = rate;
    }
    printf("%g\n", least);
}
"""
ENVIRONMENT = dict(os.environ, OMP_NUM_THREADS="1")
if os.geteuid() == 0:
    ENVIRONMENT.update(OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")


def particle_steps_per_second(text):
    """From dem-mpi's own line, or from the last loop of LAMMPS or LIGGGHTS."""
    loops = re.findall(r"Loop time of (\S+) on \d+ procs for (\d+) steps with (\d+) atoms", text)
    if loops:
        seconds, steps, particles = map(float, loops[-1])
        return particles * steps / seconds
    found = re.search(r"^particle-steps/s\s+(\S+)", text, re.MULTILINE)
    return float(found.group(1)) if found else None


class Job:
    def __init__(self, text):
        name, cores, command = re.fullmatch(r"(?:([\w.:-]+)=)?(?:(\d+)\*)?(.+)", text).groups()
        self.name, self.cores, self.command = name or text, int(cores or 1), command.split()
        self.rates, self.tried = [], 0

    def run(self, cores):
        command = ["taskset", "-c", ",".join(map(str, cores)), *self.command]
        done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT)
        rate = particle_steps_per_second(done.stdout)
        if not rate:
            sys.exit(f"{' '.join(command)} gave no rate: {(done.stdout + done.stderr)[-500:]}")
        return rate / 1e6


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    end, jobs = time.time() + float(sys.argv[1]), [Job(text) for text in sys.argv[2:]]
    with tempfile.TemporaryDirectory() as folder:
        source, spin = os.path.join(folder, "spin.c"), os.path.join(folder, "spin")
        with open(source, "w") as file:
            file.write(SPIN)
        subprocess.run(["cc", "-O2", "-falign-loops=64", "-o", spin, source], check=True)
        every = sorted(os.sched_getaffinity(0))
        if max(job.cores for job in jobs) > len(every):
            sys.exit(f"there are {len(every)} cores")

        def speeds(cores):
            at_once = [subprocess.Popen(["taskset", "-c", str(core), spin], stdout=subprocess.PIPE) for core in cores]
            return [float(process.communicate()[0]) for process in at_once]

        fastest = max(speeds([core])[0] for core in every * 10)
        alone = lambda cores: min(speeds(cores)) > 0.93 * fastest
        while time.time() < end:
            job = min(jobs, key=lambda job: (len(job.rates), job.tried))
            groups = [every[start : start + job.cores] for start in range(len(every) - job.cores + 1)]
            cores = next((group for group in groups if alone(group)), None)
            if cores is None:
                time.sleep(0.05)
                continue
            rate = job.run(cores)
            job.tried += 1
            if alone(cores):
                job.rates.append(rate)
    for job in jobs:
        if len(job.rates) < 3 or len(jobs[0].rates) < 3:
            print(f"{job.name}: {len(job.rates)} of {job.tried} runs undisturbed, too few")
            continue
        low, middle, high = statistics.quantiles(job.rates, n=4)
        ratio = middle / statistics.median(jobs[0].rates)
        print(f"{job.name}: {middle:.2f} [{low:.2f}, {high:.2f}] M particle-steps/s, {ratio:.3f}, "
              f"{len(job.rates)} of {job.tried} runs undisturbed")


main()

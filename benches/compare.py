#!/usr/bin/env python3
"""Compare programs on a core that nobody else uses.

    python3 benches/compare.py SECONDS "BENCH ARGUMENTS" "PROGRAM [MORE ARGUMENTS]" ...

Runs `PROGRAM bench BENCH ARGUMENTS MORE ARGUMENTS` of each in turn, bound to one core, for so many seconds, and prints
quartiles of the particle-steps/s and the ratio of the medians to the first program's. On a shared machine somebody else may run on
the core's other hardware thread, which takes up to half of its speed. A loop of one short instruction and a jump, which
then takes two cycles a turn instead of one, tells: runs count only if it was fast right before and right after.
Needs a C compiler (cc) and Linux.
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


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    end, arguments, programs = time.time() + float(sys.argv[1]), sys.argv[2].split(), sys.argv[3:]
    with tempfile.TemporaryDirectory() as folder:
        source, spin = os.path.join(folder, "spin.c"), os.path.join(folder, "spin")
        with open(source, "w") as file:
            file.write(SPIN)
        subprocess.run(["cc", "-O2", "-falign-loops=64", "-o", spin, source], check=True)
        cores = sorted(os.sched_getaffinity(0))
        rate = lambda core: float(subprocess.run(["taskset", "-c", str(core), spin], capture_output=True, text=True).stdout)
        fastest = max(rate(core) for core in cores * 10)
        alone = lambda core: rate(core) > 0.93 * fastest
        rates, tried = {program: [] for program in programs}, {program: 0 for program in programs}
        while time.time() < end:
            program = min(programs, key=lambda program: (len(rates[program]), tried[program]))
            core = next((core for core in cores if alone(core)), None)
            if core is None:
                time.sleep(0.05)
                continue
            name, *more = program.split()
            run = ["taskset", "-c", str(core), name, "bench", *arguments, *more]
            done = subprocess.run(run, capture_output=True, text=True)
            found = re.search(r"particle-steps/s\s+(\S+)", done.stdout)
            if not found:
                sys.exit(f"{' '.join(run)} gave no rate: {done.stderr[-500:]}")
            tried[program] += 1
            if alone(core):
                rates[program].append(float(found.group(1)) / 1e6)
    for program in programs:
        values = sorted(rates[program])
        if len(values) < 3 or len(rates[programs[0]]) < 3:
            print(f"{program}: {len(values)} of {tried[program]} runs undisturbed, too few")
            continue
        low, middle, high = statistics.quantiles(values, n=4)
        ratio = middle / statistics.median(rates[programs[0]])
        print(f"{program}: {middle:.2f} [{low:.2f}, {high:.2f}] M particle-steps/s, {ratio:.3f}, "
              f"{len(values)} of {tried[program]} runs undisturbed")


main()

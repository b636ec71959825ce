"""Rates of the Python package: draws into arrays beside those of the program's engine, and the cost of small calls.

`python scripts/bench_python.py`, with the package installed; nothing else should run.
"""

import json
import subprocess
import sys
import time

import numpy as np

from spectroll import Sampler


def best(work, least_seconds=1.0):
    """The shortest time of several runs, in seconds."""
    work()
    times, start = [], time.perf_counter()
    while time.perf_counter() - start < least_seconds:
        before = time.perf_counter()
        work()
        times.append(time.perf_counter() - before)
    return min(times)


def of_the_program(engine):
    """Draws a second in the program's own memory, of the trial that a dry run makes."""
    words = [sys.executable, "-m", "spectroll", "sample", "munsell-vrhel", "-n", "1e6", "--engine", engine]
    words += ["-o", "none.npy", "--dry-run", "--json"]
    rates = [json.loads(subprocess.run(words, check=True, capture_output=True).stdout)["draws_per_second"] for _ in range(5)]
    return max(rates)


def main():
    engine = sys.argv[1] if len(sys.argv) > 1 else "cpu"
    sampler = Sampler(engine=engine)
    print(sampler.engine)
    print(f"  the program, in its own memory: {of_the_program(engine) / 1e6:.1f} million a second")
    for power in (16, 18, 20, 22):
        count = 2**power
        out = np.empty((count, 31), np.float32)
        into = count / best(lambda: sampler.draw(count, out=out))
        fresh = count / best(lambda: sampler.draw(count))
        ids = np.random.default_rng(0).permutation(count)
        listed = count / best(lambda: sampler.at(ids, out=out))
        print(f"  2^{power}: draw(out=) {into / 1e6:.1f}, draw {fresh / 1e6:.1f}, at(out=) {listed / 1e6:.1f}")
    for threads in (None, 1):
        small = Sampler(engine=engine, threads=threads)
        out = np.empty((1000, 31), np.float32)
        seconds = best(lambda: small.draw(1000, out=out)), best(lambda: small.draw(1000)), best(lambda: small.draw(1))
        print(f"  threads={threads}: 1000 rows {1e6 * seconds[0]:.0f} us into out, {1e6 * seconds[1]:.0f} us; one {1e6 * seconds[2]:.0f} us")


main()

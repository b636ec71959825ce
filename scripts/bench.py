"""Spectroll beside NumPy and Numba, in one run on one machine.

The programs take turns, so that all of them meet the machine's good and bad moments; medians are printed with their
least and most.
"""

import argparse
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SPECTROLL = os.path.join(ROOT, "target", "release", "spectroll")
PEERS = os.path.join(ROOT, "scripts", "peers.py")
MEMORY = "/dev/shm" if os.path.isdir("/dev/shm") else tempfile.gettempdir()

def run(*command, env=None):
    """Standard output, seconds and peak resident megabytes of a command that must succeed."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env={**os.environ, **(env or {})})
    out = process.stdout.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{' '.join(command)} failed")
    return out, time.perf_counter() - start, usage.ru_maxrss / 1024


class Figures:
    """Samples by name, in the order in which the names came."""

    def __init__(self):
        self.samples = {}

    def add(self, name, value):
        self.samples.setdefault(name, []).append(value)

    def median(self, name):
        return statistics.median(self.samples[name])

    def show(self, unit):
        for name, values in self.samples.items():
            low, high = min(values), max(values)
            print(f"  {self.median(name):10.3f} {unit}  ({low:.3f} to {high:.3f}, n = {len(values)})  {name}")

    def ratio(self, a, b):
        pairs = [x / y for x, y in zip(self.samples[a], self.samples[b])]
        print(f"  {statistics.median(pairs):10.2f} x  ({min(pairs):.2f} to {max(pairs):.2f})  {a} / {b}")


def peers_model(folder):
    """The built-in model as a file, for `peers.py`."""
    path = os.path.join(folder, "model.json")
    run(SPECTROLL, "fit", "munsell", "vrhel", "-o", path)
    return path


def in_process(rounds, model):
    rates = Figures()
    for _ in range(rounds):
        for rate in json.loads(run(SPECTROLL, "bench", "--json", "--runs", "5")[0])["rates"]:
            rates.add(rate["engine"], rate["median"])
        for peer in ("numpy", "numba"):
            rates.add(peer, float(run(sys.executable, PEERS, model, peer, "4e6")[0]))
    print("In process, reflectances of 31 bands and 6 components, mapped for reading:")
    rates.show("million/s")
    for engine in [name for name in rates.samples if name not in ("numpy", "numba")]:
        for peer in ("numpy", "numba"):
            rates.ratio(engine, peer)


def whole_process(rounds, model, count):
    seconds, memory = Figures(), Figures()
    out = os.path.join(MEMORY, f"spectroll-bench-{os.getpid()}.npy")
    size = count * 31 * 4
    commands = {
        "spectroll --engine gpu": [SPECTROLL, "sample", "munsell-vrhel", "-n", str(count), "-o", out, "-q", "--force", "--engine", "gpu"],
        "spectroll --engine cpu": [SPECTROLL, "sample", "munsell-vrhel", "-n", str(count), "-o", out, "-q", "--force", "--engine", "cpu"],
        "dd": ["dd", "if=/dev/zero", f"of={out}", "bs=4M", f"count={size >> 22}", "status=none"],
        "numpy": [sys.executable, PEERS, model, "numpy", str(count), out],
    }
    try:
        for _ in range(rounds):
            for name, command in commands.items():
                _, taken, resident = run(*command)
                seconds.add(name, taken)
                memory.add(name, resident)
                os.remove(out)
    finally:
        if os.path.exists(out):
            os.remove(out)
    print(f"\nWhole process, {count:,} reflectances ({size / 1e9:.2f} GB) into a .npy file in {MEMORY}:")
    seconds.show("s")
    for name in ("numpy", "dd"):
        seconds.ratio(name, "spectroll --engine gpu")
        seconds.ratio(name, "spectroll --engine cpu")
    print("  peak resident memory:")
    memory.show("MB")


FORMATS = {
    ".npy": "out.npy", ".npz": "out.npz", ".zarr": "out.zarr", ".zarr --zstd": "out.zarr --zstd", ".h5": "out.h5",
    ".mat": "out.mat", ".parquet": "out.parquet", "parts of .npy": "out/ --format npy",
    "parts of .parquet": "out/ --format parquet",
}


def formats(rounds, count, engine, folder):
    """Each format to disk, beside `dd` with the same number of bytes, both until they are on disk."""
    rates, memory = Figures(), Figures()
    size = count * 31 * 4
    for _ in range(rounds):
        path = os.path.join(folder, "dd")
        seconds = run("dd", "if=/dev/zero", f"of={path}", "bs=4M", f"count={size >> 22}", "conv=fsync", "status=none")[1]
        os.remove(path)
        rates.add("dd", size / seconds / 1e6)
        for name, output in FORMATS.items():
            path, *flags = os.path.join(folder, output).split()
            command = [SPECTROLL, "sample", "munsell-vrhel", "-n", str(count), "-o", path, "-q", "--engine", engine]
            _, seconds, resident = run(*command, *flags)
            rates.add(name, size / seconds / 1e6)
            memory.add(name, resident)
            shutil.rmtree(path) if os.path.isdir(path) else os.remove(path)
    print(f"\nWhole process, {count:,} reflectances ({size / 1e9:.2f} GB of float32) to disk, --engine {engine}:")
    rates.show("MB/s")
    for name in (".npy", ".zarr"):
        rates.ratio(name, "dd")
    print("  peak resident memory:")
    memory.show("MB")


def latency(rounds, folder):
    seconds = Figures()
    out = os.path.join(folder, "one.npy")
    for _ in range(rounds):
        cache = tempfile.mkdtemp(dir=folder)  # so that no shader is compiled already
        one = [SPECTROLL, "sample", "munsell-vrhel", "-n", "1", "-o", out, "-q", "--force", "--engine"]
        seconds.add("first draw on the adapter, no shader cached", run(*one, "gpu", env={"MESA_SHADER_CACHE_DIR": cache})[1])
        seconds.add("first draw on the adapter, shader cached", run(*one, "gpu", env={"MESA_SHADER_CACHE_DIR": cache})[1])
        seconds.add("first draw on the CPU", run(*one, "cpu")[1])
        fit = [SPECTROLL, "fit", "munsell", "vrhel", "-o", os.path.join(folder, "m.json"), "--force"]
        seconds.add("fit of 632 reflectances", run(*fit)[1])
        shutil.rmtree(cache)
    print("\nWhole process, from the start of the program to its end:")
    seconds.show("s")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5, help="how often each program takes its turn")
    parser.add_argument("--count", type=int, default=8_000_000, help="spectra of a whole-process run")
    parser.add_argument("--folder", help="where formats are written [default: the system's temporary folder]")
    arguments = parser.parse_args()
    print(f"{time.strftime('%Y-%m-%d')}, {os.cpu_count()} cores, {platform.machine()}, {platform.system()}\n")
    with tempfile.TemporaryDirectory() as folder:
        model = peers_model(folder)
        in_process(arguments.rounds, model)
        whole_process(arguments.rounds, model, arguments.count)
        latency(arguments.rounds, folder)
        for engine in ("gpu", "cpu"):
            formats(arguments.rounds, arguments.count, engine, arguments.folder or folder)


if __name__ == "__main__":
    main()

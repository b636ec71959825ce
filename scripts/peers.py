"""The same draws as one would write them in Python: spectra of a Gaussian model, kept where all bands are physical.

With COUNT it prints million spectra a second, the best of three runs; with OUT.npy it fills that file once, and prints
nothing. Without, it answers requests: for each line "COUNT SEED" on standard input it draws, in blocks, and writes the
blocks, each a line "ROWS" and the values in 32 bits, and at last a line "0 SECONDS CANDIDATES". The first line that it
writes describes it, as JSON. Only the drawing is timed. Torch draws on the graphics card, if there is one, and with
COUNT leaves the spectra there.
"""

import argparse
import json
import signal
import sys
import time

BLOCK = 1 << 18


class Model:
    """Mean, gain (a row a component) and largest value of the spectra, in 32 bits."""

    def __init__(self, path):
        with open(path) as file:
            model = json.load(file)
        basis = np.array(model["basis"])
        values, vectors = np.linalg.eigh(np.array(model["weight_covariance"]))
        gain = (vectors * np.sqrt(values.clip(0))).T @ basis
        mean = model["mean"] + np.array(model.get("weight_mean", np.zeros(len(basis)))) @ basis
        self.mean, self.gain = mean.astype(np.float32), np.ascontiguousarray(gain, np.float32)
        self.limit = np.float32(1 if model["kind"] == "reflectance" else np.inf)


def in_blocks(draw, set_seed, block):
    """Fills an array with what is kept of blocks of candidates. `draw` makes spectra, and numbers those that are physical."""
    shares = [1, 1]

    def fill(out, seed):
        if seed is not None:
            set_seed(seed)
        done = candidates = 0
        while done < len(out):
            # As many candidates as are likely to be enough.
            count = min(block, int(1.05 * (len(out) - done) * shares[1] / shares[0]) + 16)
            spectra, kept = draw(count)
            shares[0] += len(kept)
            shares[1] += count
            kept = kept[: len(out) - done]
            out[done : done + len(kept)] = spectra[kept]
            done += len(kept)
            candidates += int(kept[-1]) + 1 if done == len(out) else count
        return candidates

    return fill


def on_host(shape):
    return np.empty(shape, np.float32)


def with_numpy(model):
    generator = None

    def set_seed(seed):
        nonlocal generator
        generator = np.random.Generator(np.random.SFC64(seed))

    def draw(count):
        spectra = generator.standard_normal((count, len(model.gain)), dtype=np.float32) @ model.gain + model.mean
        return spectra, np.flatnonzero(((spectra > 0) & (spectra < model.limit)).all(axis=1))

    set_seed(0)
    return in_blocks(draw, set_seed, BLOCK), on_host


def with_torch(model):
    on_card = torch.cuda.is_available()
    device = torch.device("cuda" if on_card else "cpu")
    mean, gain = torch.from_numpy(model.mean).to(device), torch.from_numpy(model.gain).to(device)
    generator, limit = torch.Generator(device), float(model.limit)

    def draw(count):
        weights = torch.randn(count, len(gain), generator=generator, device=device)
        spectra = torch.addmm(mean, weights, gain)
        return spectra, ((spectra > 0) & (spectra < limit)).all(dim=1).nonzero()[:, 0]

    fill = in_blocks(draw, generator.manual_seed, 16 * BLOCK if on_card else BLOCK)

    def fill_and_wait(out, seed):
        candidates = fill(torch.as_tensor(out), seed)
        if on_card:
            torch.cuda.synchronize()
        return candidates

    return fill_and_wait, lambda shape: torch.empty(shape, device=device)


def with_numba(model):
    @numba.njit(parallel=True, fastmath=True)
    def fill_in_parallel(out, seed, mean, gain, limit):
        threads, count = numba.get_num_threads(), out.shape[0]
        components, bands = gain.shape
        candidates = np.zeros(threads, np.int64)
        for thread in numba.prange(threads):
            if seed >= 0:
                np.random.seed((seed * threads + thread) % (1 << 32))
            z, spectrum = np.empty(components, np.float32), np.empty(bands, np.float32)
            tries = 0
            for i in range(thread * count // threads, (thread + 1) * count // threads):
                accepted = False
                while not accepted:
                    tries += 1
                    for j in range(components):
                        z[j] = np.random.standard_normal()
                    accepted = True
                    for band in range(bands):
                        value = mean[band]
                        for j in range(components):
                            value += gain[j, band] * z[j]
                        spectrum[band] = value
                        accepted = accepted and 0 < value < limit
                for band in range(bands):
                    out[i, band] = spectrum[band]
            candidates[thread] = tries
        return candidates.sum()

    # No infinity where the compiler may suppose that there is none.
    limit = min(model.limit, np.finfo(np.float32).max)

    def fill(out, seed):
        return int(fill_in_parallel(out, -1 if seed is None else seed, model.mean, model.gain, limit))

    return fill, on_host


def say(text):
    sys.stdout.buffer.write(text.encode() + b"\n")
    sys.stdout.buffer.flush()


def serve(model, fill, peer):
    """Answers requests until standard input ends. Whoever asked is interrupted, and ends this."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    start = time.perf_counter()
    bands = len(model.mean)
    fill(on_host((1, bands)), 1)
    first = time.perf_counter() - start
    module = sys.modules[peer]
    python = ".".join(map(str, sys.version_info[:3]))
    threads = 1 if peer == "numpy" else module.get_num_threads()
    say(json.dumps({"version": module.__version__, "python": python, "threads": threads, "first_draw": first}))
    buffer = on_host((BLOCK, bands))
    for line in sys.stdin:
        count, seed = map(int, line.split())
        done, seconds, candidates = 0, 0.0, 0
        while done < count:
            out = buffer[: min(BLOCK, count - done)]
            start = time.perf_counter()
            candidates += fill(out, seed if done == 0 else None)
            seconds += time.perf_counter() - start
            say(str(len(out)))
            sys.stdout.buffer.write(out.data)
            done += len(out)
        say(f"0 {seconds!r} {candidates}")


PEERS = {"numpy": with_numpy, "numba": with_numba, "torch": with_torch}


def arguments():
    about = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    about.add_argument("model", metavar="MODEL.json", help="a model as `spectroll fit` writes it, of one Gaussian")
    about.add_argument("peer", choices=PEERS)
    about.add_argument("count", metavar="COUNT", nargs="?", type=lambda text: int(float(text)))
    about.add_argument("out", metavar="OUT.npy", nargs="?")
    return about.parse_args()


def main(asked):
    model = Model(asked.model)
    fill, empty = PEERS[asked.peer](model)
    if asked.count is None:
        serve(model, fill, asked.peer)
        return
    shape = (asked.count, len(model.mean))
    if asked.out:
        out = np.lib.format.open_memmap(asked.out, "w+", np.float32, shape)
        fill(out, 1)
        out.flush()
        return
    fill(empty((BLOCK, shape[1])), 1)  # compiles, and warms up
    rates = []
    for _ in range(3):
        out = empty(shape)
        start = time.perf_counter()
        fill(out, 1)
        rates.append(shape[0] / (time.perf_counter() - start) / 1e6)
    print(max(rates))


asked = arguments()
try:
    import numpy as np

    if asked.peer == "numba":
        import numba
    if asked.peer == "torch":
        import torch
except ImportError as error:
    if asked.count is not None:
        sys.exit(str(error))
    say(json.dumps({"error": str(error)}))
    sys.exit()
main(asked)

"""The same draws as one would write them in Python: reflectances of a Gaussian model, kept where all bands are in (0, 1).

    peers.py MODEL.txt COUNT numpy|numba [OUT.npy]

MODEL.txt has the mean (31 values), the basis (6 x 31) and the deviations of the weights (6). Prints million spectra a
second, the best of three runs; with OUT.npy it fills that file once, and prints nothing.
"""

import sys
import time

import numpy as np

BANDS, COMPONENTS, BLOCK = 31, 6, 1 << 18


def with_numpy(mean, gain):
    def fill(out, seed):
        generator, done = np.random.Generator(np.random.SFC64(seed)), 0
        while done < len(out):
            spectra = generator.standard_normal((BLOCK, COMPONENTS), dtype=np.float32) @ gain + mean
            spectra = spectra[((spectra > 0) & (spectra < 1)).all(axis=1)][: len(out) - done]
            out[done : done + len(spectra)] = spectra
            done += len(spectra)

    return fill


def with_numba(mean, gain):
    import numba

    @numba.njit(parallel=True, fastmath=True)
    def fill(out, seed):
        threads, count = numba.get_num_threads(), out.shape[0]
        for thread in numba.prange(threads):
            np.random.seed(seed + thread)
            z, spectrum = np.empty(COMPONENTS, np.float32), np.empty(BANDS, np.float32)
            for i in range(thread * count // threads, (thread + 1) * count // threads):
                accepted = False
                while not accepted:
                    for j in range(COMPONENTS):
                        z[j] = np.random.standard_normal()
                    accepted = True
                    for band in range(BANDS):
                        value = mean[band]
                        for j in range(COMPONENTS):
                            value += gain[j, band] * z[j]
                        spectrum[band] = value
                        accepted = accepted and 0 < value < 1
                for band in range(BANDS):
                    out[i, band] = spectrum[band]

    return fill


def main():
    path, count, peer, *file = sys.argv[1:]
    numbers = np.loadtxt(path).astype(np.float32)
    mean, basis, deviations = np.split(numbers, [BANDS, BANDS * (1 + COMPONENTS)])
    gain = basis.reshape(COMPONENTS, BANDS) * deviations[:, None]
    fill, shape = {"numpy": with_numpy, "numba": with_numba}[peer](mean, gain), (int(float(count)), BANDS)
    if file:
        out = np.lib.format.open_memmap(file[0], "w+", np.float32, shape)
        fill(out, 1)
        out.flush()
        return
    fill(np.empty((BLOCK, BANDS), np.float32), 1)  # compiles, and warms up
    rates = []
    for _ in range(3):
        out = np.empty(shape, np.float32)
        start = time.perf_counter()
        fill(out, 1)
        rates.append(shape[0] / (time.perf_counter() - start) / 1e6)
    print(max(rates))


main()

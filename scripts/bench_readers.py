"""How long it takes to read measured spectra, beside the usual reader of each format, in one process.

`python scripts/bench_readers.py [SPECTRA BANDS]`, with the package installed beside NumPy, SciPy, h5py, pandas, pyarrow and
zarr; nothing else should run. Readers take turns, and files are in memory, so that neither waits for a disk. What both
read is compared before anything is timed.
"""

import os
import shutil
import statistics
import sys
import tempfile
import time

import h5py
import numpy as np
import pandas as pd
import scipy.io
import zarr

import spectroll

ROUNDS = 5


def text(path, separator, decimal=".", rows=False):
    def make(wavelengths, spectra):
        table = pd.DataFrame(np.column_stack([wavelengths, spectra.T]) if not rows else spectra)
        if rows:
            table.columns = [f"{w:g}" for w in wavelengths]
        table.to_csv(path, sep=separator, decimal=decimal, index=False, float_format="%.6g", header=True)

    def read():
        table = pd.read_csv(path, sep=separator, decimal=decimal)
        return table.to_numpy() if rows else table.to_numpy()[:, 1:].T

    return make, read


def array(path):
    return lambda w, x: np.save(path, x), lambda: np.load(path).astype(np.float64)


def archive(path, save):
    return lambda w, x: save(path, wavelength=w, spectra=x), lambda: np.load(path)["spectra"].astype(np.float64)


def matlab(path, **options):
    make = lambda w, x: scipy.io.savemat(path, {"wavelength": w, "reflectance": x.T}, **options)
    return make, lambda: scipy.io.loadmat(path)["reflectance"].T.astype(np.float64)


def hdf5(path, **options):
    def make(w, x):
        with h5py.File(path, "w") as file:
            file["wavelength"] = w
            file.create_dataset("reflectance", data=x.astype(np.float32), **options)

    def read():
        with h5py.File(path) as file:
            return file["reflectance"][:].astype(np.float64)

    return make, read


def parquet(path):
    def make(w, x):
        pd.DataFrame(x.astype(np.float32), columns=[f"{each:g}" for each in w]).to_parquet(path)

    return make, lambda: pd.read_parquet(path).to_numpy().astype(np.float64)


def store(path, compressors):
    def make(w, x):
        group = zarr.open_group(path, mode="w")
        for name, values, chunks in [("wavelength", w, w.shape), ("spectra", x.astype(np.float32), (500, x.shape[1]))]:
            made = group.create_array(name, shape=values.shape, chunks=chunks, dtype=values.dtype, compressors=compressors)
            made[:] = values

    return make, lambda: zarr.open_group(path, mode="r")["spectra"][:].astype(np.float64)


def envi(path):
    def make(w, x):
        x.astype("<f4").tofile(path)
        head = {"samples": len(w), "lines": len(x), "bands": 1, "header offset": 0, "file type": "ENVI Spectral Library"}
        head |= {"data type": 4, "interleave": "bsq", "byte order": 0, "wavelength units": "Nanometers"}
        head |= {"wavelength": "{ " + ", ".join(f"{each:g}" for each in w) + " }"}
        with open(os.path.splitext(path)[0] + ".hdr", "w") as file:
            file.write("ENVI\n" + "".join(f"{key} = {value}\n" for key, value in head.items()))

    # As the Python package `spectral` does.
    return make, lambda: np.fromfile(path, "<f4").reshape(-1, BANDS).astype(np.float64)


def formats(folder):
    name = lambda name: os.path.join(folder, name)
    zstd, none = zarr.codecs.ZstdCodec(level=3), None
    return {
        "columns.csv": text(name("columns.csv"), ","),
        "rows.csv": text(name("rows.csv"), ",", rows=True),
        "decimal-commas.csv": text(name("decimal-commas.csv"), ";", ","),
        "tabs.txt": text(name("tabs.txt"), "\t"),
        "array.npy": array(name("array.npy")),
        "archive.npz": archive(name("archive.npz"), np.savez),
        "packed.npz": archive(name("packed.npz"), np.savez_compressed),
        "v5.mat": matlab(name("v5.mat")),
        "packed-v5.mat": matlab(name("packed-v5.mat"), do_compression=True),
        "plain.h5": hdf5(name("plain.h5")),
        "packed.h5": hdf5(name("packed.h5"), chunks=(500, BANDS), compression="gzip", shuffle=True),
        "table.parquet": parquet(name("table.parquet")),
        "plain.zarr": store(name("plain.zarr"), none),
        "zstd.zarr": store(name("zstd.zarr"), zstd),
        "library.sli": envi(name("library.sli")),
    }


def seconds(work):
    start = time.perf_counter()
    result = work()
    return time.perf_counter() - start, result


def main():
    # Smooth reflectances with a little noise, as instruments give them; six digits.
    rng = np.random.default_rng(0)
    wavelengths = np.arange(350.0, 350.0 + BANDS)
    waves = np.sin(np.outer(rng.uniform(0.5, 3, SPECTRA), wavelengths / 300) + rng.uniform(0, 6, (SPECTRA, 1)))
    spectra = np.round(0.5 + 0.35 * waves + rng.normal(0, 0.002, (SPECTRA, BANDS)), 6)
    memory = "/dev/shm" if os.path.isdir("/dev/shm") else None
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        print(f"{SPECTRA} spectra of {BANDS} bands, medians of {ROUNDS} rounds")
        for name, (make, read) in formats(folder).items():
            make(wavelengths, spectra)
            path = os.path.join(folder, name)
            measured_at = wavelengths if name.endswith(".npy") else None
            ours = lambda: spectroll.read(path, wavelengths=measured_at)
            (_, mine), (_, theirs) = seconds(ours), seconds(read)
            assert mine.shape == theirs.shape and np.array_equal(mine.wavelengths, wavelengths), name
            np.testing.assert_allclose(mine.values, theirs, rtol=1e-9, err_msg=name)
            del mine, theirs
            pairs = [(seconds(ours)[0], seconds(read)[0]) for _ in range(ROUNDS)]
            mine, theirs = (statistics.median(each) for each in zip(*pairs))
            ratios = sorted(a / b for a, b in pairs)
            print(f"  {name:20} {mine:7.3f} s, theirs {theirs:7.3f} s: {statistics.median(ratios):5.2f} x "
                  f"({ratios[0]:.2f} to {ratios[-1]:.2f})", flush=True)
            for entry in os.listdir(folder):
                whole = os.path.join(folder, entry)
                shutil.rmtree(whole) if os.path.isdir(whole) else os.remove(whole)


SPECTRA, BANDS = map(int, sys.argv[1:3]) if len(sys.argv) > 2 else (5000, 2151)

if __name__ == "__main__":
    main()

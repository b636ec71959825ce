"""Small data sets fitted by the program, against NumPy's singular values: few spectra, few bands, repeated spectra and
exact low rank, which are where a decomposition goes wrong.

    fit_small.py PROGRAM COUNT

Each is a CSV file of reflectances. A model must have NumPy's mean, variances and covariance over the bands to 1e-9 of
the largest; a refusal must name NumPy's rank.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np

TOLERANCE = 1e-9


def spectra(random):
    """Reflectances (bands, spectra) of one of several kinds, and its name."""
    bands, count = int(random.integers(2, 41)), int(random.integers(2, 13))
    data = random.uniform(0.05, 0.95, (bands, count))
    kind = int(random.integers(7))
    if kind == 1:  # spectra are repeated
        data = data[:, random.integers(0, max(1, count // 2), count)]
    elif kind == 2:  # combinations of a few
        rank = int(random.integers(1, 4))
        mixture = random.dirichlet(np.ones(rank), count).T
        data = data[:, :1].repeat(rank, 1) * 0.5 + 0.4 * random.uniform(0, 1, (bands, rank))
        data = data @ mixture
    elif kind == 3:  # digits as an instrument prints them
        data = data.round(int(random.integers(1, 4)))
    elif kind == 4:  # smooth, with values that fall off by powers of ten
        x = np.linspace(0, 1, bands)[:, None]
        orders = np.arange(8)
        data = 0.5 + np.cos(np.pi * x * orders) @ (random.normal(size=(8, count)) * 10.0 ** -(1 + orders)[:, None])
    elif kind == 5:  # next to no variation
        data = 0.5 + 1e-6 * (data - 0.5)
    elif kind == 6:  # bands that are alike
        data = data[random.integers(0, max(1, bands // 3), bands)]
    return data, kind


def fitted(program, folder, number):
    random = np.random.default_rng([2018, number])
    data, kind = spectra(random)
    bands, count = data.shape
    name = os.path.join(folder, str(number))
    rows = [",".join([str(400 + 10 * band)] + [repr(float(v)) for v in row]) for band, row in enumerate(data)]
    with open(f"{name}.csv", "w") as file:
        file.write("\n".join(rows) + "\n")
    mean = data.mean(axis=1)
    left, values, _ = np.linalg.svd(data - mean[:, None], full_matrices=False)
    noise = max(bands, count) * np.finfo(float).eps * max(values[0], np.abs(data).max())
    rank = int((values > noise).sum())
    k = int(random.integers(1, min(bands, count) + 1))
    grid = f"400:10:{390 + 10 * bands}"
    command = [program, "fit", f"{name}.csv", "--kind", "reflectance", "-k", str(k), "--wavelengths", grid,
               "-o", f"{name}.json"]
    run = subprocess.run(command, capture_output=True, text=True)
    what = f"{number}: kind {kind}, {bands} bands, {count} spectra, k = {k}, rank {rank}"
    if run.returncode:
        # What lies within a factor of ten of the tolerance may count or not.
        near = bool(np.any((values > noise / 10) & (values < noise * 10)))
        found = re.search(r"rank (\d+)|are identical|takes at least (\d+) spectra", run.stderr)
        assert found, f"{what}: {run.stderr}"
        if found[2]:
            assert k > count - 1, f"{what}: {run.stderr}"
        else:
            assert near or int(found[1] or 0) == rank < k, f"{what}: {run.stderr}"
        return "refused"
    model = json.load(open(f"{name}.json"))
    basis, covariance = np.array(model["basis"]), np.array(model["weight_covariance"])
    variances = values**2 / count
    assert np.abs(np.array(model["mean"]) - mean).max() < 1e-12, f"{what}: mean"
    error = np.abs(np.diag(covariance) - variances[:k]).max() / variances[0]
    assert error < TOLERANCE, f"{what}: variances are off by {error:.1e}"
    share = np.array(model["explained_variance"]) - variances[:k] / variances.sum()
    assert np.abs(share).max() < TOLERANCE, f"{what}: shares"
    # The covariance over bands does not depend on signs, nor on the basis of equal values, unless k parts them.
    if k == len(values) or values[k] < 0.999 * values[k - 1]:
        ours, theirs = basis.T @ covariance @ basis, (left[:, :k] * variances[:k]) @ left[:, :k].T
        gap = 1 - (values[k] / values[k - 1]) ** 2 if k < len(values) else 1
        error = np.abs(ours - theirs).max() / variances[0]
        assert error * gap < TOLERANCE, f"{what}: covariance is off by {error:.1e}"
    return "fitted"


def main(program, count):
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        ends = list(pool.map(lambda number: fitted(program, folder, number), range(int(count))))
    print(f"{ends.count('fitted')} fitted, {ends.count('refused')} refused with NumPy's rank")
    assert ends.count("fitted") > len(ends) / 2


main(*sys.argv[1:])

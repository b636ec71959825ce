"""Fits the built-in models once more, in NumPy and SciPy, and prints each one's mean and covariance over wavelengths as
JSON. Usage: fit_reference.py DATA_DIRECTORY [GRANADA_FILE]"""

import json
import pathlib
import sys

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.io import loadmat

COMPONENTS = 6


def table(path, variable, sampling):
    """Wavelengths, and spectra in columns."""
    mat = loadmat(path)
    start, step, count = mat[sampling].ravel()
    return start + step * np.arange(int(count)), mat[variable].astype(float)


def resample(wavelengths, spectra, grid):
    if np.isin(grid, wavelengths).all():
        return spectra[np.searchsorted(wavelengths, grid)]
    return CubicSpline(wavelengths, spectra, axis=0, bc_type="not-a-knot")(grid)


def fit(spectra):
    """Principal components of columns; covariances divide by their number."""
    mean = spectra.mean(axis=1)
    _, singular, basis = np.linalg.svd((spectra - mean[:, None]).T, full_matrices=False)
    basis = basis[:COMPONENTS]
    variances = singular[:COMPONENTS] ** 2 / spectra.shape[1]
    explained = singular[:COMPONENTS] ** 2 / (singular**2).sum()
    covariance = basis.T @ np.diag(variances) @ basis
    return {"mean": mean.tolist(), "covariance": covariance.tolist(), "explained": explained.sum()}


def main(data, granada=None):
    data = pathlib.Path(data)
    papers = table(data / "sur_nickerson.mat", "sur_nickerson", "S_nickerson")
    measured = (papers[0] >= 400) & (papers[0] <= 700)
    papers = papers[0][measured], papers[1][measured]
    surfaces = table(data / "sur_vrhel.mat", "sur_vrhel", "S_vrhel")
    models = {}
    for suffix, step in [("", 10), ("-5nm", 5)]:
        grid = np.arange(400.0, 701.0, step)
        models["munsell-vrhel" + suffix] = fit(np.hstack([resample(*papers, grid), resample(*surfaces, grid)]))
        if granada:
            daylights = resample(*table(granada, "daylightGranada", "S_granada"), grid)
            models["granada" + suffix] = fit(daylights / daylights.mean(axis=0))
    json.dump(models, sys.stdout)


main(*sys.argv[1:])

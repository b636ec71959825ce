"""Makes data/granada_compact.mat of the measured daylights and prints its error against them.

Usage: granada.py daylightGranadaLong.mat data/granada_compact.mat

Each measured spectrum is divided by its mean power; the mean and COMPONENTS principal components of the result are
kept in f32, and the weights as 16-bit whole numbers of STEP. spectrum = power * (mean + STEP * components . weights).
"""

import sys

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.io import loadmat, savemat

COMPONENTS = 80
STEP = 2.0**-10
MODEL_COMPONENTS = 6
GRIDS = ["400:10:700", "380:5:780", "300:5:1100", "400:2:720", "700:10:1000", "300:5:400"]
# MATLAB's header is free text; a fixed one makes the same file on every day.
HEADER = b"MATLAB 5.0 MAT-file: daylights of Granada, compact; made by scripts/granada.py"


def compact(spectra):
    """The variables of the file, of spectra in rows."""
    power = spectra.mean(axis=1)
    normalized = spectra / power[:, None]
    mean = normalized.mean(axis=0)
    _, _, components = np.linalg.svd(normalized - mean, full_matrices=False)
    components = components[:COMPONENTS].astype("f4")
    weights = np.rint((normalized - mean) @ components.T.astype(float) / STEP)
    assert abs(weights).max() <= np.iinfo("i2").max
    return {
        "granada_mean": mean.astype("f4")[:, None],
        "granada_components": components.T,
        "granada_weights": weights.astype("i2").T,
        "granada_weight_step": np.array([[STEP]]),
        "granada_power": power.astype("f4")[None, :],
    }


def expand(file):
    """Spectra in rows."""
    variable = {name: value.astype(float) for name, value in file.items() if name.startswith("granada_")}
    shapes = variable["granada_components"] @ (variable["granada_weights"] * variable["granada_weight_step"])
    return ((variable["granada_mean"] + shapes) * variable["granada_power"]).T


def fit(wavelengths, spectra, grid):
    """Mean, basis, standard deviations of the weights, and the share explained."""
    start, step, stop = map(float, grid.split(":"))
    grid = np.arange(start, stop + step / 2, step)
    if np.isin(grid, wavelengths).all():
        values = spectra[:, np.searchsorted(wavelengths, grid)]
    else:
        values = CubicSpline(wavelengths, spectra, axis=1)(grid)
    values = values / values.mean(axis=1, keepdims=True)
    mean = values.mean(axis=0)
    _, singular, basis = np.linalg.svd(values - mean, full_matrices=False)
    kept = singular[:MODEL_COMPONENTS]
    return mean, basis[:MODEL_COMPONENTS], kept / np.sqrt(len(values)), (kept**2).sum() / (singular**2).sum()


def errors(wavelengths, measured, expanded):
    """A row of the table in data/README.md for each grid."""
    yield "| grid | mean | angle of a basis vector | sd of a weight | variance explained |"
    yield "|---|---|---|---|---|"
    for grid in GRIDS:
        a, b = (fit(wavelengths, spectra, grid) for spectra in (measured, expanded))
        mean = abs(a[0] - b[0]).max()
        angle = np.degrees(np.arccos(np.clip(abs((a[1] * b[1]).sum(axis=1)), 0, 1))).max()
        deviation = abs(b[2] / a[2] - 1).max()
        yield f"| {grid} | {mean:.1e} | {angle:.2f}° | {100 * deviation:.2f} % | {100 * b[3]:.3f} % for {100 * a[3]:.3f} % |"


def main(source, target):
    file = loadmat(source)
    start, step, count = file["S_granada"].ravel()
    wavelengths = start + step * np.arange(int(count))
    measured = file["daylightGranada"].astype(float).T
    variables = compact(measured) | {"S_granada": np.array([[start, step, count]])}
    savemat(target, variables, do_compression=True)
    with open(target, "r+b") as out:
        out.write(HEADER.ljust(116))
    for line in errors(wavelengths, measured, expand(loadmat(target))):
        print(line)


main(*sys.argv[1:])

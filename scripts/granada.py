"""Makes data/granada-shapes.mat of the daylights measured at Granada, and says what it leaves out.

    python granada.py daylightGranadaLong.mat granada-shapes.mat

Each spectrum is divided by its mean power over the whole range, and the 56 largest of 161 principal components are
kept: basis and mean in f32, weights in 16 bits of the largest of each component. From these, models are fitted at any
grid. Needs NumPy and SciPy.
"""

import sys

import numpy as np
from scipy.io import loadmat, savemat

COMPONENTS = 56


def fit(spectra, components=6):
    """Mean, basis, standard deviations of weights, and explained share, as `spectroll fit` has them."""
    shapes = spectra / spectra.mean(0)
    mean = shapes.mean(1, keepdims=True)
    basis, singular, _ = np.linalg.svd(shapes - mean, full_matrices=False)
    k = components
    return mean, basis[:, :k], singular[:k] / shapes.shape[1] ** 0.5, (singular[:k] ** 2).sum() / (singular**2).sum()


def main(source, target):
    file = loadmat(source)
    spectra = file["daylightGranada"]
    powers = spectra.mean(0)
    shapes = spectra / powers
    mean = shapes.mean(1, keepdims=True)
    basis = np.linalg.svd(shapes - mean, full_matrices=False)[0][:, :COMPONENTS].astype(np.float32)
    weights = basis.T.astype(float) @ (shapes - mean)
    scale = np.abs(weights).max(1) / 32767
    parts = {
        "S_granada": file["S_granada"].astype(float),
        "mean": mean.astype(np.float32),
        "basis": basis,
        "scale": scale[:, None],
        "weights": np.round(weights / scale[:, None]).astype(np.int16),
        "powers": powers[None].astype(np.float32),
    }
    savemat(target, parts, do_compression=True)

    parts = {name: value.astype(float) for name, value in loadmat(target).items() if not name.startswith("__")}
    again = parts["powers"] * (parts["mean"] + parts["basis"] @ (parts["scale"] * parts["weights"]))
    error = again / powers - shapes
    print(f"shapes: rms error {np.sqrt((error**2).mean() / (shapes**2).mean()):.1e} of their rms")
    start, step = file["S_granada"][0, :2]
    for first, by, last in [(300, 5, 1100), (380, 5, 780), (400, 5, 700), (400, 10, 700), (300, 5, 400), (700, 5, 1100)]:
        bands = slice(int((first - start) / step), int((last - start) / step) + 1, int(by / step))
        a, b = fit(spectra[bands]), fit(again[bands])
        cosine = np.linalg.svd(a[1].T @ b[1])[1].min()
        print(
            f"| {first}:{by}:{last} | {np.abs(a[0] - b[0]).max():.1e} | {np.degrees(np.arccos(min(cosine, 1))):.2f} "
            f"| {100 * np.abs(b[2] / a[2] - 1).max():.2f} | {100 * a[3]:.3f} | {100 * b[3]:.3f} |"
        )


main(*sys.argv[1:])

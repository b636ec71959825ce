"""Draws about measured spectra in plain NumPy, against those of `spectroll sample`.

Runs in a folder with kernel.json, and spectra.npy and attempts.npy of its draws.

Shares the fitted model with the program, and nothing else: a measured spectrum is chosen with equal odds, and candidates about
it are made until one is physical, where the program chooses by odds that it estimates and changes the spectrum with each
candidate. Every comparison is a test at a false alarm rate of 1e-7; the first that fails ends it with its name.
"""

import json
import sys

import numpy as np
from scipy import stats

ALARM = 1e-7


def check(what, p):
    print(f"  {what}: p = {p:.3g}")
    if not p > ALARM:
        sys.exit(f"{what} differ")


def draws(model, count, random):
    """Weights of `count` draws, the spectrum that each is about, and the candidates that it took."""
    mean, basis = np.array(model["mean"]), np.array(model["basis"])
    h = model["distribution"]["bandwidth"]
    centre, covariance = np.array(model["weight_mean"]), np.array(model["weight_covariance"])
    centres = centre + np.sqrt(1 - h * h) * (np.array(model["distribution"]["weights"]) - centre)
    about = random.integers(len(centres), size=count)
    weights, tries, left = np.empty((count, len(basis))), np.zeros(count, int), np.arange(count)
    while len(left):
        noise = random.multivariate_normal(np.zeros(len(basis)), h * h * covariance, len(left), method="eigh")
        found = centres[about[left]] + noise
        spectra = mean + found @ basis
        physical = (spectra > 0).all(1)
        if model["kind"] == "reflectance":
            physical &= (spectra < 1).all(1)
        tries[left] += 1
        weights[left[physical]] = found[physical]
        left = left[~physical]
    return weights, about, tries


def main(*_):
    model = json.load(open("kernel.json"))
    mean, basis = np.array(model["mean"]), np.array(model["basis"])
    ours = (np.load("spectra.npy").astype(float) - mean) @ basis.T
    theirs, about, tries = draws(model, len(ours), np.random.default_rng(2018))
    for j in range(len(basis)):
        check(f"the distribution of weight {j + 1}", stats.ks_2samp(ours[:, j], theirs[:, j]).pvalue * len(basis))
    for name, f in (("means", lambda x: x), ("variances", lambda x: (x - x.mean(axis=0)) ** 2)):
        a, b = f(ours), f(theirs)
        z = (a.mean(axis=0) - b.mean(axis=0)) / np.sqrt(a.var(axis=0) / len(a) + b.var(axis=0) / len(b))
        check(name, np.min(2 * stats.norm.sf(np.abs(z))) * len(z))
    ours_tries = np.load("attempts.npy").astype(float).ravel()
    # Where next to nothing is rejected, a count of rejections has a variance of at least 1.
    variance = sum(max(x.var(), 1 / len(ours)) for x in (ours_tries, tries)) / len(ours)
    z = (ours_tries.mean() - tries.mean()) / np.sqrt(variance)
    check(f"attempts, {ours_tries.mean():.4f} and {tries.mean():.4f} a draw", 2 * stats.norm.sf(abs(z)))
    # Where bandwidths are small, a draw's nearest spectrum is mostly the one that it is about, and spectra have equal shares.
    centres = np.array(model["distribution"]["weights"])
    scale = 1 / np.sqrt(np.diag(np.array(model["weight_covariance"])))
    nearest = lambda w: np.argmin(  # noqa: E731
        ((w * scale) ** 2).sum(1)[:, None] - 2 * (w * scale) @ (centres * scale).T + ((centres * scale) ** 2).sum(1), axis=1
    )
    counts = [np.bincount(nearest(w), minlength=len(centres)) for w in (ours, theirs)]
    kept = counts[0] + counts[1] >= 20
    check("the shares of the measured spectra", stats.chi2_contingency(np.array([c[kept] for c in counts])).pvalue)
    print("they agree")

"""The conditions of Singh et al. (2018) in plain NumPy, against a data set of `spectroll scene`.

Shares the fitted models with the program, and nothing else: its own random numbers, rejection and statistics. Every
comparison is a test at a false alarm rate of 1e-7; the first that fails ends it with its name.
"""

import json
import sys

import numpy as np
from scipy import stats

ALARM = 1e-7
# The CIE 1931 luminous efficiency under D65, from the model's grid by way of the program's own spectra is what must not
# be used here: these are the published tables at 400:10:700.
Y_BAR = np.array([
    0.0004, 0.0012, 0.0040, 0.0116, 0.0230, 0.0380, 0.0600, 0.0910, 0.1390, 0.2080, 0.3230, 0.5030, 0.7100, 0.8620,
    0.9540, 0.9950, 0.9950, 0.9520, 0.8700, 0.7570, 0.6310, 0.5030, 0.3810, 0.2650, 0.1750, 0.1070, 0.0610, 0.0320,
    0.0170, 0.0082, 0.0041])
D65 = np.array([
    82.75, 91.49, 93.43, 86.68, 104.86, 117.01, 117.81, 114.86, 115.92, 108.81, 109.35, 107.80, 104.79, 107.69,
    104.41, 104.05, 100.00, 96.33, 95.79, 88.69, 90.01, 89.60, 87.70, 83.29, 83.70, 80.03, 80.21, 82.28, 78.28,
    69.72, 71.61])
LRV = Y_BAR * D65 / np.sum(Y_BAR * D65)
LEVELS = np.linspace(0.2, 0.6, 10)


def check(what, p):
    print(f"  {what}: p = {p:.3g}")
    if not p > ALARM:
        sys.exit(f"{what} differ")


class Model:
    def __init__(self, name):
        file = json.load(open(f"{name}.json"))
        self.mean, self.basis = np.array(file["mean"]), np.array(file["basis"])
        self.weight_mean, self.covariance = np.array(file["weight_mean"]), np.array(file["weight_covariance"])

    def candidates(self, random, count):
        weights = random.multivariate_normal(self.weight_mean, self.covariance, count, method="eigh")
        return self.mean + weights @ self.basis

    def project(self, spectra):
        return (spectra - self.mean) @ self.basis.T


def surfaces(model, random, count):
    s = model.candidates(random, count)
    accepted = np.all((s > 0) & (s < 1), axis=1)
    return s[accepted], accepted.mean()


def targets(model, random, count, level):
    s = model.candidates(random, count)
    t = s * (level / (s @ LRV))[:, None]
    accepted = np.all((s > 0) & (t > 0) & (t < 1), axis=1)
    return t[accepted], accepted.mean()


def same_moments(what, ours, theirs):
    """Means by z, variances by the asymptotic error of a variance, for each column."""
    for name, f in (("means", lambda x: x), ("variances", lambda x: (x - x.mean(axis=0)) ** 2)):
        a, b = f(ours), f(theirs)
        z = (a.mean(axis=0) - b.mean(axis=0)) / np.sqrt(a.var(axis=0) / len(a) + b.var(axis=0) / len(b))
        check(f"{what}: {name}", np.min(2 * stats.norm.sf(np.abs(z))) * len(z))


def same_acceptance(what, attempts, share, candidates):
    """Attempts are geometric; the reference's own error counts too."""
    ours = attempts.size / attempts.sum()
    error = np.sqrt(ours * (1 - ours) / attempts.sum() + share * (1 - share) / candidates)
    check(f"{what}: acceptance {ours:.4f} and {share:.4f}", 2 * stats.norm.sf(abs(ours - share) / max(error, 1e-6)))


def main(condition, path):
    data = np.load(path)
    random = np.random.default_rng(2018)
    granada, munsell = Model("granada"), Model("munsell-vrhel")
    lights, background, target = data["lights"], data["background"], data["target"]
    scenes, bands = len(target), 31
    assert target.shape == (scenes, 1, bands)
    assert background.shape == ((scenes,) if condition == "condition3" else ()) + (999, bands)
    print(condition)

    if condition == "condition1":
        # One light for all lights of all scenes, as it was drawn.
        assert lights.shape == (3, bands) and "lights_intensity" not in data
        assert np.all(lights == lights[0]) and np.all(lights > 0)
        assert abs(lights[0].mean() - 1) < 1e-5, "no factor"
    else:
        # One scale a scene, log-uniform.
        assert lights.shape == (scenes, 3, bands)
        scale = data["lights_intensity"]
        assert scale.shape == (scenes,) and 0.15 <= scale.min() and scale.max() <= 150
        uniform = np.log(scale / 0.15) / np.log(1000)
        check("intensities: Kolmogorov-Smirnov", stats.kstest(uniform, "uniform").pvalue)
        shapes = lights / scale[:, None, None]
        assert np.all(shapes > 0)
        same_moments("lights", granada.project(shapes.reshape(-1, bands)),
                     granada.project(granada.candidates(random, 200_000)))
        assert np.abs(shapes[:, 0] / shapes[:, 1] - 1).max() > 0.01, "the lights of a scene differ in shape"

    # The background.
    assert np.all((background > 0) & (background < 1))
    reference, share = surfaces(munsell, random, 400_000)
    flat = background.reshape(-1, bands)[:200_000]
    same_moments("background", munsell.project(flat), munsell.project(reference))
    same_acceptance("background", data["background_attempts"], share, 400_000)

    # The targets: scene s has level s modulo 10.
    levels = LEVELS[np.arange(scenes) % 10]
    assert np.abs(data["target_lrv"][:, 0] - levels).max() < 1e-6
    assert np.abs(target[:, 0] @ LRV - levels).max() < 2e-4, "to the rounding of the tables here"
    assert np.all((target > 0) & (target < 1))
    for number in (0, 4, 9):
        reference, share = targets(munsell, random, 200_000, LEVELS[number])
        same_moments(f"targets at {LEVELS[number]:.3f}", target[number::10, 0][:, ::3], reference[:, ::3])
        same_acceptance(f"targets at {LEVELS[number]:.3f}", data["target_attempts"][number::10], share, 200_000)


main(*sys.argv[1:])

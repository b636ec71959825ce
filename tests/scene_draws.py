"""Scenes once more, in NumPy and from their definition alone (docs/method.md, docs/scenes.md), against those of the
program, draw by draw.

Random scene files use every option away from its default, in windows of scenes across powers of two. Of each draw the
candidates are made again up to the one that the program accepted: that one must be acceptable and none before it, and
all arrays must hold its values, to within what rounding to f32 can do. A draw that rounding may have decided is
counted, and few may be. Shared with the program are fitted models, which `fit_reference.py` checks, and published
tables.

Left out are draws from covers, which `cover.rs` checks. The program turns to a cover only where fewer than half of the
candidates are accepted and a candidate has at most 12 normals. Here such groups accept more than that; those that it
never covers (targets of uniform LRV or of a hue, more normals) accept down to 1 % at their hardest.

Afterwards faults are planted here, one by one, and each must make a comparison fail.

Usage, in an empty folder: scene_draws.py PROGRAM ENGINE DATA_DIRECTORY FILES MOST_GROUPS
"""

import colorsys
import json
import pathlib
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.io import loadmat

SCENES = 24  # of each file
BORDERLINE = 1  # the most draws that rounding may have decided
LARGEST = 2e-6  # the largest difference of spectra, relative to the peak
ULP = 2.0**-24  # the largest relative error of a rounding to f32
LOW = 0xFFFFFFFF
QUANTITIES = ["spectra", "xyz", "chromaticity", "linear_srgb"]
SRGB = np.array([  # IEC 61966-2-1
    [3.2406255, -1.5372080, -0.4986286], [-0.9689307, 1.8757561, 0.0415175], [0.0557101, -0.2040211, 1.0569959]])
FAULTS = [
    "scenes wrap at 2^16", "scenes wrap at 2^20", "scenes wrap at 2^31", "seeds end at 32 bits", "names end at 24 bits",
    "attempts start at 1", "illuminants ignore cov_scale", "surfaces ignore cov_scale", "targets ignore cov_scale",
    "hues ignore cov_scale", "weights have no mean", "the root is Cholesky's", "a mean keeps its own power",
    "a mean ignores weight_mean", "fixed illuminants vary", "fixed surfaces vary", "lights of one shape differ",
    "each light takes the first's intensity", "shared intensities differ", "log_uniform covers 95 %",
    "data never give the last tenth", "lights have Y = 1", "levels are one late", "a uniform lrv is u^2",
    "a uniform lrv is of the first normal's word", "saturation and lightness share a word", "both means scaled",
    "both means base", "base means both", "scaled copies are of each scene", "copies aim at the first level"]

planted = None  # one of them


class Disagreement(Exception):
    pass


# Random words.


def philox(counter, seed):
    """Philox4x32-10 (Salmon et al. 2011): the four words of each counter, in a last axis."""
    a, b, c, d = np.broadcast_arrays(*(np.asarray(word).astype(np.uint64) for word in counter))
    for i in range(10):
        p, q = a * 0xD2511F53, c * 0xCD9E8D57
        k, l = (seed + i * 0x9E3779B9) & LOW, ((seed >> 32) + i * 0xBB67AE85) & LOW
        a, b, c, d = (q >> 32) ^ b ^ k, q & LOW, (p >> 32) ^ d ^ l, p & LOW
    return np.stack([a, b, c, d], axis=-1)


assert philox([LOW] * 4, 2**64 - 1).tolist() == [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD], "as in Random123"


def uniform(words):
    return (words + 0.5) / 2.0**32


class Stream:
    def __init__(self, seed, name):
        h = 0x811C9DC5  # FNV-1a
        for byte in name.encode():
            h = ((h ^ byte) * 0x01000193) & LOW
        self.seed = seed & LOW if planted == "seeds end at 32 bits" else seed
        self.id = h & 0xFFFFFF if planted == "names end at 24 bits" else (h >> 24) ^ (h & 0xFFFFFF)

    def words(self, place, scene, attempt, block):
        for bits in 16, 20, 31:
            scene = scene % 2**bits if planted == f"scenes wrap at 2^{bits}" else scene
        return philox([place, scene, attempt, self.id << 8 | block], self.seed)

    def own(self, place, scene, number):
        """A uniform number that belongs to a draw and not to an attempt."""
        return uniform(self.words(place, scene, 0, 255)[..., number])

    def normals(self, place, scene, attempt, count):
        """Normals of Box and Muller, and the radius of each."""
        blocks = np.arange(-(-count // 4))
        u = uniform(self.words(place[:, None], scene[:, None], attempt[:, None], blocks)).reshape(len(attempt), -1)
        radius, angle = np.sqrt(-2 * np.log(u[:, 0::2])), 2 * np.pi * u[:, 1::2]
        pairs = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
        return pairs.reshape(u.shape)[:, :count], np.repeat(radius, 2, axis=1)[:, :count]


# Models, and what is seen.


def affine(model):
    """The spectrum at normals of 0, and what each normal adds."""
    values, vectors = np.linalg.eigh(model.weight_covariance)
    root = vectors * np.sqrt(np.maximum(values, 0)) @ vectors.T
    if planted == "the root is Cholesky's" and values.min() > 0:
        root = np.linalg.cholesky(model.weight_covariance)
    weights = model.weight_mean * (planted != "weights have no mean")
    return model.mean + weights @ model.basis, root.T @ model.basis


class Observer:
    """The CIE 1931 observer and D65 on a grid, from the published tables."""

    def __init__(self, data, wavelengths):
        def table(variable, name):
            file = loadmat(data / f"{variable}.mat")
            start, step, count = file[f"S_{name}"].ravel()
            spectra = np.squeeze(file[variable]).astype(float)
            return CubicSpline(start + step * np.arange(int(count)), spectra, axis=-1)(wavelengths)

        self.cmf, self.d65 = table("T_xyz1931", "xyz1931"), table("spd_D65", "D65")
        self.step = wavelengths[1] - wavelengths[0]

    def weights(self, kind="reflectance"):
        """Weights of the bands in X, Y and Z: for lights absolute, for reflectances relative to a perfect white."""
        if kind == "illuminant" and planted != "lights have Y = 1":
            return self.cmf.T * self.step
        return (self.cmf * self.d65 / (self.cmf[1] @ self.d65)).T


def see(quantity, weights, spectra, bound):
    """A quantity of spectra, and how far off it may be."""
    weights = weights @ SRGB.T if quantity == "linear_srgb" else weights
    seen, bound = spectra @ weights, bound @ np.abs(weights)
    if quantity != "chromaticity":
        return seen, bound
    total, seen = seen.sum(axis=-1, keepdims=True), seen[..., :2]
    return seen / total, (bound[..., :2] + seen / total * bound.sum(axis=-1, keepdims=True)) / total


# Draws.


def levels(lrv, scene, u):
    """The LRV of each target, the largest there can be, and the number of levels."""
    if isinstance(lrv, dict) and "uniform" in lrv:
        low, high = lrv["uniform"]
        return low + (high - low) * (u**2 if planted == "a uniform lrv is u^2" else u), high, None
    lrv = np.linspace(lrv["from"], lrv["to"], lrv["levels"]) if isinstance(lrv, dict) else np.atleast_1d(lrv)
    return lrv[(scene - (planted == "levels are one late")) % len(lrv)], lrv.max(), len(lrv)


def colours(hue, scene, u, v):
    """XYZ of the hues of the scenes, at parts u and v of the ranges of saturation and lightness."""
    number = (scene - (planted == "levels are one late")) % hue["levels"]
    between = lambda ends, x: ends[0] + (ends[1] - ends[0]) * x
    hsv = number / hue["levels"], between(hue["saturation"], u), between(hue["lightness"], v)
    return np.stack(np.vectorize(colorsys.hsv_to_rgb)(*hsv), axis=-1) @ np.linalg.inv(SRGB).T


def condition(centre, gain, weights, xyz):
    """The map of the normals that are left when XYZ are given. The distribution leaves their axes open; those of
    `src/program/condition.rs` are the columns of the projector on what leaves XYZ alone, the longest first, each
    without its part along those before: a pivoted Cholesky factor."""
    seen = (gain @ weights).T
    inverse = np.linalg.pinv(seen)
    left, axes = np.eye(len(gain)) - inverse @ seen, []
    for _ in range(len(gain) - 3):
        pivot = np.argmax(np.diag(left))
        axes.append(left[pivot] / np.sqrt(left[pivot, pivot]))
        left = left - np.outer(axes[-1], axes[-1])
    return centre + (xyz - centre @ weights) @ inverse.T @ gain, np.array(axes) @ gain


class Draws:
    """Draws of a group for each scene and place, two arrays of one shape."""

    def __init__(self, file, group, scene, place):
        observer, kind = file.observer, "hue" if "hue" in group else group["kind"]
        self.group, self.model, self.stream = group, file.models[group["model"]], Stream(file.seed, group["name"])
        self.row, self.place, self.weights = scene, place, observer.weights()
        self.lrv, self.label, self.xyz = None, None, group.get("xyz")
        self.centre, self.gain = affine(self.model)
        self.gain = self.gain * np.sqrt(1 if planted == f"{kind}s ignore cov_scale" else group.get("cov_scale", 1))
        if "mean" in group:
            mean = {"d65": observer.d65, "flat": np.ones_like(observer.d65)}.get(group["mean"])
            if mean is None:
                mean = CubicSpline(*np.loadtxt(group["mean"], delimiter=",").T)(self.model.wavelengths)
            power = np.mean(self.model.mean if planted == "a mean ignores weight_mean" else self.centre)
            self.centre = mean if planted == "a mean keeps its own power" else mean / np.mean(mean) * power
        if group.get("fixed") and planted != f"fixed {kind}s vary":
            self.row = 0 * scene
        if group.get("same_shape") and planted != "lights of one shape differ":
            self.place = 0 * place
        if "lrv" in group:
            self.aim(scene, place)
        if "hue" in group:
            second = 0 if planted == "saturation and lightness share a word" else 1
            u, v = self.stream.own(place, scene, 0), self.stream.own(place, scene, second)
            self.xyz = colours(group["hue"], scene, u, v)
        if self.xyz is not None:
            self.xyz = np.broadcast_to(self.xyz, scene.shape + (3,))
            self.label = self.xyz[..., 1]
            self.centre, self.gain = condition(self.centre, self.gain, self.weights, self.xyz.reshape(-1, 3))
        self.centre = np.broadcast_to(self.centre, (scene.size, len(self.model.mean)))

    def aim(self, scene, place):
        """Sets the LRV to draw at, and that to scale to."""
        u = self.stream.own(place, scene, 0)
        if planted == "a uniform lrv is of the first normal's word":
            u = uniform(self.stream.words(place, scene, 0, 0)[..., 0])
        self.label, largest, count = levels(self.group["lrv"], scene, u)
        copies, self.lrv = self.group.get("copies", "independent"), self.label
        if copies != "independent":
            self.lrv = np.full(scene.shape, largest)
            if planted == "copies aim at the first level":
                self.lrv = levels(self.group["lrv"], 0 * scene, 0 * u)[0]
        if copies == "scaled":
            self.row = scene if planted == "scaled copies are of each scene" else scene // count
        if copies == "same_shape":
            self.row = 0 * scene

    def candidates(self, index, attempt):
        """Scaled spectra, how far off they may be in f32, and by how many times as much they are within bounds.

        A spectrum is a sum of k + 1 products of two rounded numbers, of which a normal is off by 4.5 roundings of its
        radius at most (`src/random/normal.rs`). Its LRV is a sum of as many products as there are bands."""
        normals, radius = self.stream.normals(self.place.flat[index], self.row.flat[index], attempt, len(self.gain))
        spectra = self.centre[index] + normals @ self.gain
        bound = (len(self.gain) + 8) * ULP * (np.abs(self.centre[index]) + radius @ np.abs(self.gain))
        bounds = self.group.get("bounds", "base")
        if planted and planted.startswith(f"{bounds} means "):
            bounds = planted.split()[-1]
        room = [spectra / bound]
        if self.model.kind == "reflectance" and bounds != "scaled":
            room.append((1 - spectra) / bound)
        if self.lrv is not None:
            y = spectra @ self.weights[:, 1:2]
            factor = self.lrv.flat[index][:, None] / y
            relative = bound @ self.weights[:, 1:2] / np.abs(y) + (len(self.weights) + 8) * ULP
            spectra, bound = spectra * factor, (bound + np.abs(spectra) * relative) * np.abs(factor)
            if bounds != "base":
                room.append((1 - spectra) / bound)
        return spectra, bound, np.min(room, axis=(0, 2))

    def accepted(self, attempts, tally):
        """Spectra of all draws, and how far off they may be, if each is of the first candidate that is acceptable."""
        # What several scenes or elements share is drawn once.
        _, first, each = np.unique(self.row * 2**16 + self.place, return_index=True, return_inverse=True)
        tries, each = attempts.flat[first], each.reshape(attempts.shape)
        if tries.min() < 1 or tries.max() > 10_000 or np.any(attempts != tries[each]):
            raise Disagreement(f"attempts of {self.group['name']} are {attempts.tolist()}")
        last = np.cumsum(tries) - 1
        index, attempt = np.repeat(first, tries), np.arange(last[-1] + 1) - np.repeat(last + 1 - tries, tries)
        spectra, bound, wrong = self.candidates(index, attempt + (planted == "attempts start at 1"))
        wrong[last] *= -1
        if wrong.max() >= 1:
            i = np.argmax(wrong)
            raise Disagreement(f"{self.group['name']}: candidate {attempt[i]} of {attempts.flat[index[i]]} of scene "
                               f"{self.row.flat[index[i]]} is {wrong[i]:.3g} times its rounding on the wrong side")
        tally["borderline"] += np.unique(index[wrong >= 0]).size
        tally.update(groups=1, draws=len(first), candidates=len(index))
        return spectra[last][each], bound[last][each]


# Arrays.


def intensities(file, group, scene, place):
    """The intensity of each light, and how far off it may be relative to that."""
    law, stream = group.get("intensity", 1.0), Stream(file.seed, group["name"])
    if not isinstance(law, dict):
        return np.full(scene.shape, law), 0.0
    shared = law.get("shared") and planted != "shared intensities differ"
    u = stream.own(0 * place if shared or planted == "each light takes the first's intensity" else place, scene, 0)
    if "log_uniform" in law:
        low, high = np.log2(law["log_uniform"])
        octaves = (high - low) * (0.95 if planted == "log_uniform covers 95 %" else 1)
        return 2 ** (low + octaves * u), (3 * octaves + 6) * ULP
    powers = file.models[group["model"]].powers
    count = len(powers) * (0.9 if planted == "data never give the last tenth" else 1)
    return powers[(count * u).astype(int)], ULP


def expected(file, group, attempts, tally):
    """The arrays of a group, and how far off each value may be."""
    name, once = group["name"], group.get("fixed", False)
    scene, place = np.meshgrid(np.arange(*file.window), np.arange(group.get("count", 1)), indexing="ij")
    arrays = {}

    def put(quantity, value, bound=0.0, once=False):
        pair = value, bound + 3 * ULP * np.abs(value)
        arrays[name if quantity == "spectra" else f"{name}_{quantity}"] = [v[0] for v in pair] if once else pair

    if group.get("flat"):
        lrv, _, _ = levels(group.get("lrv", {"uniform": [0, 1]}), scene, Stream(file.seed, name).own(place, scene, 0))
        spectra = np.repeat(lrv[..., None], len(file.observer.d65), axis=-1)
        bound = ULP * spectra
    else:
        draws = Draws(file, group, scene, place)
        lrv, (spectra, bound) = draws.label, draws.accepted(attempts, tally)
        if "copies" in group:
            spectra, bound = (v * (lrv / draws.lrv)[..., None] for v in (spectra, bound))
        put("attempts", attempts, once=once)
    if lrv is not None:
        put("lrv", lrv)
    if "hue" in group:
        put("xyz", draws.xyz)
    intensity, relative = intensities(file, group, scene, place)
    varies = isinstance(group.get("intensity"), dict)
    if varies:
        pair = intensity, relative * intensity
        put("intensity", *([v[:, 0] for v in pair] if group["intensity"].get("shared") else pair))
    for quantity in group.get("quantities", ["spectra"]):
        if f"{name}_{quantity}" not in arrays:
            weights = file.observer.weights(group["kind"])
            value, off = (spectra, bound) if quantity == "spectra" else see(quantity, weights, spectra, bound)
            if quantity == "chromaticity":
                put(quantity, value, off, once)
            else:
                off = (off + np.abs(value) * relative) * intensity[..., None]
                put(quantity, value * intensity[..., None], off, once and not varies)
    return arrays


def compare(file, tally):
    """Compares every array of a file with what it should be."""
    found, arrays, spectra = file.arrays, {}, [group["name"] for group in file.groups]
    for group in file.groups:
        attempts = found.get(f"{group['name']}_attempts", np.ones(1)).astype(int)
        arrays |= expected(file, group, np.broadcast_to(attempts, (SCENES, group.get("count", 1))), tally)
    if set(found) != set(arrays) | {"wavelength", "attributes"}:
        raise Disagreement(f"arrays are {sorted(found)}, not {sorted(arrays)}")
    for name, (value, bound) in arrays.items():
        kind = value.shape, np.uint32 if name.endswith("_attempts") else np.float32
        if kind != (found[name].shape, found[name].dtype):
            raise Disagreement(f"{name} is {found[name].dtype} of {found[name].shape}, not {kind}")
        off = np.abs(found[name] - value)
        if np.any(off > bound):
            at = np.unravel_index(np.argmax(off - bound), value.shape)
            raise Disagreement(f"{name}{list(map(int, at))} is {found[name][at]}, not {value[at]} to {bound[at]:.2g}")
        if name in spectra:
            tally["largest"] = max(tally["largest"], float(np.max(off / value.max(axis=-1, keepdims=True))))
    tally.update(scenes=SCENES, values=sum(value.size for value, _ in arrays.values()))


# Scene files.


class Generator:
    """Random scene files."""

    def __init__(self, program, data, seed):
        self.random = np.random.default_rng(seed)
        sky = np.column_stack([np.linspace(390, 710, 17), 40 + 30 * self.random.random(17)])
        np.savetxt("sky.csv", sky, delimiter=",")
        self.grids = {step: self.models(program, data, step, suffix) for step, suffix in [(10, ""), (5, "-5nm")]}

    def some(self, share):
        return self.random.random() < share

    def pick(self, values):
        return values[self.random.integers(len(values))]

    def between(self, low, high, size=None):
        return np.round(self.random.uniform(low, high, size), 4).tolist()

    def models(self, program, data, step, suffix):
        """An observer, and models by name: those that are built in, and others."""
        wavelengths, surfaces = np.arange(400, 701.0, step), pathlib.Path(f"surfaces{suffix}.json")
        fit = [program, "fit", "munsell", "vrhel", "--wavelengths", f"400:{step}:700", "-o", surfaces]
        subprocess.run(fit, check=True, capture_output=True)
        models = {f"munsell-vrhel{suffix}": surfaces, f"granada{suffix}": data / f"granada{suffix}.json"}
        for kind, k, deviation in [("illuminant", 3, 0.3), ("illuminant", 9, 0.3), ("reflectance", 4, 0.15),
                                   ("reflectance", 6, 0.15), ("reflectance", 12, 0.15), ("reflectance", 14, 0.2)]:
            name = f"{kind}-{k}{suffix}.json"
            models[name] = pathlib.Path(name)
            models[name].write_text(json.dumps(self.model(kind, wavelengths, k, deviation)))
        arrays = lambda text: {key: v if key == "kind" else np.array(v) for key, v in json.loads(text).items()}
        models = {name: SimpleNamespace(**arrays(path.read_text())) for name, path in models.items()}
        return Observer(data, wavelengths), models

    def model(self, kind, wavelengths, k, deviation):
        """A model that no fit makes: with a mean of its weights and, for 6 components and more, a full covariance."""
        x, normal = (wavelengths - 400) / 300, self.random.normal
        basis = np.linalg.qr(np.cos(np.pi * np.outer(x, np.arange(k))) @ normal(size=(k, k)))[0].T
        root = normal(size=(k, k)) if k >= 6 else np.diag(self.random.uniform(0.5, 1.5, k))
        covariance = root @ root.T * len(x) * deviation**2 / np.sum(root**2)
        mean = 1 + 0.3 * np.sin(5 * x) if kind == "illuminant" else 0.45 + 0.1 * np.sin(4 * x)
        powers = {"powers": self.between(0.2, 5, 10)} if kind == "illuminant" else {}
        return dict(schema=1, kind=kind, wavelengths=wavelengths.tolist(), mean=mean.tolist(), basis=basis.tolist(),
                    weight_mean=(0.05 * np.sqrt(len(x) / k) * normal(size=k)).tolist(),
                    weight_covariance=covariance.tolist(), explained_variance=[0] * k, normalization="none",
                    sources=[], **powers)

    def group(self, what, models):
        """A random group of illuminants, of surfaces or of targets with an aim."""
        pick, between, count = self.pick, self.between, int(self.random.integers(1, 8))
        is_light, is_target = what == "illuminant", what not in ("illuminant", "surface")
        name = pick("abcXYZ") + "".join(pick("abcdefghijklmnopqrstuvwxyzABCDEFG0123456789-_") for _ in range(6))
        low, high = between(0.05, 0.3), between(0.35, 0.6)
        lrv = pick([low, between(low, high, count), {"from": low, "to": high, "levels": count},
                    {"uniform": [low, between(0.5, 0.95)]}])
        copies = ["same_shape", "independent"] if "uniform" in str(lrv) else ["same_shape", "scaled", "scaled"]
        hue = dict(levels=1 + count % 3, saturation=sorted(between(0, 0.3, 2)), lightness=sorted(between(0.25, 0.6, 2)))
        xyz = np.array([0.95, 1, 1.09]) * between(0.2, 0.5) * between(0.9, 1.1, 3)
        law = pick([between(0.1, 9), {"from_data": True}, {"log_uniform": [low, low * between(1.5, 10_000)]}])
        if isinstance(law, dict) and self.some(0.5):
            law["shared"] = True
        # Each option with the share of the groups that have it.
        options = {
            "model": (1, pick([name for name in models if (models[name].kind == "illuminant") == is_light])),
            "count": (0.7 if is_target else 1, int(self.random.integers(1, 6))),
            "cov_scale": (0.5, between(0.2, pick([1.5, 4]))), "max_attempts": (0.3, pick([5000, 10**6])),
            "quantities": (0.5, self.random.permutation(QUANTITIES)[: self.random.integers(1, 5)].tolist())}
        options |= {
            "illuminant": {"intensity": (0.8, law), "mean": (0.4, pick(["d65", "flat", "sky.csv"])),
                           "same_shape": (0.3, True), "fixed": (0.25, True)},
            "surface": {"fixed": (0.25, True)},
            "lrv": {"lrv": (1, lrv), "bounds": (0.7, pick(["base", "scaled", "both"])), "copies": (0.5, pick(copies))},
            "hue": {"hue": (1, hue)},
            "xyz": {"xyz": (1, xyz.tolist())},
            "flat": {"flat": (1, True), "lrv": (0.7, lrv), "model": (0, None)}
        }[what]
        taken = {key: value for key, (share, value) in options.items() if self.some(share)}
        return {"kind": "target" if is_target else what, "name": name} | taken

    def fits(self, file, group):
        """Whether the program draws it, and without a cover. What is hardly ever rejected is mostly left out."""
        if group.get("flat"):
            return True
        bare = {key: value for key, value in group.items() if key not in ("fixed", "same_shape", "copies")}
        hue, scene, changes = group.get("hue"), np.arange(24)[:, None], [{}]
        if "lrv" in group:
            changes = [{"lrv": float(levels(group["lrv"], scene, 0)[1])}]
        if hue:
            corners = [(s, l) for s in hue["saturation"] for l in hue["lightness"]]
            changes = [{"hue": hue | {"saturation": [s, s], "lightness": [l, l]}} for s, l in corners]
        index, attempt = np.repeat(np.arange(24), 40), np.tile(np.arange(40), 24)
        draws = [Draws(file, bare | change, scene, 0 * scene) for change in changes]
        accepted = [(d.candidates(index, attempt)[2] > 0).reshape(24, 40) for d in draws]
        share = min(np.mean(a, axis=1 if hue else None).min() for a in accepted)
        is_plain = hue or "uniform" in str(group.get("lrv")) or len(draws[0].gain) > 12
        return share > (0.01 if is_plain else 0.6) and (share < 0.95 or self.some(0.2))

    def file(self, number, most):
        """A random scene file."""
        step = self.pick([10, 10, 5])
        observer, models = self.grids[step]
        end = [2**16, 2**20, 2**31, 2**32 - 5, int(self.random.integers(SCENES, 2**32 - 5))][number % 5] + 5
        file = SimpleNamespace(observer=observer, models=models, seed=int(self.random.integers(2**63)),
                               window=(end - SCENES, end), groups=[], name=f"{number}.toml")
        for _ in range(self.random.integers(1, most + 1)):
            what = self.pick(6 * ["illuminant"] + 4 * ["surface"] + 6 * ["lrv"] + 2 * ["hue"] + ["xyz", "flat"])
            while not self.fits(file, group := self.group(what, models)):
                pass
            file.groups.append(group)
        while end * sum(group.get("count", 1) for group in file.groups) > 1e11:  # the most draws that a file may have
            file.groups.pop()
        lines = [f"scenes = {end}", f"seed = {file.seed}"]
        if self.some(0.5) or all("model" not in group for group in file.groups):
            lines.append(f'wavelengths = "400:{step}:700"')
        for group in file.groups:
            lines += [f"[[{group['kind']}]]", *(f"{key} = {toml(v)}" for key, v in group.items() if key != "kind")]
        file.text = "\n".join(lines)
        return file


def toml(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(v)}" for key, v in value.items()) + " }"
    return json.dumps(value)


def main(program, engine, data, files, most_groups):
    global planted
    generator = Generator(program, pathlib.Path(data), seed=2018)

    def draw(file):
        pathlib.Path(file.name).write_text(file.text)
        window = "..".join(map(str, file.window))
        output = ["--scenes", window, "-o", f"{file.name}.npz", "--engine", engine, "-q"]
        done = subprocess.run([program, "scene", file.name, *output], capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{file.text}\n{done.stderr}")
        file.arrays = dict(np.load(f"{file.name}.npz"))
        return file

    def difference(file, tally):
        try:
            compare(file, tally)
        except Disagreement as e:
            return f"{file.text}\nscenes {file.window}: {e}"

    tally, drawn = Counter(), []
    with ThreadPoolExecutor(2) as pool:
        for file in pool.map(draw, (generator.file(number, int(most_groups)) for number in range(int(files)))):
            if text := difference(file, tally):
                sys.exit(text)
            drawn.append(file)
    print(engine, dict(tally))
    if tally["borderline"] > BORDERLINE or tally["largest"] > LARGEST:
        sys.exit("these are too many draws that rounding decided, or too large a difference")
    if engine != "cpu":
        return  # The faults are here, so the scenes of one engine will do.
    for planted in FAULTS:
        number = next((number for number, file in enumerate(drawn) if difference(file, Counter())), None)
        print(f"{planted}: in file {number}")
        if number is None:
            sys.exit(f"{planted}: no comparison fails")


if __name__ == "__main__":
    main(*sys.argv[1:])

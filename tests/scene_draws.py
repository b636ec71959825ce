"""Scenes once more, in NumPy and from their definition alone (docs/method.md, docs/scenes.md), against those of the
program, draw by draw.

Random scene files use every option away from its default, in windows of scenes across powers of two. Of each draw the
candidates are made again up to the one that the program accepted: that one must be acceptable and none before it, and
all arrays must hold its values, to within the rounding of f32. A draw of which rounding may have decided is counted,
and few may be. Shared with the program are fitted models, which `fit_reference.py` checks, and published tables.

Left out are draws from covers, which `cover.rs` checks. The program turns to a cover only where fewer than half of the
candidates are accepted and the model has at most 12 components. Here such groups accept more than that; those that it
never covers (targets of uniform LRV or of a hue, models of 14 components) accept down to 3 % at their hardest.

Afterwards faults are planted here, one by one, and each must make a comparison fail.

Usage, in an empty folder: scene_draws.py PROGRAM ENGINE DATA_DIRECTORY FILES GROUPS
"""

import colorsys
import json
import pathlib
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.io import loadmat

LOW = 0xFFFFFFFF
ULP = 2.0**-24  # the largest relative error of a rounding to f32
BORDERLINE = 3  # the most draws that rounding may have decided
SCENES = 12  # in each file
QUANTITIES = ["spectra", "xyz", "chromaticity", "linear_srgb"]
SRGB = np.array([  # IEC 61966-2-1
    [3.2406255, -1.5372080, -0.4986286], [-0.9689307, 1.8757561, 0.0415175], [0.0557101, -0.2040211, 1.0569959]])
FAULTS = [
    "scenes wrap at 2^16", "scenes wrap at 2^20", "scenes wrap at 2^31", "seeds end at 32 bits", "names end at 24 bits",
    "attempts start at 1", "lights ignore cov_scale", "surfaces ignore cov_scale", "targets ignore cov_scale",
    "hues ignore cov_scale", "weights have no mean", "the root is Cholesky's", "a mean keeps its own power",
    "a mean ignores weight_mean", "fixed lights vary", "fixed surfaces vary", "lights of one shape differ",
    "each light takes the first's intensity", "shared intensities differ", "log_uniform covers 95 %",
    "data never give the last tenth", "lights have Y = 1", "levels are one late", "a uniform lrv is u^2",
    "a uniform lrv is of the first normal's word", "saturation and lightness share a word", "both means scaled",
    "both means base", "base means both", "scaled copies are of each scene", "copies aim at the first level"]

planted = None  # one of them


class Disagreement(Exception):
    pass


def philox(counter, seed):
    """Philox4x32-10 (Salmon et al. 2011): the four words of each counter, in a last axis."""
    a, b, c, d = np.broadcast_arrays(*(np.asarray(word).astype(np.uint64) for word in counter))
    for i in range(10):
        p, q = a * 0xD2511F53, c * 0xCD9E8D57
        k, l = (seed + i * 0x9E3779B9) & LOW, ((seed >> 32) + i * 0xBB67AE85) & LOW
        a, b, c, d = (q >> 32) ^ b ^ k, q & LOW, (p >> 32) ^ d ^ l, p & LOW
    return np.stack([a, b, c, d], axis=-1)


assert philox([LOW] * 4, 2**64 - 1).tolist() == [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD], "Random123 has these"


def uniform(words):
    return (words + 0.5) / 2.0**32


class Stream:
    def __init__(self, seed, name):
        h = 0x811C9DC5  # FNV-1a
        for byte in name.encode():
            h = ((h ^ byte) * 0x01000193) & LOW
        self.seed = seed & LOW if planted == "seeds end at 32 bits" else seed
        self.id = h & 0xFFFFFF if planted == "names end at 24 bits" else (h & 0xFFFFFF) ^ (h >> 24)

    def words(self, place, scene, attempt, block):
        for bits in 16, 20, 31:
            scene = scene % 2**bits if planted == f"scenes wrap at 2^{bits}" else scene
        return philox([place, scene, attempt, self.id << 8 | block], self.seed)

    def own(self, place, scene, number):
        """A uniform number of the draw's own, besides those of its attempts."""
        return uniform(self.words(place, scene, 0, 255)[..., number])

    def normals(self, place, scene, attempt, count):
        """Normals of Box and Muller, and the radius of each."""
        blocks = np.arange(-(-count // 4))
        u = uniform(self.words(place[:, None], scene[:, None], attempt[:, None], blocks)).reshape(len(attempt), -1)
        radius, angle = np.sqrt(-2 * np.log(u[:, 0::2])), 2 * np.pi * u[:, 1::2]
        pairs = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
        return pairs.reshape(u.shape)[:, :count], np.repeat(radius, 2, axis=1)[:, :count]


class Model:
    def __init__(self, path):
        file = {key: np.array(value) for key, value in json.loads(path.read_text()).items()}
        self.is_light, self.powers = file["kind"] == "illuminant", file.get("powers")
        self.wavelengths, self.mean, self.basis = file["wavelengths"], file["mean"], file["basis"]
        self.weight_mean, self.covariance = file["weight_mean"], file["weight_covariance"]

    def affine(self):
        """Spectra at normals of 0, and what each adds."""
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0)) @ vectors.T
        if planted == "the root is Cholesky's" and values.min() > 0:
            root = np.linalg.cholesky(self.covariance)
        weights = 0 * self.weight_mean if planted == "weights have no mean" else self.weight_mean
        return self.mean + weights @ self.basis, root.T @ self.basis


class Observer:
    """The CIE 1931 observer and D65 on a grid, from the published tables."""

    def __init__(self, data, wavelengths):
        def table(file, name):
            file = loadmat(data / f"{file}.mat")
            start, step, count = file[f"S_{name}"].ravel()
            spectra = next(np.squeeze(v) for k, v in file.items() if k.endswith(f"_{name}") and not k.startswith("S_"))
            return CubicSpline(start + step * np.arange(int(count)), np.asarray(spectra, float), axis=-1)(wavelengths)

        self.cmf, self.d65 = table("T_xyz1931", "xyz1931"), table("spd_D65", "D65")
        self.step = wavelengths[1] - wavelengths[0]

    def weights(self, is_light):
        """Weights of the bands in X, Y and Z: for lights absolute, for reflectances relative to a perfect white."""
        if is_light and planted != "lights have Y = 1":
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


def levels(lrv, scene, u):
    """The LRV of each target, the largest there can be, and the number of levels."""
    if isinstance(lrv, dict) and "uniform" in lrv:
        low, high = lrv["uniform"]
        return low + (high - low) * (u**2 if planted == "a uniform lrv is u^2" else u), high, None
    lrv = np.linspace(lrv["from"], lrv["to"], lrv["levels"]) if isinstance(lrv, dict) else np.atleast_1d(lrv)
    return lrv[(scene - (planted == "levels are one late")) % len(lrv)], lrv.max(), len(lrv)


def colours(hue, scene, u, v):
    """XYZ of targets of a hue."""
    number = (scene - (planted == "levels are one late")) % hue["levels"]
    saturation, lightness = (low + (high - low) * x for (low, high), x in [(hue["saturation"], u), (hue["lightness"], v)])
    rgb = np.vectorize(colorsys.hsv_to_rgb)(number / hue["levels"], saturation, lightness)
    return np.stack(rgb, axis=-1) @ np.linalg.inv(SRGB).T


def condition(centre, gain, weights, xyz):
    """The map of the normals that are left when XYZ are given. Their axes are the columns of the projector on what leaves
    XYZ alone, the longest first, each without its part along those before: a pivoted Cholesky factor."""
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
        observer, hue = file["observer"], group.get("hue")
        self.group, self.model = group, file["models"][group["model"]]
        self.weights = observer.weights(False)
        self.stream = stream = Stream(file["seed"], group["name"])
        self.row, self.place, self.lrv, self.label, self.xyz = scene, place, None, None, group.get("xyz")
        kind = {"illuminant": "lights", "surface": "surfaces", "target": "hues" if hue else "targets"}[group["kind"]]
        self.centre, self.gain = self.model.affine()
        if "mean" in group:
            mean = {"d65": observer.d65, "flat": np.ones_like(observer.d65)}.get(group["mean"])
            if mean is None:
                mean = CubicSpline(*np.loadtxt(group["mean"], delimiter=",").T)(self.model.wavelengths)
            power = np.mean(self.model.mean if planted == "a mean ignores weight_mean" else self.centre)
            self.centre = mean if planted == "a mean keeps its own power" else mean / np.mean(mean) * power
        self.gain = self.gain * np.sqrt(1 if planted == f"{kind} ignore cov_scale" else group.get("cov_scale", 1))
        if group.get("fixed") and planted != f"fixed {kind} vary":
            self.row = 0 * scene
        if group.get("same_shape") and planted != "lights of one shape differ":
            self.place = 0 * place
        if "lrv" in group:
            first = planted == "a uniform lrv is of the first normal's word"
            u = uniform(stream.words(place, scene, 0, 0)[..., 0]) if first else stream.own(place, scene, 0)
            self.label, largest, count = levels(group["lrv"], scene, u)
            copies, self.lrv = group.get("copies", "independent"), self.label
            if copies != "independent":
                self.lrv = np.full(scene.shape, largest)
                if planted == "copies aim at the first level":
                    self.lrv[:] = levels(group["lrv"], 0 * scene, 0)[0]
            if copies == "scaled":
                self.row = scene if planted == "scaled copies are of each scene" else scene // count
            if copies == "same_shape":
                self.row = 0 * scene
        if hue:
            second = 0 if planted == "saturation and lightness share a word" else 1
            self.xyz = colours(hue, scene, stream.own(place, scene, 0), stream.own(place, scene, second))
        if self.xyz is not None:
            self.xyz = np.broadcast_to(self.xyz, scene.shape + (3,))
            self.label = self.xyz[..., 1]
            self.centre, self.gain = condition(self.centre, self.gain, self.weights, self.xyz.reshape(-1, 3))
        self.centre = np.broadcast_to(self.centre, (scene.size, len(self.model.mean)))

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
        if not self.model.is_light and bounds != "scaled":
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
        """Spectra of all draws, and how far off they may be, if each is the first that can be accepted."""
        # What several elements share is drawn once.
        _, first, each = np.unique(self.row * 2**16 + self.place, return_index=True, return_inverse=True)
        tries, each = attempts.flat[first], each.reshape(attempts.shape)
        if tries.min() < 1 or tries.max() > 10_000 or np.any(attempts != tries[each]):
            raise Disagreement(f"attempts of {self.group['name']} are {attempts.tolist()}")
        last = np.cumsum(tries) - 1
        index, attempt = np.repeat(first, tries), np.arange(last[-1] + 1) - np.repeat(last + 1 - tries, tries)
        spectra, bound, room = self.candidates(index, attempt + (planted == "attempts start at 1"))
        wrong = room.copy()
        wrong[last] *= -1
        if wrong.max() >= 1:
            i = np.argmax(wrong)
            raise Disagreement(f"{self.group['name']}: candidate {attempt[i]} of {attempts.flat[index[i]]} of scene "
                               f"{self.row.flat[index[i]]} is {wrong[i]:.3g} times its rounding on the wrong side")
        borderline = np.unique(index[wrong >= 0]).size
        tally.update(groups=1, draws=len(first), candidates=len(index), borderline=borderline)
        return spectra[last][each], bound[last][each]


def intensities(file, group, scene, place):
    """The intensity of each light, and how far off it may be relative to that."""
    law, stream = group.get("intensity", 1.0), Stream(file["seed"], group["name"])
    if not isinstance(law, dict):
        return np.full(scene.shape, law), 0.0
    shared = law.get("shared") and planted != "shared intensities differ"
    u = stream.own(0 * place if shared or planted == "each light takes the first's intensity" else place, scene, 0)
    if "log_uniform" in law:
        low, high = np.log2(law["log_uniform"])
        part = 0.95 if planted == "log_uniform covers 95 %" else 1
        return 2 ** (low + (high - low) * part * u), (3 * (high - low) + 6) * ULP
    powers = file["models"][group["model"]].powers
    part = 0.9 if planted == "data never give the last tenth" else 1
    return powers[(part * len(powers) * u).astype(int)], ULP


def expected(file, group, attempts, tally):
    """The arrays of a group, and how far off each value may be."""
    name, is_light, wanted = group["name"], group["kind"] == "illuminant", group.get("quantities", ["spectra"])
    scene, place = np.meshgrid(np.arange(*file["window"]), np.arange(group.get("count", 1)), indexing="ij")
    arrays = {}

    def put(quantity, value, bound=0.0, once=False):
        pair = value, bound + 3 * ULP * np.abs(value)
        arrays[name if quantity == "spectra" else f"{name}_{quantity}"] = [v[0] for v in pair] if once else pair

    if group.get("flat"):
        u = Stream(file["seed"], name).own(place, scene, 0)
        lrv, xyz = levels(group.get("lrv", {"uniform": [0, 1]}), scene, u)[0], None
        spectra = np.repeat(lrv[..., None], len(file["observer"].d65), axis=-1)
        bound = ULP * spectra
    else:
        draws = Draws(file, group, scene, place)
        lrv, xyz = draws.label, draws.xyz
        spectra, bound = draws.accepted(attempts, tally)
        if "copies" in group:
            spectra, bound = (v * (lrv / draws.lrv)[..., None] for v in (spectra, bound))
        put("attempts", attempts, once=group.get("fixed"))
    if lrv is not None:
        put("lrv", lrv)
    if "hue" in group:
        put("xyz", xyz)
    intensity, relative = intensities(file, group, scene, place)
    varies = isinstance(group.get("intensity"), dict)
    if varies:
        put("intensity", *(v[:, 0] if group["intensity"].get("shared") else v for v in (intensity, relative * intensity)))
    for quantity in wanted:
        if f"{name}_{quantity}" not in arrays:
            weights = file["observer"].weights(is_light)
            value, off = (spectra, bound) if quantity == "spectra" else see(quantity, weights, spectra, bound)
            i = 1 if quantity == "chromaticity" else intensity[..., None]
            once = group.get("fixed") and (not varies or quantity == "chromaticity")
            put(quantity, value * i, off * i + np.abs(value) * i * relative, once)
    return arrays


def compare(file, tally):
    """Compares every array of a file with what it should be."""
    found, arrays, scenes = file["arrays"], {}, file["window"][1] - file["window"][0]
    for group in file["groups"]:
        attempts = found.get(f"{group['name']}_attempts", np.ones(1)).astype(int)
        arrays |= expected(file, group, np.broadcast_to(attempts, (scenes, group.get("count", 1))), tally)
    if set(found) != set(arrays) | {"wavelength", "attributes"}:
        raise Disagreement(f"arrays are {sorted(found)}, not {sorted(arrays)}")
    for name, (value, bound) in arrays.items():
        if found[name].shape != value.shape:
            raise Disagreement(f"{name} has the shape {found[name].shape}, not {value.shape}")
        off = np.abs(found[name] - value)
        if np.any(off > bound):
            at = np.unravel_index(np.argmax(off - bound), value.shape)
            raise Disagreement(f"{name}{list(map(int, at))} is {found[name][at]}, not {value[at]} to {bound[at]:.2g}")
        tally["values"] += value.size
        if name in (group["name"] for group in file["groups"]):
            tally["largest"] = max(tally["largest"], np.max(off / np.abs(value).max(axis=-1, keepdims=True)))
    tally["scenes"] += scenes


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
        return Observer(data, wavelengths), {name: Model(path) for name, path in models.items()}

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
                    weight_covariance=covariance.tolist(), explained_variance=[0] * k, normalization="none", sources=[],
                    **powers)

    def group(self, models):
        """A random group."""
        pick, between, count = self.pick, self.between, int(self.random.integers(1, 8))
        kind = pick(["illuminant", "surface", "target"])
        name = pick("abcXYZ") + "".join(pick("abcdefghijklmnopqrstuvwxyzABCDEFG0123456789-_") for _ in range(6))
        low, high = between(0.05, 0.4), between(0.45, 0.6)
        lrv = pick([low, between(low, high, count), {"from": low, "to": high, "levels": count},
                    {"uniform": [low, between(0.5, 0.95)]}])
        copies = ["same_shape", "independent"] if "uniform" in str(lrv) else ["same_shape", "scaled", "scaled"]
        hue = {"levels": 1 + count % 3, "saturation": sorted(between(0, 0.3, 2)), "lightness": sorted(between(0.25, 0.6, 2))}
        law = pick([between(0.1, 9), {"from_data": True}, {"log_uniform": [low, low * between(1.5, 10_000)]}])
        if isinstance(law, dict) and self.some(0.5):
            law["shared"] = True
        # Each option with how often it is there.
        options = {
            "model": (1, pick([name for name, model in models.items() if model.is_light == (kind == "illuminant")])),
            "count": (1 if kind != "target" else 0.7, int(self.random.integers(1, 6))),
            "cov_scale": (0.5, between(0.2, 4)), "max_attempts": (0.3, pick([5000, 10**6])),
            "quantities": (0.5, self.random.permutation(QUANTITIES)[: self.random.integers(1, 5)].tolist())}
        options |= {
            "illuminant": {"intensity": (0.8, law), "mean": (0.4, pick(["d65", "flat", "sky.csv"])),
                           "same_shape": (0.3, True), "fixed": (0.25, True)},
            "surface": {"fixed": (0.25, True)},
            "target": pick(4 * [{"lrv": (1, lrv), "bounds": (0.7, pick(["base", "scaled", "both"])),
                                 "copies": (0.5, pick(copies))}] +
                           2 * [{"hue": (1, hue)}] + [{"flat": (1, True), "lrv": (0.7, lrv), "model": (0, "")}] +
                           [{"xyz": (1, (np.array([0.95, 1, 1.09]) * between(0.1, 0.6) * between(0.8, 1.2, 3)).tolist())}]),
        }[kind]
        return {"kind": kind, "name": name} | {key: value for key, (share, value) in options.items() if self.some(share)}

    def is_fit(self, file, group):
        """Whether the program draws it, and without a cover. What is hardly ever rejected is mostly left out."""
        if group.get("flat"):
            return True
        bare = {key: value for key, value in group.items() if key not in ("fixed", "same_shape", "copies")}
        hardest, scene = [bare], np.arange(24)[:, None]
        if "lrv" in group:
            hardest = [bare | {"lrv": float(levels(group["lrv"], scene, 0)[1])}]
        if "hue" in group:
            ends = [(s, l) for s in group["hue"]["saturation"] for l in group["hue"]["lightness"]]
            hardest = [bare | {"hue": group["hue"] | {"saturation": [s, s], "lightness": [l, l]}} for s, l in ends]
        index, attempt = np.repeat(np.arange(24), 40), np.tile(np.arange(40), 24)
        room = [Draws(file, group, scene, 0 * scene).candidates(index, attempt)[2].reshape(24, 40) for group in hardest]
        share = min(np.mean(room > 0, axis=1 if "hue" in group else None).min() for room in room)
        normals = len(file["models"][group["model"]].basis) - 3 * ("xyz" in group)
        is_plain = "hue" in group or "uniform" in str(group.get("lrv")) or normals > 12
        return share > (0.03 if is_plain else 0.6) and (share < 0.95 or self.some(0.2))

    def file(self, number, count):
        """A random scene file, which is written."""
        step = self.pick([10, 10, 5])
        observer, models = self.grids[step]
        end = self.pick([2**16, 2**20, 2**31, 2**32 - 5, int(self.random.integers(SCENES, 2**32 - 5))]) + 5
        file = dict(name=f"{number}.toml", seed=int(self.random.integers(2**63)), window=(end - SCENES, end),
                    observer=observer, models=models, groups=[])
        count = self.random.integers(1, count + 1)
        while len(file["groups"]) < count:
            group = self.group(models)
            if self.is_fit(file, group):
                file["groups"].append(group)
        while end * sum(group.get("count", 1) for group in file["groups"]) > 1e11:  # the most that a file may have
            file["groups"].pop()
        lines = [f"scenes = {end}", f"seed = {file['seed']}"]
        if self.some(0.5) or all("model" not in group for group in file["groups"]):
            lines.append(f'wavelengths = "400:{step}:700"')
        for group in file["groups"]:
            lines += [f"[[{group['kind']}]]", *(f"{key} = {toml(v)}" for key, v in group.items() if key != "kind")]
        file["text"] = "\n".join(lines)
        pathlib.Path(file["name"]).write_text(file["text"])
        return file


def toml(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(v)}" for key, v in value.items()) + " }"
    return json.dumps(value)


def main(program, engine, data, files, groups):
    global planted
    generator = Generator(program, pathlib.Path(data), seed=2018)
    files = [generator.file(number, int(groups)) for number in range(int(files))]

    def draw(file):
        window = "..".join(map(str, file["window"]))
        arguments = ["scene", file["name"], "--scenes", window, "-o", f"{file['name']}.npz", "--engine", engine, "-q"]
        if subprocess.run([program, *arguments]).returncode:
            sys.exit(f"{file['text']}\n{arguments} fails")
        file["arrays"] = dict(np.load(f"{file['name']}.npz"))

    def difference(file, tally):
        try:
            compare(file, tally)
        except Disagreement as e:
            return f"{file['text']}\n{e}"

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(draw, files))
    tally = Counter()
    for file in files:
        if text := difference(file, tally):
            sys.exit(text)
    print(engine, dict(tally))
    if tally["borderline"] > BORDERLINE:
        sys.exit(f"rounding decided of {tally['borderline']} draws")
    for planted in FAULTS:
        number = next((number for number, file in enumerate(files) if difference(file, Counter())), None)
        print(f"{planted}: in file {number}")
        if number is None:
            sys.exit(f"{planted}: no comparison fails")


if __name__ == "__main__":
    main(*sys.argv[1:])

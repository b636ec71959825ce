"""Responses, tristimulus values and luminous reflectances of the program's draws, against sums in NumPy with the published
tables, and with those of colour-science.

Usage, in an empty folder: sensors.py PROGRAM DATA_DIRECTORY
"""

import pathlib
import subprocess

import colour
import numpy as np
from scipy.io import loadmat

GRID = np.arange(400, 701, 10)
BOUND = 1e-6  # the largest difference, relative to a perfect white
SETS = {
    "cie1931": ("T_xyz1931", "CIE 1931 2 Degree Standard Observer"),
    "cie1964": ("T_xyz1964", "CIE 1964 10 Degree Standard Observer"),
    "ss2": ("T_cones_ss2", "Stockman & Sharpe 2 Degree Cone Fundamentals"),
    "ss10": ("T_cones_ss10", "Stockman & Sharpe 10 Degree Cone Fundamentals"),
    "smith-pokorny": ("T_cones_sp", None),  # theirs is another table of the same fundamentals
    "rods": ("T_rods", None),
    "melanopsin": ("T_melanopsin", None),
}
LAMPS = {"f2": "FL2", "f7": "FL7", "f11": "FL11"}
FAULTS = ["channels exchanged", "a band missing", "another illuminant", "lamps not averaged"]


def table(data, name):
    """The wavelengths and the functions of a table of the Psychophysics Toolbox, at the wavelengths of the grid."""
    file = loadmat(data / f"{name}.mat")
    start, step, count = file["S_" + name.split("_", 1)[1]].ravel()
    values = file[name] if name.startswith("T_") else file[name].T
    wavelengths = start + step * np.arange(int(count))
    at = [np.flatnonzero(wavelengths == w) for w in GRID]
    return np.array([values[:, i[0]] if len(i) else np.zeros(len(values)) for i in at]).T


def daylight(data, kelvin):
    """CIE 15:2004, section 3.1."""
    t = 1e3 / kelvin
    x = (0.244063, 0.237040)[kelvin > 7000] + (0.09911, 0.24748)[kelvin > 7000] * t
    x += (2.9678, 1.9018)[kelvin > 7000] * t**2 + (-4.6070, -2.0064)[kelvin > 7000] * t**3
    y = -3 * x * x + 2.870 * x - 0.275
    m = 0.0241 + 0.2562 * x - 0.7341 * y
    first, second = round((-1.3515 - 1.7703 * x + 5.9114 * y) / m, 3), round((0.03 - 31.4424 * x + 30.0717 * y) / m, 3)
    file = loadmat(data / "B_cieday.mat")
    basis = file["B_cieday"][(GRID - 380) // 5]
    return basis[:, 0] + first * basis[:, 1] + second * basis[:, 2]


def lamp(name, averaged=True):
    """A fluorescent lamp of the CIE by colour-science's table: from 5 nm to 10 nm by triangular averages."""
    spd = colour.SDS_ILLUMINANTS[LAMPS[name]]
    return sum(f * spd[GRID + d] for f, d in ((0.25, -5), (0.5, 0), (0.25, 5))) if averaged else spd[GRID]


def illuminants(data):
    light = {
        "d65": table(data, "spd_D65")[0],
        "a": colour.SDS_ILLUMINANTS["A"][GRID],
        "c": table(data, "spd_CIEC")[0],
        "e": np.ones(31),
        "5600K": daylight(data, 5600),
        "12000K": daylight(data, 12000),
    }
    light |= {name: daylight(data, nominal * 1.4388 / 1.438) for name, nominal in (("d50", 5e3), ("d55", 5.5e3), ("d75", 7.5e3))}
    return light | {name: lamp(name) for name in LAMPS}


def draw(program, *words):
    words = [program, "sample", "-n", "200", "--seed", "5", "--engine", "cpu", "-q", "-o", "a.npz", "--force", *words]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, (words, done.stderr)
    with np.load("a.npz") as file:
        return {name: file[name].astype(float) for name in file.files if file[name].dtype.kind == "f"}


def worst(name, found, expected, worsts):
    error = np.abs(found - expected).max()
    worsts.append((error, name))
    return error


def main(program, data):
    data = pathlib.Path(data)
    lights, worsts = illuminants(data), []
    # The tables are those that colour-science has.
    for name, (file, theirs) in SETS.items():
        if theirs:
            functions = colour.MSDS_CMFS[theirs].align(colour.SpectralShape(400, 700, 10)).values.T
            own = table(data, file)
            scale = (lights["d65"] * own).sum(1, keepdims=True)
            difference = np.abs((lights["d65"] * (functions - own)).sum(1) / scale[:, 0]).max()
            assert difference < BOUND, (name, difference)
    for name, theirs in (("d50", "D50"), ("d55", "D55"), ("d75", "D75"), ("d65", "D65"), ("c", "C")):
        difference = np.abs(colour.SDS_ILLUMINANTS[theirs][GRID] - lights[name]).max()
        assert difference < 6e-3, (name, difference)  # they have three decimals, of 100 at 560 nm

    # Every set under D65, and under every illuminant one.
    cases = [(name, "d65") for name in SETS] + [("ss2", light) for light in lights] + [("cie1964", "f11")]
    caught = {fault: 0 for fault in FAULTS}
    for sensors, light in cases:
        options = ("--sensors", sensors, "--illuminant", light)
        drawn = draw(program, "munsell-vrhel", "--quantities", "spectra,responses", *options)
        functions = table(data, SETS[sensors][0])
        weights = lights[light] * functions
        white = weights.sum(1)
        expected = drawn["spectra"] @ (weights.T / white)
        error = worst(f"{sensors} under {light}", drawn["responses"], expected, worsts)
        assert error < BOUND, (sensors, light, error)
        absolute = draw(
            program, "munsell-vrhel", "--quantities", "spectra,responses", "--response-scale", "absolute", *options
        )
        error = np.abs(absolute["responses"] / (10 * white) - expected).max()
        assert error < BOUND, (sensors, light, error)
        # What must be noticed.
        faulty = {
            "channels exchanged": expected[:, ::-1] if len(functions) > 1 else expected,
            "a band missing": drawn["spectra"][:, :-9] @ (weights.T / white)[:-9],
            "another illuminant": drawn["spectra"] @ ((w := lights["a" if light != "a" else "e"] * functions).T / w.sum(1)),
        }
        if light in LAMPS:
            w = lamp(light, averaged=False) * functions
            faulty["lamps not averaged"] = drawn["spectra"] @ (w.T / w.sum(1))
        for fault, values in faulty.items():
            caught[fault] += np.abs(drawn["responses"] - values).max() > BOUND
    assert all(caught.values()), caught

    # Lights, whose responses are absolute.
    lamps = draw(program, "granada", "--quantities", "spectra,responses", "--sensors", "ss10", "--intensity", "0.5..2")
    functions = 10 * table(data, "T_cones_ss10")
    expected = lamps["spectra"] @ functions.T
    assert np.abs(lamps["responses"] / expected - 1).max() < BOUND

    # Observers and illuminants of XYZ and LRV; targets.
    for observer in ("cie1931", "cie1964"):
        for light in ("d65", "a", "f11"):
            options = ("--observer", observer, "--illuminant", light, "--quantities", "spectra,xyz,lrv,linear_srgb")
            drawn = draw(program, "munsell-vrhel", *options)
            weights = lights[light] * table(data, SETS[observer][0])
            expected = drawn["spectra"] @ (weights.T / weights[1].sum())
            error = worst(f"xyz of {observer} under {light}", drawn["xyz"], expected, worsts)
            assert error < BOUND, (observer, light, error)
            assert np.abs(drawn["lrv"] - expected[:, 1]).max() < BOUND
            aimed = draw(program, "munsell-vrhel", *options, "--lrv", "0.2..0.6", "--bounds", "scaled")
            expected = aimed["spectra"] @ (weights[1] / weights[1].sum())
            assert np.abs(aimed["lrv"] - expected).max() < BOUND
            assert 0.2 <= aimed["lrv"].min() < 0.25 < 0.55 < aimed["lrv"].max() <= 0.6
    weights = lights["5600K"] * table(data, "T_cones_ss2")[0]
    options = ("--illuminant", "5600K", "--quantities", "spectra,lrv")
    aimed = draw(program, "munsell-vrhel", "--target", "ss2.L=0.3", *options)
    assert np.abs(aimed["spectra"] @ (weights / weights.sum()) - 0.3).max() < BOUND
    luminance = lights["5600K"] * table(data, "T_xyz1931")[1]
    assert np.abs(aimed["lrv"] - aimed["spectra"] @ (luminance / luminance.sum())).max() < BOUND

    # A camera and a lamp of files.
    camera = {"R": np.exp(-(((GRID - 600) / 40) ** 2)), "G": np.exp(-(((GRID - 540) / 45) ** 2)), "B": np.exp(-(((GRID - 460) / 30) ** 2))}
    rows = zip(GRID, *camera.values())
    pathlib.Path("camera.csv").write_text("nm," + ",".join(camera) + "\n" + "".join(",".join(f"{v:.17g}" for v in row) + "\n" for row in rows))
    power = 50 + 30 * np.sin(GRID / 40)
    pathlib.Path("lamp.csv").write_text("nm,power\n" + "".join(f"{w},{p:.17g}\n" for w, p in zip(GRID, power)))
    drawn = draw(program, "munsell-vrhel", "--sensors", "camera.csv", "--illuminant", "lamp.csv", "--quantities", "spectra,responses")
    weights = power * np.array(list(camera.values()))
    expected = drawn["spectra"] @ (weights.T / weights.sum(1))
    error = worst("a camera under a lamp", drawn["responses"], expected, worsts)
    assert error < BOUND, error
    aimed = draw(program, "munsell-vrhel", "--target", "camera.csv.G=0.4", "--illuminant", "lamp.csv")["spectra"]
    assert np.abs(aimed @ (weights[1] / weights[1].sum()) - 0.4).max() < BOUND
    error, name = max(worsts)
    print(f"{len(worsts)} comparisons; the largest difference is {error:.1e} of white, of {name}")

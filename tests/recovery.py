"""Metamers beside what colour-science recovers spectra by: the same colours, drawn uniformly from the sRGB cube.

Usage, in an empty folder: recovery.py PROGRAM DATA COLOURS [SLOW_COLOURS]

Of each method: the largest and the median error of the colour (of XYZ, relative to white), on the grid 400:10:700; the share
of spectra that are physical (between 0 and 1); their roughness (root mean square of second differences, times 1000); and
spectra per second. Jakob & Hanika's is optimised colour by colour, and is timed on the first SLOW_COLOURS alone.

The program's table of D65 has two decimals, in the folder DATA, and that of colour-science four, which makes 3e-5 in XYZ:
each method is judged by the table that it has.
"""

import subprocess
import sys
import time
import warnings

import numpy as np
from scipy.io import loadmat

warnings.simplefilter("ignore")
import colour  # noqa: E402

SHAPE = colour.SpectralShape(400, 700, 10)
CMFS = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(SHAPE)
D65 = colour.SDS_ILLUMINANTS["D65"].copy().align(SHAPE)


def weights(light):
    return light[:, None] * CMFS.values / (light * CMFS.values[:, 1]).sum()


def report(name, spectra, xyz, seconds, light=D65.values):
    error = np.abs(spectra @ weights(light) - xyz).max(1)
    physical = ((spectra >= 0) & (spectra <= 1)).all(1).mean()
    rough = 1e3 * np.sqrt((np.diff(spectra, 2, axis=1) ** 2).mean())
    print(
        f"| {name} | {len(xyz)} | {np.median(error):.1e} | {error.max():.1e} | {100 * physical:.1f} % | {rough:.1f} | "
        f"{len(xyz) / seconds:,.0f} |"
    )
    return error, physical


def main(program, data, count, slow):
    ours = loadmat(f"{data}/spd_D65.mat")["spd_D65"].ravel()[(400 - 380) // 5 :: 2][:31]
    rgb = np.random.default_rng(7).random((count, 3))
    linear = colour.models.eotf_sRGB(rgb)
    matrix = np.linalg.inv([[3.2406255, -1.537208, -0.4986286], [-0.9689307, 1.8757561, 0.0415175], [0.0557101, -0.2040211, 1.0569959]])
    xyz = linear @ matrix.T
    np.savetxt("c.csv", xyz, delimiter=",", fmt="%.12f")
    print("| method | colours | median error | largest | physical | roughness | per second |\n|---|---|---|---|---|---|---|")
    for name, each in (("this program, at random", 1), ("this program, the most probable", 0)):
        start = time.perf_counter()
        words = [program, "metamers", "c.csv", "--space", "xyz", "--engine", "cpu", "-q", "--force", "-o", "c.npz"]
        subprocess.run([*words, "--per-colour", str(each)], check=True)
        seconds = time.perf_counter() - start
        with np.load("c.npz") as file:
            spectra, status = file["spectra"].astype(float).reshape(count, 31), file["status"].ravel()
        error, physical = report(name, spectra, xyz, seconds, ours)
        answered = (status == 1) | (status == 2)
        assert error[answered].max() < 1e-5 and physical == 1 and answered.mean() > 0.995, (error.max(), answered.mean())
        print(f"  of these {np.bincount(status, minlength=5)} were skipped, sampled, mode, nearest, unreachable", file=sys.stderr)
    start = time.perf_counter()
    mallett = np.array([colour.recovery.RGB_to_sd_Mallett2019(c).align(SHAPE).values for c in linear])
    report("Mallett & Yuksel 2019", mallett, xyz, time.perf_counter() - start)
    start = time.perf_counter()
    otsu = np.array([colour.recovery.XYZ_to_sd_Otsu2018(c, CMFS, D65).align(SHAPE).values for c in xyz])
    report("Otsu et al. 2018", otsu, xyz, time.perf_counter() - start)
    start = time.perf_counter()
    jakob = np.array([colour.recovery.XYZ_to_sd_Jakob2019(c, CMFS, D65).align(SHAPE).values for c in xyz[:slow]])
    report("Jakob & Hanika 2019", jakob, xyz[:slow], time.perf_counter() - start)


if __name__ == "__main__":
    numbers = [int(number) for number in sys.argv[3:]]
    main(sys.argv[1], sys.argv[2], numbers[0], numbers[-1])

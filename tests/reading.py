"""Writes files of spectra as other people's programs do, and what is in them as JSON: name, wavelengths (nm) and spectra,
or a word of the refusal. Names may have an array and wavelengths behind them, as the program takes them."""
import decimal
import json
import os
import shutil
import sys

import h5py
import numcodecs
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
import zarr

os.chdir(sys.argv[1])
w = np.arange(400.0, 701.0, 10.0)
i = np.arange(1, 21)[:, None]
R = 0.45 + 0.2 * np.sin(i * 0.7) + 0.1 * np.cos(i * 1.3) * (w - 550) / 150 + 0.05 * np.sin(i * 2.1) * np.cos(w / 40)
cases = []


def right(name, spectra=R, wavelengths=w, **options):
    spectra = [[None if np.isnan(v) else float(v) for v in s] for s in np.asarray(spectra, float)]
    cases.append({"name": name, "wavelengths": list(map(float, wavelengths)), "spectra": spectra, **options})


def refused(name, *words, **options):
    cases.append({"name": name, "refused": list(words), **options})


# HDF5
def h5(name, **sets):
    with h5py.File(name, "w") as f:
        for key, value in sets.items():
            f[key.replace("__", "/")] = value
    return name


right(h5("int-wavelengths.h5", wavelength=w.astype("i4"), reflectance=R))
right(h5("big-endian.h5", wl=w.astype(">f4"), reflectance=R.astype(">f8")))
right(h5("group.h5", lib__wavelength=w, lib__reflectance=R))
right(h5("columns.h5", wavelength=w, reflectance=R.T))
right(h5("falling.h5", wavelength=w[::-1], reflectance=R[:, ::-1]))
right(h5("unnamed.h5", x=w, y=R))
right(h5("two.h5", a__wavelength=w, a__r=R, b__wavelength=w + 5, b__r=2 * R) + ":a/r")
refused("two.h5", "several matrices", "a/r", "b/r")
right(h5("waves.h5", r=R, wl=w, wavelength=w + 1) + ":r@wl")
refused("waves.h5", "several wavelengths", "r@wl")
refused(h5("square.h5", wavelength=w, r=R[:1].T @ R[:1]), "more than one side")
refused(h5("um.h5", wavelength=w / 1000, r=R), "um")
right("um.h5", unit="um")
with h5py.File("packed.h5", "w") as f:
    f["wavelength"] = w
    packed = np.round(R * 1e4).astype("i2")
    expected = packed * 1e-4 + 0.001
    packed[3, 4] = -32768
    packed[5, 6] = 12000
    expected[3, 4] = expected[5, 6] = np.nan
    d = f.create_dataset("reflectance", data=packed, chunks=(7, 31), compression="gzip", shuffle=True)
    d.attrs["scale_factor"], d.attrs["add_offset"], d.attrs["_FillValue"] = 1e-4, 0.001, np.int16(-32768)
    d.attrs["valid_range"] = np.array([-100, 10500], "i2")
right("packed.h5", expected)
with h5py.File("microns.h5", "w") as f:
    f["wavelength"] = w / 1000
    f["wavelength"].attrs["units"] = "micrometers"
    f["reflectance"] = R.astype("f4")
right("microns.h5", R.astype("f4"))
right(h5("half.h5", wavelength=w, reflectance=R.astype("f2")), R.astype("f2"))
refused(h5("long.h5", wavelength=w, reflectance=R.astype(np.longdouble)), "long.h5", "float64")
right(h5("half-big.h5", wavelength=w, reflectance=R.astype(">f2")), R.astype("f2"))

# MATLAB
def mat(name, **values):
    scipy.io.savemat(name, values, format=name[:1] if name[0] in "45" else "5", do_compression="zip" in name)
    return name


right(mat("5-conv.mat", sur_x=R.T, S_x=np.array([400.0, 10, 31])))
right(mat("4-conv.mat", sur_x=R.T, S_x=np.array([400.0, 10, 31])))
right(mat("5-zip.mat", data=R.T, wavelength=w))
right(mat("5-rows.mat", data=R, wl=w.astype("f4")))
right(mat("5-falling.mat", wavelength=w[::-1], data=R.T[::-1]))
right(mat("5-ints.mat", data=np.round(R.T * 100).astype("u1"), wave=w.astype("u2")), np.round(R * 100))
right(mat("5-cube.mat", cube=R.reshape(4, 5, 31), wavelength=w), R.reshape(4, 5, 31).transpose(1, 0, 2).reshape(20, 31))
right(mat("5-struct.mat", lib={"reflectance": R.T, "wavelength": w, "note": "text"}))
cell = np.empty((1, 1), object)
cell[0, 0] = R.T
right(mat("5-cell.mat", data=cell, lambda_=w) + "@lambda_")
uneven = 398 + 5.3 * np.arange(60) - 0.004 * np.arange(60) ** 2
U = np.array([np.interp(uneven, w, r) for r in R])
right(mat("5-uneven.mat", wavelength=uneven, data=U.T), U, uneven)
right(mat("5-nowave.mat", refl=R.T) + "@400:10:700")
refused("5-nowave.mat", "does not say at which wavelengths")
refused(mat("5-repeated.mat", wavelength=np.r_[w[:5], w[4], w[6:]], data=R.T), "440 stands twice")
refused(mat("5-index.mat", wavelength=np.arange(1.0, 32), data=R.T), "count from 1 to 31")

# NumPy
np.save("a.npy", R.astype("f4"))
right("a.npy@400:10:700", R.astype("f4"))
refused("a.npy@400:5:700", "61 wavelengths")
np.save("f.npy", np.asfortranarray(R))
right("f.npy@400:10:700")
np.save("c.npy", R.reshape(4, 5, 31))
right("c.npy@400:10:700")
np.savez("a.npz", reflectance=R, wavelengths=w)
right("a.npz")
np.savez_compressed("b.npz", r=R.T, wl=w.astype("i8"), names=np.array(["a"] * 20))
right("b.npz")

# Parquet
frame = pd.DataFrame(R, columns=[str(int(v)) for v in w])
frame.to_parquet("rows.parquet")
right("rows.parquet")
named = frame.copy()
named.insert(0, "sample", [f"leaf {n}" for n in range(20)])
named.to_parquet("named.parquet", compression="snappy")
right("named.parquet", names=list(named["sample"]))
# A name that is missing moves none of the others.
named.loc[2, "sample"] = None
named.to_parquet("unnamed.parquet", compression="none")
right("unnamed.parquet", names=["" if pd.isna(name) else name for name in named["sample"]])


def parquet(name, columns, metadata=None, **options):
    pq.write_table(pa.table(columns, metadata=metadata), name, compression="snappy", **options)
    return name


exact = [[decimal.Decimal(f"{v:.4f}") for v in column] for column in R.T]
columns = {str(int(v)): pa.array(values, pa.decimal128(9, 4)) for v, values in zip(w, exact)}
right(parquet("decimals.parquet", columns, store_decimal_as_integer=True), np.round(R, 4))
counts = np.round(R * 60000)
right(parquet("counts.parquet", {str(int(v)): column.astype("u2") for v, column in zip(w, counts.T)}), counts)
high = np.round(R * 4e9)
right(parquet("high.parquet", {str(int(v)): column.astype("u4") for v, column in zip(w, high.T)}), high)
waves = {"wavelength": json.dumps(list(w))}
lists = [list(spectrum) for spectrum in R]
right(parquet("lists.parquet", {"spectra": lists}, waves))
right(parquet("groups.parquet", {"spectra": lists}, waves, row_group_size=7))
lists[3][4] = None
gap = R.copy()
gap[3, 4] = np.nan
right(parquet("gap.parquet", {"spectra": lists}, waves), gap)
for packing in ["none", "snappy", "zstd"]:
    frame.to_parquet(f"{packing}.parquet", compression=packing)
    right(f"{packing}.parquet")
for packing in ["gzip", "Brotli", "LZ4"]:
    frame.to_parquet(f"{packing}.parquet", compression=packing.lower())
    refused(f"{packing}.parquet", f"packed by {packing}", 'compression="snappy"')
for name, at in [("first", 0), ("inner", 9), ("last", 19)]:
    for what, odd in [("twice", lists[0] * 2), ("short", lists[0][:-1]), ("empty", []), ("none", None)]:
        uneven = lists[:at] + [odd] + lists[at + 1 :]
        refused(parquet(f"{name}-{what}.parquet", {"spectra": uneven}, waves), "not of one length")
down = pd.DataFrame(R.T, columns=[f"s{n}" for n in range(20)])
down.insert(0, "wavelength", w)
down.to_parquet("columns.parquet", compression="none")
right("columns.parquet")
frame.to_csv("pandas.csv")
right("pandas.csv")
down.to_csv("pandas-columns.csv")
right("pandas-columns.csv")

# Zarr
for version in (2, 3):
    for packing in ("plain", "packed"):
        name = f"{packing}-{version}.zarr"
        g = zarr.open_group(name, mode="w", zarr_format=version)
        if version == 3:
            codec = {"compressors": None} if packing == "plain" else {}
        else:
            codec = {"compressors": None if packing == "plain" else numcodecs.Zstd()}
        for key, value, chunks in (("wavelength", w, (31,)), ("reflectance", R, (7, 10))):
            a = g.create_array(key, shape=value.shape, chunks=chunks, dtype=value.dtype, **codec)
            a[:] = value
        right(name)


def chunked(name, **options):
    g = zarr.open_group(name, mode="w", zarr_format=2)
    for key, value, chunks in (("wavelength", w, (31,)), ("reflectance", R, (7, 10))):
        g.create_array(key, shape=value.shape, chunks=chunks, compressors=None, **options | {"dtype": value.dtype})[:] = value
    return name


right(chunked("fortran.zarr", order="F"))
for packing in (numcodecs.GZip(), numcodecs.Zlib()):
    name = f"{packing.codec_id}.zarr"
    g = zarr.open_group(name, mode="w", zarr_format=2)
    for key, value in (("wavelength", w), ("reflectance", R)):
        a = g.create_array(key, shape=value.shape, chunks=value.shape, dtype=">f8", compressors=packing)
        a[:] = value
    right(name)
    chunk = f"{name}/reflectance/0.0"
    whole = open(chunk, "rb").read()
    # The last bytes are a sum.
    open(chunk, "wb").write(whole[:-4] + bytes(4))
    shutil.copytree(name, f"sum-{name}")
    refused(f"sum-{name}", "chunk 0.0 is damaged")
    open(chunk, "wb").write(whole)
# Chunks of more values than any array may have: small in the file, large in memory.
store = chunked("vast.zarr")
layout = json.load(open(f"{store}/reflectance/.zarray"))
json.dump(layout | {"dtype": "|u1", "chunks": [1, 1 << 28]}, open(f"{store}/reflectance/.zarray", "w"))
refused(store, "are more than", "values")
for name, change in [("short", lambda chunk: chunk[:-1]), ("long", lambda chunk: chunk + b"x")]:
    for order in "CF":
        store = chunked(f"{name}-{order}.zarr", order=order)
        chunk = f"{store}/reflectance/1.2"
        changed = change(open(chunk, "rb").read())
        open(chunk, "wb").write(changed)
        refused(store, "chunk 1.2", "copy it again")

# Spreadsheets, where a writer is there
try:
    down.to_excel("a.xlsx", index=False)
    right("a.xlsx")
    frame.to_excel("b.xlsx")
    right("b.xlsx")
except ImportError:
    print("no spreadsheets: openpyxl is missing", file=sys.stderr)

# ENVI
R.astype(">f4").tofile("lib.sli")
waves = ",\n ".join(f"{v / 1000:.3f}" for v in w)
open("lib.hdr", "w").write(
    f"ENVI\nsamples = 31\nlines = 20\nbands = 1\nheader offset = 0\nfile type = ENVI Spectral Library\ndata type = 4\n"
    f"interleave = bsq\nbyte order = 1\nwavelength units = Micrometers\nspectra names = {{\n a, b }}\nwavelength = {{\n {waves} }}\n"
)
right("lib.sli", R.astype("f4"))
right("lib.hdr", R.astype("f4"))

# Text of instruments
rows = "\n".join(" ".join([f'"{n}"'] + [f"{v:.4f}" for v in r]) for n, r in enumerate(R))
fields = " ".join(f"SPECTRAL_NM{v:.0f}" for v in w)
open("a.cgats", "w").write(
    f'CGATS.17\nORIGINATOR "x"\nNUMBER_OF_FIELDS 32\nBEGIN_DATA_FORMAT\nSAMPLE_ID {fields}\nEND_DATA_FORMAT\nNUMBER_OF_SETS 20\n'
    f"BEGIN_DATA\n{rows}\nEND_DATA\n"
)
right("a.cgats", np.round(R, 4))
open("a.dx", "w").write(
    "##TITLE= x\n##JCAMP-DX= 4.24\n##DATA TYPE= UV-VIS\n##XUNITS= NANOMETERS\n##YUNITS= REFLECTANCE\n##XFACTOR= 1\n##YFACTOR= 0.0001\n"
    "##FIRSTX= 400\n##LASTX= 700\n##NPOINTS= 31\n##XYDATA= (X++(Y..Y))\n"
    + "".join(f"{w[k]:.0f}" + "".join(f"+{round(v * 1e4)}" for v in R[0, k : k + 8]) + "\n" for k in range(0, 31, 8))
    + "##END=\n"
)
right("a.dx", np.round(R[:1] * 1e4) * 1e-4)
open("a.spdx", "w").write(
    '<?xml version="1.0"?><IESTM2714 xmlns="x"><SpectralDistribution><SpectralQuantity>flux</SpectralQuantity>'
    + "".join(f'<SpectralData wavelength="{v}">{r:.6f}</SpectralData>' for v, r in zip(w, R[0]))
    + "</SpectralDistribution></IESTM2714>"
)
right("a.spdx", np.round(R[:1], 6))
open("ecostress.txt", "w").write(
    "Name: Basalt\nType: Rock\nFirst Column: X\nSecond Column: Y\nX Units: Wavelength (micrometers)\nY Units: Reflectance (percent)\n"
    "First X Value: 0.7\nLast X Value: 0.4\nNumber of X Values: 31\nAdditional Information: none\n\n"
    + "".join(f"{v / 1000:.4f}\t{100 * r:.4f}\n" for v, r in zip(w[::-1], R[0, ::-1]))
)
right("ecostress.txt", np.round(100 * R[:1], 4))
refused("a.tif", "TIFF", setup=open("a.tif", "wb").write(b"II*\0" + bytes(200)))
refused("a.txt", "no table of numbers", setup=open("a.txt", "w").write("Dear all,\nplease find nothing attached.\n"))

json.dump(cases, open("cases.json", "w"))

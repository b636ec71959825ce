"""Measured spectra."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _spectroll
from ._values import Wavelengths, wavelengths_of, whole


def tables() -> list[str]:
    """The names of the tables of measured spectra that are built in, which `read` reads."""
    return list(_spectroll.TABLES)


class Spectra:
    """Measured spectra at their wavelengths; NumPy takes it for its `values`.

    Parameters
    ----------
    values : array, (spectra, bands)
        Reflectances from 0 to 1, or powers in any unit.
    wavelengths : array, (bands,), or text as in "400:10:700"
        In nm, increasing.
    kind : "reflectance" or "illuminant", optional
    name : str, optional
        Name in messages.
    notes : sequence of str, optional
        What was done to them, a sentence each.

    NaN stands for a value that was not measured.
    """

    __slots__ = ("_kind", "_name", "_notes", "_values", "_wavelengths")

    def __init__(
        self,
        values: ArrayLike,
        wavelengths: Wavelengths,
        *,
        kind: str | None = None,
        name: str = "the spectra",
        notes: Sequence[str] = (),
    ) -> None:
        given = wavelengths_of(wavelengths)
        if isinstance(given, str):
            given = _spectroll.wavelengths(given)
        self._set(np.array(values, np.float64, ndmin=2), np.array(given), kind, name, notes)

    def _set(
        self,
        array: NDArray[np.float64],
        grid: NDArray[np.float64],
        kind: str | None,
        name: str,
        notes: Sequence[str],
    ) -> None:
        if array.ndim != 2 or array.shape[1] != len(grid):
            shape = " x ".join(map(str, array.shape))
            raise ValueError(
                f"values of {shape} and {len(grid)} wavelengths: spectra are rows, with a value for each wavelength"
            )
        array.flags.writeable = grid.flags.writeable = False
        self._values, self._wavelengths, self._kind, self._name = array, grid, kind, name
        self._notes = tuple(notes)

    @classmethod
    def _of(cls, values: NDArray[np.float64], wavelengths: NDArray[np.float64], *named: Any) -> Spectra:
        """Spectra of arrays that nobody else has."""
        spectra = cls.__new__(cls)
        spectra._set(values, wavelengths, *named)
        return spectra

    @property
    def values(self) -> NDArray[np.float64]:
        """The spectra in rows: (spectra, bands) float64."""
        return self._values

    @property
    def wavelengths(self) -> NDArray[np.float64]:
        """The wavelengths in nm: (bands,) float64."""
        return self._wavelengths

    @property
    def kind(self) -> str | None:
        """"reflectance", "illuminant", or None where the file does not say it."""
        return self._kind

    @property
    def name(self) -> str:
        """Name in messages: the file, and what it takes to find the spectra in it."""
        return self._name

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done to them when they were read or brought to other wavelengths, a sentence each."""
        return self._notes

    def at(
        self,
        wavelengths: Wavelengths,
        *,
        resample: str = "auto",
        missing: str = "error",
        extrapolate: str = "error",
    ) -> Spectra:
        """The spectra at other wavelengths.

        Parameters
        ----------
        wavelengths : array in nm, or text as in "400:10:700"
        resample : "auto", "interpolate" or "average"
            By a not-a-knot cubic spline, or by averages around each wavelength, which keep the energy of every line. "auto"
            takes averages where these have structure that is finer than the new wavelengths, and says so in the notes.
        missing : "error", "drop" or "interpolate"
            What is done with spectra that lack a value.
        extrapolate : "error", "hold" or "zero"
            What is done beyond the measured wavelengths: "hold" takes the value at the nearer end.
        """
        given = wavelengths_of(wavelengths)
        own = (self._values, self._wavelengths, self._name)
        values, notes = _spectroll.resample(own, given, onto(resample, missing, extrapolate))
        return Spectra(values, wavelengths, kind=self._kind, name=self._name, notes=(*self._notes, *notes))

    @property
    def shape(self) -> tuple[int, int]:
        """(spectra, bands)."""
        return (self._values.shape[0], self._values.shape[1])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self._values, dtype=dtype) if copy else np.asarray(self._values, dtype=dtype)

    def __len__(self) -> int:
        return len(self._values)

    def __getitem__(self, key: Any) -> Any:
        return self._values[key]

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        return iter(self._values)

    def __reduce__(self) -> Any:
        return _restored, (self._values, self._wavelengths, self._kind, self._name, self._notes)

    def __repr__(self) -> str:
        count, bands = self.shape
        kind = f"{self._kind}s" if self._kind else "spectra"
        first, last = self._wavelengths[0], self._wavelengths[-1]
        return f"<Spectra: {count} {kind} of {self._name}, {bands} bands from {first:g} to {last:g} nm>"


def _restored(values: Any, wavelengths: Any, kind: str | None, name: str, notes: Sequence[str]) -> Spectra:
    return Spectra(values, wavelengths, kind=kind, name=name, notes=notes)


def onto(resample: str, missing: str, extrapolate: str) -> dict[str, str]:
    """How spectra come to other wavelengths, for the native half."""
    return {"resample": resample, "missing": missing, "extrapolate": extrapolate}


def read(
    path: str | os.PathLike[str],
    *,
    variable: str | None = None,
    wavelengths: Wavelengths | None = None,
    wavelength_variable: str | None = None,
    layout: str | None = None,
    unit: str | None = None,
    separator: str | None = None,
    decimal: str | None = None,
    skip: int = 0,
    missing_values: Sequence[float] | float = (),
    scale: float = 1.0,
) -> Spectra:
    """Measured spectra of a file, whose format is told by its content.

    Text of any dialect with spectra in columns or rows, MATLAB (v4 to v7.3), HDF5, NumPy (`.npy`, `.npz`), Parquet, Zarr,
    spreadsheets, ENVI libraries, JCAMP-DX, TM-27, and all that `write` writes. What is not as it must be is refused, with
    the place and the argument that mends it; what was changed stands in the notes of the result.

    Parameters
    ----------
    path : str or path
        A file or a folder; or the name of a table that is built in, such as "macbeth" or "houser".
    variable, wavelength_variable : str, optional
        Names of the arrays of spectra and of wavelengths, where a file holds several; or of the sheet.
    wavelengths : array in nm, or text as in "400:10:700", optional
        Where the spectra were measured, for files that do not say it: first, step and last, which is included.
    layout : "columns" or "rows", optional
        Direction of the spectra, where it is not found out.
    unit : "nm", "um", "angstrom" or "cm-1", optional
        Unit of the wavelengths; as the file states, or nm.
    separator : "," ";" "\\t" "|" or " ", optional
    decimal : "." or ",", optional
    skip : int
        Number of lines at the top of text that are left out.
    missing_values : float or a sequence of such
        Values that mean "not measured", as they stand in the file, such as -999. They become NaN.
    scale : float
        What all values are multiplied by: 0.01 makes reflectances of percentages.

    Returns
    -------
    Spectra
        Its `kind` is None where the file does not say what the spectra are.

    Raises `FileNotFoundError` where there is no such file, and `spectroll.DataError` where it is not what it should be.
    """
    settings = {
        "variable": variable,
        "wavelength_variable": wavelength_variable,
        "wavelengths": None if wavelengths is None else wavelengths_of(wavelengths),
        "layout": layout,
        "unit": unit,
        "separator": separator,
        "decimal": decimal,
        "skip": whole("skip", skip),
        "missing_values": np.atleast_1d(np.asarray(missing_values, np.float64)).tolist(),
        "scale": float(scale),
    }
    values, at, kind, name, notes = _spectroll.read(os.fspath(path), settings)
    return Spectra._of(values, at, kind, name, notes)

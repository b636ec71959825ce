"""Measured spectra."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _spectroll
from ._values import Wavelengths, wavelengths_of


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
    """

    __slots__ = ("_kind", "_name", "_values", "_wavelengths")

    def __init__(
        self, values: ArrayLike, wavelengths: Wavelengths, *, kind: str | None = None, name: str = "the spectra"
    ) -> None:
        array = np.array(values, np.float64, ndmin=2)
        given = wavelengths_of(wavelengths)
        if isinstance(given, str):
            given = _spectroll.wavelengths(given)
        grid = np.array(given)
        if array.ndim != 2 or array.shape[1] != len(grid):
            shape = " x ".join(map(str, array.shape))
            raise ValueError(
                f"values of {shape} and {len(grid)} wavelengths: spectra are rows, with a value for each wavelength"
            )
        array.flags.writeable = grid.flags.writeable = False
        self._values, self._wavelengths, self._kind, self._name = array, grid, kind, name

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

    def at(self, wavelengths: Wavelengths, *, extrapolate: str = "error") -> Spectra:
        """The spectra at other wavelengths: as they are where these were measured, and by a not-a-knot cubic spline
        between. `extrapolate` is "error", "hold" (the value at the nearer end) or "zero"."""
        given = wavelengths_of(wavelengths)
        values = _spectroll.resample((self._values, self._wavelengths, self._name), given, extrapolate)
        return Spectra(values, wavelengths, kind=self._kind, name=self._name)

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
        return _restored, (self._values, self._wavelengths, self._kind, self._name)

    def __repr__(self) -> str:
        count, bands = self.shape
        kind = f"{self._kind}s" if self._kind else "spectra"
        first, last = self._wavelengths[0], self._wavelengths[-1]
        return f"<Spectra: {count} {kind} of {self._name}, {bands} bands from {first:g} to {last:g} nm>"


def _restored(values: Any, wavelengths: Any, kind: str | None, name: str) -> Spectra:
    return Spectra(values, wavelengths, kind=kind, name=name)


def read(
    path: str | os.PathLike[str], *, variable: str | None = None, wavelengths: Wavelengths | None = None
) -> Spectra:
    """Measured spectra of a file.

    A `.csv`, `.tsv` or `.txt` file has the wavelengths in nm in its first column and a spectrum in each other. A `.mat`
    or `.h5` file has a matrix with its wavelengths beside it; `variable` picks one where there are several. A `.npy` file
    has spectra in rows, at `wavelengths`.

    Raises `FileNotFoundError` where there is no such file, and `DataError` where it is not what it should be.
    """
    given = None if wavelengths is None else wavelengths_of(wavelengths)
    values, at, kind, name = _spectroll.read(os.fspath(path), variable, given)
    return Spectra(values, at, kind=kind, name=name)

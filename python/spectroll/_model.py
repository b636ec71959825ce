"""Models."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _spectroll
from ._data import Spectra, onto
from ._values import Wavelengths, wavelengths_of, whole


def models() -> list[str]:
    """The names of the built-in models."""
    return list(_spectroll.BUILTIN)


class Model:
    """A model of spectra: a spectrum is `mean + weights @ basis`, and the weights are normal, or distributed as the measured ones.

    Parameters
    ----------
    name : str or path
        A built-in model ("munsell-vrhel": reflectances of Munsell papers and natural surfaces; "granada": daylights; with
        "-kernel" after it, as varied as the measured spectra), or a model file. `Model.fit` makes models of your own spectra.
    wavelengths : array in nm, or text as in "380:5:780", optional
        Where a built-in model is fitted (400:10:700).

    Models are immutable, and can be pickled, compared and used as keys.
    """

    __slots__ = ("_arrays", "_json", "_native")

    _native: _spectroll.Model
    _arrays: dict[str, NDArray[np.float64]]
    _json: str | None

    def __init__(
        self, name: str | os.PathLike[str] = "munsell-vrhel", wavelengths: Wavelengths | None = None
    ) -> None:
        given = None if wavelengths is None else wavelengths_of(wavelengths)
        self._set(_spectroll.Model.open(os.fspath(name), given))

    def _set(self, native: _spectroll.Model) -> None:
        object.__setattr__(self, "_native", native)
        object.__setattr__(self, "_arrays", {})
        object.__setattr__(self, "_json", None)

    @classmethod
    def _of(cls, native: _spectroll.Model) -> Model:
        model = cls.__new__(cls)
        model._set(native)
        return model

    @classmethod
    def fit(
        cls,
        X: ArrayLike | Spectra | Sequence[Spectra],
        wavelengths: Wavelengths | None = None,
        *,
        kind: str | None = None,
        components: int | float = 6,
        normalize: str | None = None,
        distribution: str = "gaussian",
        bandwidth: float | None = None,
        mixture_components: int | None = None,
        at: Wavelengths | None = None,
        resample: str = "auto",
        missing: str = "error",
        extrapolate: str = "error",
    ) -> Model:
        """A model of measured spectra, by their principal components.

        >>> measured = spectroll.read("mine.csv", unit="um", scale=0.01, missing_values=-999)
        >>> model = Model.fit(measured, kind="reflectance", components=8, at="400:5:700", missing="drop")

        Parameters
        ----------
        X : array, (spectra, bands), or what `read` returns, or a list of such
            Reflectances from 0 to 1, or powers of lights in any unit.
        wavelengths : array, (bands,), or text as in "400:10:700"
            The wavelengths of an array, in nm. `Spectra` have their own; those of the model are asked for by `at`.
        kind : "reflectance" or "illuminant"
            May be left out where `Spectra` say it, and wins where it is given.
        components : int, or a share of the variance below 1 (6)
            Number of principal components, or the share of the variance that they are to explain.
        normalize : "mean", "integral" or "none"
            What each spectrum is divided by; illuminants by their mean power unless this says otherwise.
        distribution : "gaussian", "kernel" or "mixture"
            How the weights are distributed: normal, as in the appendix; a normal distribution about each measured spectrum,
            which keeps draws as varied as the data; or a few normal distributions.
        bandwidth : float from 0 (the spectra themselves) to 1 (the Gaussian), optional
            The width of a kernel; without one, that under which the spectra are most likely.
        mixture_components : int, optional
            The number of normal distributions of a mixture (3).
        at : array in nm, or text
            The wavelengths of the model, even or not, where they are others than those of the first spectra; "as-measured"
            leaves out those at which nothing was measured.
        resample : "auto", "interpolate" or "average"
            How spectra come to these wavelengths: see `Spectra.at`.
        missing : "error", "drop" or "interpolate"
            What is done with spectra that lack a value which the wavelengths of the model need.
        extrapolate : "error", "hold" or "zero"
            What is done where `at` goes beyond the measured wavelengths.
        """
        if isinstance(X, Spectra):
            tables = [X]
        elif isinstance(X, (list, tuple)) and X and all(isinstance(each, Spectra) for each in X):
            tables = list(X)
        elif wavelengths is None:
            raise TypeError("wavelengths: an array of spectra has none of its own; give them in nm")
        else:
            tables = [Spectra(np.asarray(X), wavelengths, name="X")]
            wavelengths = None
        if wavelengths is not None:
            raise TypeError("wavelengths: these spectra have their own; at= asks for others")
        kinds = {table.kind for table in tables if table.kind}
        if kind is None and len(kinds) != 1:
            raise TypeError('kind: say whether these are "reflectance" or "illuminant" spectra')
        share = None
        if isinstance(components, float) and not components.is_integer():
            share, count = float(components), None
        else:
            count = whole("components", int(components) if isinstance(components, float) else components, 1)
        native = _spectroll.Model.fit(
            [(table.values, table.wavelengths, table.name) for table in tables],
            wavelengths_of(tables[0].wavelengths if at is None else at),
            kind or kinds.pop(),
            count,
            share,
            normalize,
            (distribution, bandwidth, mixture_components),
            onto(resample, missing, extrapolate),
        )
        return cls._of(native)

    @classmethod
    def from_json(cls, text: str) -> Model:
        """The model of the text of a model file."""
        return cls._of(_spectroll.Model.from_json(text, ""))

    def to_json(self) -> str:
        """The text of a model file, from which `from_json` makes the same model to the last bit."""
        text = self._json
        if text is None:
            text = self._native.to_json()
            object.__setattr__(self, "_json", text)
        return text

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Writes a model file, which `Model(path)` and the program read. It appears when it is complete."""
        self._native.save(os.fspath(path), overwrite)

    def _array(self, name: str) -> NDArray[np.float64]:
        if name not in self._arrays:
            array: NDArray[np.float64] = getattr(self._native, name)
            array.flags.writeable = False
            self._arrays[name] = array
        return self._arrays[name]

    @property
    def name(self) -> str:
        """Name of the built-in model or file; empty of a fit."""
        return self._native.name

    @property
    def kind(self) -> str:
        """"reflectance" or "illuminant"."""
        return self._native.kind

    @property
    def distribution(self) -> str:
        """"gaussian", "kernel" or "mixture": how the weights are distributed before what is not physical is rejected."""
        return self._native.distribution

    @property
    def bandwidth(self) -> float | None:
        """The width of a kernel, from 0 to 1; None of other distributions."""
        return self._native.bandwidth

    @property
    def components(self) -> int:
        """Number of components, k."""
        return self._native.components

    @property
    def bands(self) -> int:
        """Number of wavelengths, n."""
        return len(self.wavelengths)

    @property
    def wavelengths(self) -> NDArray[np.float64]:
        """The wavelengths in nm: (n,) float64."""
        return self._array("wavelengths")

    @property
    def mean(self) -> NDArray[np.float64]:
        """The mean spectrum: (n,) float64, in the unit of the spectra."""
        return self._array("mean")

    @property
    def basis(self) -> NDArray[np.float64]:
        """The components, orthonormal rows: (k, n) float64."""
        return self._array("basis")

    @property
    def weight_mean(self) -> NDArray[np.float64]:
        """The mean of the weights: (k,) float64."""
        return self._array("weight_mean")

    @property
    def weight_covariance(self) -> NDArray[np.float64]:
        """The covariance of the weights: (k, k) float64."""
        return self._array("weight_covariance")

    @property
    def explained_variance(self) -> NDArray[np.float64]:
        """The share of the data's variance that each component explains, from 0 to 1: (k,) float64."""
        return self._array("explained_variance")

    @property
    def sources(self) -> list[str]:
        """Where the data are from, a line for each source."""
        return self._native.sources

    def project(self, spectra: ArrayLike) -> NDArray[np.float64]:
        """The weights of spectra: (..., n) to (..., k)."""
        weights: NDArray[np.float64] = (np.asarray(spectra, np.float64) - self.mean) @ self.basis.T
        return weights

    def reconstruct(self, weights: ArrayLike) -> NDArray[np.float64]:
        """The spectra of weights: (..., k) to (..., n)."""
        spectra: NDArray[np.float64] = self.mean + np.asarray(weights, np.float64) @ self.basis
        return spectra

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a model is immutable: {name} cannot be set")

    def __reduce__(self) -> Any:
        return _restored, (self.to_json(), self.name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash(self.to_json())

    def __repr__(self) -> str:
        name = f"{self.name!r}: " if self.name else ""
        first, last = self.wavelengths[0], self.wavelengths[-1]
        explained = 100 * self.explained_variance.sum()
        return (
            f"<Model {name}{self.kind}s, {self.bands} bands from {first:g} to {last:g} nm, {self.components} "
            f"components that explain {explained:.2f} % of the variance>"
        )

    def _repr_svg_(self) -> str:
        from ._picture import of_model

        return of_model(self)

    def _repr_html_(self) -> str:
        from ._picture import page

        return page(repr(self)[1:-1], self._repr_svg_(), [("sources", "; ".join(self.sources))])


def _restored(text: str, name: str) -> Model:
    return Model._of(_spectroll.Model.from_json(text, name))

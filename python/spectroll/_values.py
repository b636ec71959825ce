"""Checks of arguments that several modules share."""

from __future__ import annotations

import operator
import os
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

Wavelengths = str | ArrayLike
"""Wavelengths in nm: an array, or text such as "400:10:700" (start:step:stop, both ends included)."""

LAST = 2**64 - 1

QUANTITIES = ("spectra", "weights", "xyz", "linear_srgb", "lrv", "attempts", "intensity", "chromaticity", "responses")
# Settings that mean something to some quantities alone, which the library refuses beside others: their defaults, and these.
OF_QUANTITIES = {
    "illuminant": ("d65", frozenset({"xyz", "linear_srgb", "chromaticity", "lrv", "responses"})),
    "observer": ("cie1931", frozenset({"xyz", "linear_srgb", "chromaticity", "lrv"})),
    "sensors": (None, frozenset({"responses"})),
    "response_scale": (None, frozenset({"responses"})),
    "xyz_scale": ("absolute", frozenset({"xyz", "linear_srgb"})),
}
# Settings among them that also say what a target is, each with the targets that it means something to.
OF_TARGETS = {"illuminant": ("lrv", "xyz", "target"), "observer": ("lrv", "xyz")}


def whole(name: str, value: Any, least: int = 0, most: int = LAST) -> int:
    """The whole number that an argument is, within its range."""
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name}={value!r}: it is a whole number") from None
    if not least <= number <= most:
        raise ValueError(f"{name}={number}: it is a whole number from {least} to {most}")
    return number


def seed_of(seed: Any) -> int:
    return whole("seed", seed)


def stream_of(stream: Any) -> str | None:
    if stream is None or isinstance(stream, str):
        return stream
    raise TypeError(f"stream={stream!r}: it is a name, or None")


def seed_of_rng(rng: Any) -> int:
    """A seed from whatever `numpy.random.default_rng` takes (SPEC 7): a generator gives its next number."""
    return int(np.random.default_rng(rng).integers(LAST, dtype=np.uint64, endpoint=True))


def choice(name: str, value: Any, all: Sequence[str]) -> str:
    """One of some names, in any case."""
    if isinstance(value, str) and value.lower() in all:
        return value.lower()
    near = get_close_matches(str(value).lower(), all, 1)
    meant = f"; did you mean {near[0]!r}?" if near else ""
    kind = ValueError if isinstance(value, str) else TypeError
    raise kind(f"{name}={value!r}: it is one of {', '.join(map(repr, all))}{meant}")


def quantities_of(quantities: Any) -> tuple[tuple[str, ...], bool]:
    """The quantities that are asked for, and whether an array of one is wanted rather than a mapping."""
    if quantities is None:
        return ("spectra",), True
    if isinstance(quantities, str):
        return (choice("quantities", quantities, QUANTITIES),), True
    chosen = tuple(choice("quantities", quantity, QUANTITIES) for quantity in quantities)
    if not chosen:
        raise ValueError("quantities=[]: ask for one at least, such as \"spectra\"")
    twice = next((quantity for quantity in chosen if chosen.count(quantity) > 1), None)
    if twice:
        raise ValueError(f"quantities={list(chosen)!r}: {twice!r} is there twice")
    return chosen, False


def range_of(draws: Any, name: str = "indices") -> range:
    """A range of indices: a range as it is, and a number n as range(n)."""
    indices = draws if isinstance(draws, range) else range(whole(name, draws, most=2**64))
    if len_of(indices) and not (0 <= indices[0] <= LAST and 0 <= indices[-1] <= LAST):
        raise ValueError(f"{name}={draws!r}: indices are from 0 to 2**64 - 1")
    return indices


def len_of(indices: range) -> int:
    """Length of a range, which `len` refuses from 2**63 on."""
    start, stop, step = indices.start, indices.stop, indices.step
    return max(0, (stop - start + step - (1 if step > 0 else -1)) // step)


def indices_of(ids: Any) -> np.ndarray:
    """Indices as 64-bit numbers, in the shape they come in."""
    array = np.asarray(ids)
    if array.size == 0:
        return np.zeros(array.shape, np.uint64)
    if array.dtype == object:  # Python's own numbers from 2**63 on
        flat = [whole("ids", number) for number in array.ravel().tolist()]
        return np.array(flat, np.uint64).reshape(array.shape)
    if array.dtype.kind not in "iu":
        raise TypeError(f"ids of {array.dtype}: indices are whole numbers")
    if array.dtype.kind == "i" and array.min() < 0:
        raise IndexError(f"index {array.min()}: the first draw has the index 0")
    return array.astype(np.uint64, copy=False)


def wavelengths_of(wavelengths: Any) -> str | list[float]:
    """Wavelengths for the native half."""
    if isinstance(wavelengths, str):
        return wavelengths
    array = np.asarray(wavelengths, np.float64)
    if array.ndim != 1:
        raise ValueError(f"wavelengths of shape {array.shape}: they are one axis, in nm")
    each: list[float] = array.tolist()
    return each


def text_of_path(path: str | os.PathLike[str]) -> str:
    return os.fspath(path)

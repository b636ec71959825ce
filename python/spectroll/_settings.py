"""Settings of samplers: as they are typed in Python, and as the native half takes them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._values import choice

ILLUMINANTS = ("d65", "a", "e")


def shown(value: Any) -> str:
    """A setting as it was given."""
    match value:
        case {"uniform": [low, high]} | {"loguniform": [low, high]}:
            return f"({low:g}, {high:g})"
        case {"fixed": number}:
            return f"{number:g}"
        case {"power": _}:
            return "(powers)"
        case _:
            return f"{value}" if not isinstance(value, str) else repr(value)


def _pair(name: str, value: Any) -> list[float] | None:
    """Two numbers, where there are two."""
    if np.ndim(value) == 0:
        return None
    pair = [float(each) for each in value]
    if len(pair) != 2:
        raise ValueError(f"{name}={value!r}: it is one number, or two between which it lies")
    return pair


def _finite(name: str, *numbers: float) -> None:
    if not np.isfinite(numbers).all():
        raise ValueError(f"{name}={numbers[0] if len(numbers) == 1 else numbers}: numbers are finite")


def lrv_of(lrv: Any) -> Any:
    if lrv is None:
        return None
    pair = _pair("lrv", lrv)
    _finite("lrv", *(pair or [float(lrv)]))
    return {"uniform": pair} if pair else float(lrv)


def intensity_of(intensity: Any) -> Any:
    if intensity is None:
        return None
    if isinstance(intensity, str):
        return choice("intensity", intensity, ("data",))
    pair = _pair("intensity", intensity)
    _finite("intensity", *(pair or [float(intensity)]))
    return {"loguniform": pair} if pair else {"fixed": float(intensity)}


def illuminant_of(illuminant: Any) -> Any:
    if isinstance(illuminant, str):
        return choice("illuminant", illuminant, ILLUMINANTS)
    powers = np.asarray(illuminant, np.float64)
    if powers.ndim != 1:
        raise ValueError(f"an illuminant of shape {powers.shape}: it is a power for each wavelength")
    _finite("illuminant", *powers)
    return {"power": powers.tolist()}

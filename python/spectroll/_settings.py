"""Settings of samplers: as they are typed in Python, and as the native half takes them."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from . import _spectroll
from ._model import Model
from ._values import choice, whole


class Engine(NamedTuple):
    """What draws, as the native half takes it."""

    name: str
    threads: int | None
    arithmetic: str

    def shown(self) -> dict[str, Any]:
        """The settings that are not the default ones."""
        default = {"engine": "auto", "threads": None, "arithmetic": "auto"}
        settings = {"engine": self.name, "threads": self.threads, "arithmetic": self.arithmetic}
        return {name: value for name, value in settings.items() if value != default[name]}


def engine_of(engine: str | int, threads: int | None, arithmetic: str) -> Engine:
    name = str(engine) if isinstance(engine, int) else engine
    if not isinstance(name, str) or not name:
        raise TypeError(f'engine={engine!r}: it is "auto", "cpu", "gpu", or part of an adapter\'s name or its index')
    return Engine(
        name.lower() if name.lower() in ("auto", "cpu", "gpu") else name,
        None if threads is None else whole("threads", threads, 1, 2**16),
        choice("arithmetic", arithmetic, ("auto", "plain", "exact")),
    )


def shown(value: Any) -> str:
    """A setting as it was given."""
    match value:
        case {"uniform": [low, high]} | {"loguniform": [low, high]}:
            return f"({low:g}, {high:g})"
        case {"fixed": number}:
            return f"{number:g}"
        case {"power": _}:
            return "(powers)"
        case {"daylight": kelvin}:
            return f"'{kelvin:g}K'"
        case {"sensors": sensors, "channel": channel, "response": response}:
            return f"({shown(sensors)}, {channel!r}, {shown(response)})"
        case {"name": name, "functions": _}:
            return repr(name)
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


def finite(name: str, *numbers: float) -> None:
    if not np.isfinite(numbers).all():
        raise ValueError(f"{name}={numbers[0] if len(numbers) == 1 else numbers}: numbers are finite")


def lrv_of(lrv: Any) -> Any:
    return None if lrv is None else _range("lrv", lrv)


def _range(name: str, value: Any) -> Any:
    """One number, or two between which it lies."""
    pair = _pair(name, value)
    finite(name, *(pair or [float(value)]))
    return {"uniform": pair} if pair else float(value)


def sensors_of(name: str, sensors: Any, model: Model) -> Any:
    """A set of sensors as the library writes it: the name of a built-in one, or its functions."""
    if isinstance(sensors, Mapping):
        functions = [np.asarray(function, np.float64).tolist() for function in sensors.values()]
        own = {"name": "sensors", "channels": list(map(str, sensors)), "functions": functions}
        return json.loads(_spectroll.sensors_of(json.dumps({**own, "wavelengths": model.wavelengths.tolist()})))
    if not isinstance(sensors, (str, os.PathLike)):
        raise TypeError(f"{name}={sensors!r}: it is the name of a set, a file, or a mapping of functions")
    return json.loads(_spectroll.sensors(os.fspath(sensors)))


def target_of(target: Any, model: Model) -> Any:
    """The response of a sensor that reflectances are scaled to."""
    try:
        sensors, channel, response = target
    except (TypeError, ValueError):
        raise ValueError(f'target={target!r}: it is three things, as in ("ss2", "L", 0.3)') from None
    found = {"sensors": sensors_of("target", sensors, model), "channel": str(channel)}
    return {**found, "response": _range("target", response)}


def intensity_of(intensity: Any) -> Any:
    if intensity is None:
        return None
    if isinstance(intensity, str):
        return choice("intensity", intensity, ("data",))
    pair = _pair("intensity", intensity)
    finite("intensity", *(pair or [float(intensity)]))
    return {"loguniform": pair} if pair else {"fixed": float(intensity)}


def illuminant_of(illuminant: Any) -> Any:
    if isinstance(illuminant, str):
        return json.loads(_spectroll.illuminant(illuminant))
    powers = np.asarray(illuminant, np.float64)
    if powers.ndim != 1:
        raise ValueError(f"an illuminant of shape {powers.shape}: it is a power for each wavelength")
    finite("illuminant", *powers)
    return {"power": powers.tolist()}

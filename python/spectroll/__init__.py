"""Random, physically valid natural spectra: reflectances and daylights, by the million, on the GPU or the CPU.

>>> import spectroll
>>> sampler = spectroll.Sampler("munsell-vrhel", lrv=0.4, bounds="both")
>>> sampler.sample(1000, rng=7).shape       # reflectances, float32
(1000, 31)
>>> sampler.wavelengths[:3]                 # in nm
array([400., 410., 420.])

A `Model` is a Gaussian model of measured spectra: a built-in one, a file, or `Model.fit`. A `Sampler` says which draws of
it are wanted and makes them. Draw i depends on the model, the sampler's settings, the seed, the stream and i, and on
nothing else: not on the number of draws, their order, the threads, the engine or the machine.

`read` reads measured spectra, `write` makes the data sets that the program `spectroll` makes, and `Scene` draws scenes of
lights and surfaces. `Sampler.torch`, `Sampler.dask`, `spectroll.dask` and `spectroll.ray` reach past one process and one
machine.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._data import Spectra, read, tables
    from ._model import Model, models
    from ._sampler import Sampler
    from ._scene import Scene
    from ._spectroll import DataError, EngineError, __version__
    from ._system import Adapter, adapters
    from ._write import Written, write

# Where each name is: imported when it is first used, so that the program, which is in this package too, starts without NumPy.
_HOMES = {
    "Adapter": "_system",
    "DataError": "_spectroll",
    "EngineError": "_spectroll",
    "Model": "_model",
    "Sampler": "_sampler",
    "Scene": "_scene",
    "Spectra": "_data",
    "Written": "_write",
    "__version__": "_spectroll",
    "adapters": "_system",
    "models": "_model",
    "read": "_data",
    "tables": "_data",
    "write": "_write",
}

__all__ = [
    "Adapter",
    "DataError",
    "EngineError",
    "Model",
    "Sampler",
    "Scene",
    "Spectra",
    "Written",
    "__version__",
    "adapters",
    "models",
    "read",
    "tables",
    "write",
]

_MODULES = ("dask", "ray", "torch")


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f".{name}", __name__)
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, *_MODULES])

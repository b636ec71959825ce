"""Samplers: which draws of a model are wanted, and the making of them."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _spectroll
from ._layout import Arrays
from ._model import Model
from ._settings import Engine, engine_of, finite, illuminant_of, intensity_of, lrv_of, sensors_of, shown, target_of
from ._values import (
    OF_QUANTITIES,
    OF_TARGETS,
    choice,
    indices_of,
    len_of,
    quantities_of,
    range_of,
    seed_of,
    seed_of_rng,
    stream_of,
    whole,
)

if TYPE_CHECKING:
    import dask.array
    import xarray

Sensors = str | os.PathLike[str] | Mapping[str, ArrayLike]
"""A set of sensors: a name, a file, or functions by the names of their channels."""
Quantities = str | Sequence[str] | None
Drawn = Any
"""An array, or a mapping of arrays by quantity where a list of quantities was asked for."""

DTYPES = ("float32", "float16")
LAYOUTS = ("rows", "padded-rows", "planes")
OBSERVERS = ("cie1931", "cie1964")
SPACES = ("xyz", "srgb", "linear-srgb", "lab", "responses")


class Sampler:
    """Draws of a model with given settings.

    >>> surfaces = spectroll.Sampler("munsell-vrhel", lrv=0.4, bounds="both")
    >>> surfaces.sample(1000, rng=7).shape                      # fresh draws; the same for the same rng
    (1000, 31)
    >>> lights = spectroll.Sampler("granada", intensity=(0.1, 10))
    >>> drawn = lights.draw(range(1000), seed=7, quantities=["spectra", "xyz"])
    >>> drawn["xyz"].shape                                      # draw i depends on the seed and i alone
    (1000, 3)

    Parameters
    ----------
    model : Model, str or path ("munsell-vrhel")
        What is drawn from: a model, a built-in one ("munsell-vrhel" has reflectances, "granada" daylights; `models()` lists
        all), or a model file.
    lrv : float, or (low, high), optional
        Scales each reflectance to this luminous reflectance value (CIE Y of the `observer` under the `illuminant`, a
        perfect white being 1), or to one of its own, uniform between two.
    xyz : (X, Y, Z), optional
        Gives each reflectance these tristimulus values under the `illuminant`, where a perfect white has Y = 1. In place of an
        `lrv`.
    target : (sensors, channel, response), optional
        Scales each reflectance to the response of one sensor, as `lrv` does to a luminous reflectance:
        `("ss2", "L", 0.3)` or `("camera.csv", "R", (0.2, 0.6))`.
    bounds : "base", "scaled" or "both" ("base")
        The spectrum that must be above 0 and below 1 where there is an `lrv` or a `target`: before scaling, after it, or
        both. With "base", as in Singh et al. 2018, scaled values can exceed 1. Illuminants must be above 0.
    covariance_scale : float (1)
        Factor of the weights' covariance.
    intensity : float, (low, high) or "data", optional
        Factor of illuminants: one, uniform in the logarithm between two, or those of the measured spectra.
    sensors : str, path or mapping, optional
        Sensors of the quantity "responses": "cie1931", "cie1964", the cones "ss2", "ss10" (Stockman & Sharpe) or
        "smith-pokorny", "rods", "melanopsin"; a file, whose columns are the channels; or functions by the names of their
        channels, each with a value for each of the model's wavelengths.
    response_scale : "white" or "absolute", optional
        Responses relative to those of a perfect white (of reflectances, unless given), or integrals over nm (of
        illuminants, which have no other).
    observer : "cie1931" or "cie1964" ("cie1931")
        Standard observer of XYZ, chromaticity, linear sRGB and LRV.
    illuminant : str, or powers, (bands,) ("D65")
        What reflectances have their responses, XYZ, chromaticity, linear sRGB and LRV under: "D65", "D50", "D55", "D75", "A",
        "C", "E", "F2", "F7", "F11", or a daylight by its temperature, such as "5600K".
    xyz_scale : "absolute" or "unit-y" ("absolute")
        Scale of the XYZ and linear sRGB of illuminants: sums of power x colour matching function x step in nm, or Y = 1.
        Those of reflectances are on the scale where a perfect white under the illuminant has Y = 1.
    proposal : "auto", "plain" or "cover" ("auto")
        Where candidates come from; "cover" finds spectra that plain rejection would hardly ever find.
    max_attempts : int (65000)
        The most candidates of a draw: `EngineError` names the draw that finds none.
    dtype : "float32" or "float16" ("float32")
        Type of the spectra. Other quantities are float32, and attempts uint32.
    layout : "rows", "padded-rows" or "planes" ("rows")
        Order in memory: draw by draw; with room for a multiple of 4 values a draw; or wavelength by wavelength, so that
        the transpose is contiguous. The shape of arrays and their values are the same.
    engine : "auto", "cpu", "gpu", or part of an adapter's name or its index ("auto")
        "auto" is a hardware adapter where there is one, and else the CPU.
    arithmetic : "auto", "plain" or "exact" ("auto")
        The arithmetic of an adapter: exact where its compiler fuses or rearranges sums and products, as "auto" finds by a
        trial against the CPU's draws, so that the bytes are the same on all of them; it takes longer than plain.
    threads : int, optional
        Threads of the CPU engine, one per core unless given. With 1, draws are made on the thread that calls.

    Settings that mean nothing to the model's kind, as an `lrv` of illuminants, are a `ValueError`.

    Draw i depends on the model, the settings but `layout`, `engine`, `arithmetic` and `threads`, the seed, the stream and i, and on nothing
    else.

    Samplers are immutable, can be pickled, and may be used by several threads, and after a fork or in spawned processes:
    each process opens an engine of its own.
    """

    __slots__ = ("_dtype", "_engine", "_layout", "_model", "_natives", "_settings")

    _model: Model
    _settings: dict[str, Any]
    _dtype: str
    _layout: str
    _engine: Engine
    _natives: dict[tuple[str, ...], tuple[_spectroll.Sampler, Arrays]]

    def __init__(
        self,
        model: Model | str | os.PathLike[str] = "munsell-vrhel",
        *,
        lrv: float | tuple[float, float] | None = None,
        xyz: Sequence[float] | None = None,
        target: tuple[Sensors, str, float | tuple[float, float]] | None = None,
        bounds: str = "base",
        covariance_scale: float = 1.0,
        intensity: float | tuple[float, float] | str | None = None,
        sensors: Sensors | None = None,
        response_scale: str | None = None,
        observer: str = "cie1931",
        illuminant: str | ArrayLike = "D65",
        xyz_scale: str = "absolute",
        proposal: str = "auto",
        max_attempts: int = 65_000,
        dtype: Any = "float32",
        layout: str = "rows",
        engine: str | int = "auto",
        arithmetic: str = "auto",
        threads: int | None = None,
    ) -> None:
        model = model if isinstance(model, Model) else Model(model)
        settings = {
            "lrv": lrv_of(lrv),
            "xyz": None if xyz is None else [float(value) for value in xyz],
            "bounds": choice("bounds", bounds, ("base", "scaled", "both")),
            "cov_scale": float(covariance_scale),
            "intensity": intensity_of(intensity),
            "target": None if target is None else target_of(target, model),
            "sensors": None if sensors is None else sensors_of("sensors", sensors, model),
            "response_scale": None
            if response_scale is None
            else choice("response_scale", response_scale, ("white", "absolute")),
            "observer": choice("observer", observer, OBSERVERS),
            "illuminant": illuminant_of(illuminant),
            "xyz_scale": choice("xyz_scale", xyz_scale, ("absolute", "unit-y")),
            "proposal": choice("proposal", proposal, ("auto", "plain", "cover")),
            "max_attempts": whole("max_attempts", max_attempts, 0, 2**32 - 1),
        }
        if settings["xyz"] is not None and len(settings["xyz"]) != 3:
            raise ValueError(f"xyz={xyz!r}: it is three values, X, Y and Z")
        self._set(
            model,
            settings,
            choice("dtype", np.dtype(dtype).name, DTYPES),
            choice("layout", layout, LAYOUTS),
            engine_of(engine, threads, arithmetic),
        )
        # What cannot be drawn is refused now, and not with the first draw.
        self._native(("spectra",))
        if settings["illuminant"] != "d65" or settings["xyz_scale"] != "absolute":
            self._native(("xyz",))
        if settings["sensors"] is not None:
            self._native(("responses",))

    def _set(
        self,
        model: Model,
        settings: dict[str, Any],
        dtype: str,
        layout: str,
        engine: Engine,
    ) -> None:
        for name, value in {
            "_model": model,
            "_settings": settings,
            "_dtype": dtype,
            "_layout": layout,
            "_engine": engine,
            "_natives": {},
        }.items():
            object.__setattr__(self, name, value)

    def _native(self, quantities: tuple[str, ...]) -> tuple[_spectroll.Sampler, Arrays]:
        """The native sampler of some quantities, and the arrays that it fills. Quantities do not change the draws."""
        found = self._natives.get(quantities)
        if found is None:
            settings = {**self._settings, "quantities": quantities}
            for setting, (default, needed) in OF_QUANTITIES.items():
                is_of_target = any(settings[name] is not None for name in OF_TARGETS.get(setting, ()))
                if not (needed.intersection(quantities) or is_of_target):
                    settings[setting] = default
            # In 16 bits or not makes a difference where spectra are drawn.
            dtype = self._dtype if "spectra" in quantities else "float32"
            text = json.dumps(settings)
            native = _spectroll.Sampler(self._model._native, text, self._layout, dtype, self._engine)
            found = native, Arrays(native.formats(), self._layout)
            self._natives[quantities] = found
        return found

    # Draws

    def sample(self, n: int, *, rng: Any = None, quantities: Quantities = None) -> Drawn:
        """n random draws, for whoever wants some: `draw` makes those of given indices, for data sets that can be made again
        piece by piece.

        Parameters
        ----------
        n : int
        rng : None, int, numpy.random.Generator, or whatever `numpy.random.default_rng` takes
            Source of the seed, as NumPy and SciPy have it (SPEC 7): the same number gives the same draws; a generator gives
            others each time, and so does None. A number is no seed of `draw`, whose draws are others.
        quantities : str, or list of str ("spectra")
            One name gives an array, a list of names a mapping of arrays by name:

            - "spectra", (n, bands): after scaling to an lrv or an intensity;
            - "weights", (n, components): of the model's components, before scaling;
            - "xyz", (n, 3): of the observer, of reflectances under the illuminant;
            - "responses", (n, channels): of the sensors, of reflectances under the illuminant;
            - "linear_srgb", (n, 3): of the XYZ by the matrix of D65, neither clipped nor adapted to another white;
            - "chromaticity", (n, 2): x and y of the XYZ;
            - "lrv", (n,): luminous reflectance of the observer under the illuminant, of reflectances;
            - "intensity", (n,): the factor of each illuminant, where `intensity` is set;
            - "attempts", (n,) uint32: the number of candidates that each draw took.

        Returns
        -------
        array, (n, bands) float32 for spectra, or a mapping
            Reflectances are from 0 to 1, powers of illuminants in the model's unit times their intensity.
        """
        return self.draw(range(whole("n", n)), seed=seed_of_rng(rng), quantities=quantities)

    def draw(
        self,
        indices: range | int,
        *,
        seed: int = 0,
        stream: str | None = None,
        quantities: Quantities = None,
        out: Any = None,
    ) -> Drawn:
        """The draws of a range of indices: `range(10**12, 10**12 + 1000)`, or n for range(n).

        Parameters
        ----------
        indices : range or int
            From 0 to 2**64 - 1, with any step.
        seed : int (0)
            From 0 to 2**64 - 1; the program's --seed.
        stream : str, optional
            A name that sets draws apart from others of the same seed; the program's --stream.
        quantities : str, or list of str ("spectra")
            See `sample`.
        out : array, or mapping of arrays, optional
            Where to put the draws: an array of NumPy with the shape, the type and the order in memory of what would be
            returned. The CPU engine draws into it without a copy, where a draw takes a multiple of 4 bytes; a GPU copies once.

        Returns
        -------
        array, (len(indices), bands), or a mapping; `out` where it is given
        """
        asked = range_of(indices)
        if asked.step != 1 and len_of(asked) > 1:
            ids = np.arange(len_of(asked), dtype=np.uint64) * np.uint64(asked.step % 2**64) + np.uint64(asked.start)
            return self.at(ids, seed=seed, stream=stream, quantities=quantities, out=out)
        count, first = len_of(asked), asked.start if len_of(asked) else 0
        native, arrays = self._native(quantities_of(quantities)[0])
        key = (seed_of(seed), stream_of(stream))
        return self._filled(
            arrays, (count,), quantities, out, lambda buffers: native.fill(first, count, key, buffers)
        )

    def at(
        self,
        ids: ArrayLike,
        *,
        seed: int = 0,
        stream: str | None = None,
        quantities: Quantities = None,
        out: Any = None,
    ) -> Drawn:
        """The draws of any indices, in their order: for shuffled loaders and for engines that hand out ids.

        `at(ids)[j]` is `draw(range(ids[j], ids[j] + 1))[0]`, to the last bit.

        Parameters
        ----------
        ids : array of whole numbers, of any shape
            From 0 to 2**64 - 1, any number of times; floats are a `TypeError`.
        seed, stream, quantities, out
            See `draw`.

        Returns
        -------
        array, ids.shape + (bands,), or a mapping; `out` where it is given
        """
        shaped = indices_of(ids)
        flat = np.ascontiguousarray(shaped).reshape(-1)
        native, arrays = self._native(quantities_of(quantities)[0])
        key = (seed_of(seed), stream_of(stream))
        return self._filled(
            arrays, shaped.shape, quantities, out, lambda buffers: native.fill_at(flat, key, buffers)
        )

    def given(
        self,
        colours: ArrayLike,
        *,
        space: str = "xyz",
        each: int | None = None,
        seed: int = 0,
        hard: str = "mode",
        nearest: bool = False,
        max_attempts: int = 1000,
        details: bool = False,
    ) -> Any:
        """Metamers: random spectra that have given colours, exactly.

        Parameters
        ----------
        colours : array, (..., 3)
            In `space`. Draw m of colour j depends on j, m, the seed and the colour alone.
        space : "xyz", "srgb", "linear-srgb", "lab" or "responses" ("xyz")
            XYZ (a perfect white having Y = 1) and CIELAB are of the sampler's `observer` under its `illuminant`, and sRGB, 0
            to 1, is adapted to its white. "responses" are those of the sampler's `sensors`, 1 for a perfect white:
            (..., channels).
        each : int, optional
            Number of spectra of each colour, along an axis of its own; 0 gives the most probable spectrum of each, without
            that axis and without random numbers.
        seed : int (0)
        hard : "mode", "skip" or "error" ("mode")
            Answer to colours of which none is found in `max_attempts`: the most probable valid spectrum, zeros, or an error.
        nearest : bool (False)
            Whether colours that no spectrum of the model has are answered with the nearest that one has; else they are zeros.
        max_attempts : int (1000)
        details : bool (False)
            Whether to return the kind of each answer and its distance as well.

        Returns
        -------
        array, (..., bands) or (..., each, bands) float32
            With `details`, a mapping with "spectra", "status" (0 skipped, 1 sampled, 2 mode, 3 nearest, 4 unreachable) and,
            with `nearest`, "distance" (largest difference of a response relative to white).
        """
        settings = {**self._settings, "quantities": ["spectra"], "sensors": None, "response_scale": None}
        settings["max_attempts"] = whole("max_attempts", max_attempts, 0, 2**31 - 1)
        given = None
        if space == "responses":
            if self._settings["sensors"] is None:
                raise ValueError('space="responses" needs a sampler with sensors')
            given = json.dumps(self._settings["sensors"])
        asked = np.asarray(colours, np.float64)
        width = 3 if given is None else len(self._native(("responses",))[1].formats[0][4])
        if asked.ndim == 0 or asked.shape[-1] != width:
            raise ValueError(f"colours of shape {asked.shape}: the last axis has {width} values")
        finite("colours", *asked.ravel())
        count = 1 if each is None else whole("each", each, 0, 2**31)
        shape = (*asked.shape[:-1], *((count,) if each else ()), len(self.wavelengths))
        spectra = np.empty(shape, np.float32)
        flat = np.ascontiguousarray(asked.reshape(-1))
        status, distance = _spectroll.metamers(
            self._model._native,
            json.dumps(settings),
            given,
            (choice("space", space, SPACES), flat),
            (seed_of(seed), count),
            (choice("hard", hard, ("mode", "skip", "error")), bool(nearest)),
            self._engine,
            spectra.reshape(-1),
        )
        if not details:
            return spectra
        found = {"spectra": spectra, "status": status.reshape(shape[:-1])}
        return {**found, "distance": distance.reshape(shape[:-1])} if nearest else found

    def _filled(self, arrays: Arrays, shape: tuple[int, ...], quantities: Quantities, out: Any, fill: Any) -> Drawn:
        names, single = quantities_of(quantities)
        given: Mapping[str, Any] | None = out
        if out is not None and single:
            given = {names[0]: out}
        buffers, found = arrays.empty(shape) if given is None else arrays.given(given, shape, names)
        fill(buffers)
        if out is not None:
            return out
        return found[names[0]] if single else {name: found[name] for name in names}

    # Properties

    @property
    def model(self) -> Model:
        """The model."""
        return self._model

    @property
    def wavelengths(self) -> NDArray[np.float64]:
        """The wavelengths in nm: (bands,) float64."""
        return self._model.wavelengths

    @property
    def acceptance(self) -> float:
        """The share of candidates that are accepted, from 0 to 1: estimated from 65,536 of them when the sampler is made, the
        same each time. With a cover, of its candidates."""
        return self._native(("spectra",))[0].acceptance

    @property
    def settings(self) -> dict[str, Any]:
        """The settings by name, as data sets record them."""
        settings: dict[str, Any] = json.loads(json.dumps(self._settings))
        return settings

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the spectra."""
        return np.dtype(self._dtype)

    @property
    def engine(self) -> str:
        """What draws: "CPU (8 threads)", or the adapter with its driver. This opens it."""
        return self._native(("spectra",))[0].engine()

    @property
    def threads(self) -> int | None:
        """Threads of the CPU engine; None is one per core."""
        return self._engine.threads

    def with_threads(self, threads: int | None) -> Sampler:
        """The sampler with this number of threads. Its draws are the same."""
        sampler = Sampler.__new__(Sampler)
        engine = engine_of(self._engine.name, threads, self._engine.arithmetic)
        sampler._set(self._model, self._settings, self._dtype, self._layout, engine)
        return sampler

    def wgsl(self, prefix: str = "draw", *, quantities: Quantities = None, arithmetic: str = "plain") -> str:
        """The draws as functions of WGSL, as text, for shaders of any engine; every name begins with `prefix` and "_". With
        `arithmetic="exact"` they have the same bytes whatever the shader's compiler does, and take a zero as an argument. See
        `spectroll shader --help` and docs/embedding.md for the functions."""
        form = choice("arithmetic", arithmetic, ("plain", "exact"))
        return self._native(quantities_of(quantities)[0])[0].wgsl(prefix, form)

    def wgsl_tables(self, *, quantities: Quantities = None) -> bytes:
        """The content of the storage buffer that the text of `wgsl` declares, where it declares one: covers, intensities of
        the data, and models with many bands and components have one, most others none."""
        return self._native(quantities_of(quantities)[0])[0].tables()

    # Other libraries

    def to_xarray(
        self,
        indices: range | int,
        *,
        seed: int = 0,
        stream: str | None = None,
        quantities: Quantities = None,
    ) -> xarray.DataArray | xarray.Dataset:
        """Draws as an `xarray.DataArray` of (draw, wavelength), with the indices and the wavelengths in nm as coordinates; a
        `Dataset` where a list of quantities is asked for. Arguments are those of `draw`."""
        from ._xarray import of_draws

        return of_draws(self, range_of(indices), seed, stream, quantities)

    def to_colour(self, indices: range | int, *, seed: int = 0, stream: str | None = None) -> Any:
        """Spectra as `colour.MultiSpectralDistributions`, labelled by their indices, for colour-science. Arguments are those
        of `draw`."""
        from ._colour import of_draws

        return of_draws(self, range_of(indices), seed, stream)

    def dask(
        self,
        n: int | range,
        *,
        seed: int = 0,
        stream: str | None = None,
        quantities: str = "spectra",
        chunks: int = 2**20,
    ) -> dask.array.Array:
        """Draws as a lazy `dask.array` of (n, bands), in blocks of `chunks` draws. Each task draws on one thread, that which
        runs it, and any block is the same wherever it is made. An array is of one quantity: make one for each.
        `spectroll.dask.write` writes several to one store."""
        from .dask import array

        return array(self, n, seed=seed, stream=stream, quantities=quantities, chunks=chunks)

    def torch(
        self,
        n: int | range,
        *,
        seed: int = 0,
        stream: str | None = None,
        quantities: Quantities = None,
        batch_size: int | None = None,
    ) -> Any:
        """Draws as a data set for `torch.utils.data.DataLoader`, the same in every epoch.

        >>> DataLoader(sampler.torch(10**8, seed=7), batch_size=4096, shuffle=True, num_workers=4)
        >>> DataLoader(sampler.torch(10**8, seed=7, batch_size=4096), batch_size=None, num_workers=4)

        Without `batch_size` it is map-style: item i is the tensor of draw i, (bands,) float32 on the CPU, or a dict of tensors
        where a list of quantities is asked for, and whole batches are drawn at once, so that any sampler and shuffling works.
        With it, it is iterable and yields batches, (batch_size, bands), in order; workers and the ranks of
        `torch.distributed` take turns, so that all together see each draw once, and one may have a batch more than another.
        Each worker draws on one thread.
        """
        from .torch import dataset

        return dataset(self, n, seed=seed, stream=stream, quantities=quantities, batch_size=batch_size)

    # Python

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a sampler is immutable: {name} cannot be set; make another")

    def __reduce__(self) -> Any:
        state = (self._settings, self._dtype, self._layout, tuple(self._engine))
        return _restored, (self._model, *state)

    def _key(self) -> tuple[Any, ...]:
        return (json.dumps(self._settings), self._dtype, self._layout, self._engine)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sampler) and self._key() == other._key() and self._model == other._model

    def __hash__(self) -> int:
        return hash((self._key(), self._model))

    def __repr__(self) -> str:
        default = {"bounds": "base", "cov_scale": 1.0, "illuminant": "d65", "xyz_scale": "absolute"}
        default |= {"observer": "cie1931"}
        default |= {"proposal": "auto", "max_attempts": 65_000, "dtype": "float32", "layout": "rows"}
        given = {**self._settings, "dtype": self._dtype, "layout": self._layout}
        changed = {k: v for k, v in given.items() if v is not None and v != default.get(k)}
        changed |= self._engine.shown()
        words = ", ".join(f"{name}={shown(value)}" for name, value in changed.items())
        model = repr(self._model.name) if self._model.name else repr(self._model)
        return f"<Sampler {model}{', ' if words else ''}{words}: {100 * self.acceptance:.2f} % accepted>"

    def _repr_svg_(self) -> str:
        from ._picture import of_sampler

        return of_sampler(self)

    def _repr_html_(self) -> str:
        from ._picture import page

        rows = [(name, shown(value)) for name, value in self._settings.items() if value is not None]
        rows.append(("accepted", f"{100 * self.acceptance:.2f} %"))
        return page(repr(self)[1:-1], self._repr_svg_(), rows)


def _restored(
    model: Model, settings: dict[str, Any], dtype: str, layout: str, engine: tuple[str, int | None, str]
) -> Sampler:
    sampler = Sampler.__new__(Sampler)
    sampler._set(model, settings, dtype, layout, Engine(*engine))
    return sampler

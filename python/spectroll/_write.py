"""Data sets, as the program writes them."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from . import _spectroll
from ._sampler import Quantities, Sampler
from ._scene import Scene
from ._values import choice, len_of, quantities_of, range_of, seed_of, stream_of, whole

Progress = bool | Callable[[int, int], object] | None


class Written(NamedTuple):
    """Summary of a data set that was written."""

    draws: int
    """Number of draws, or of scenes, that this call made."""
    attempts: int
    """Number of candidates that they took; 0 for scenes."""
    above_one: int
    """Number of draws that scaling took to 1 or above in some band: `bounds="both"` keeps all below."""
    complete: bool
    """Whether the data set is there; not as long as other processes have parts of it to make."""


def write(
    path: str | os.PathLike[str],
    source: Sampler | Scene,
    n: int | range | None = None,
    *,
    seed: int = 0,
    stream: str | None = None,
    quantities: Quantities = None,
    format: str | None = None,
    dtype: Any = None,
    chunk: int | None = None,
    zstd: int | bool | None = None,
    shard: tuple[int, int] | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    sidecar: bool = False,
    check_space: bool = True,
    progress: Progress = None,
) -> Written:
    """Writes a data set, with the bytes that `spectroll sample` or `spectroll scene` writes.

    >>> spectroll.write("x.zarr", sampler, 10**8, seed=7, shard=(1, 8), resume=True)       # the second part of eight

    A `.zarr`, and a folder of `.npy` or `.parquet` parts, is a set of chunks, which can be sharded and resumed; anything else
    is one file. What is written opens with the usual readers, such as `xarray.open_zarr`.

    Parameters
    ----------
    path : str or path
        .npy, .npz, .csv, .h5, .mat, .parquet or .zarr; or a folder ("name/") with `format` "npy", "parquet" or "spd". A file
        appears under its name when it is complete.
    source : Sampler or Scene
    n : int or range
        Number of draws, or their indices; of scenes, which of them (all).
    seed, stream
        Those of `Sampler.draw`. A scene has its own.
    quantities : str, or list of str ("spectra")
        The arrays of the data set.
    format : str, optional
        The format, where the name does not say it.
    dtype : "float32", "float16" or "float64", optional
        Type of the numbers, the sampler's unless given; beside float16 spectra, labels stay float32.
    chunk : int, optional
        Draws in each chunk of a set; some 16 MiB unless given.
    zstd : True or a level from 1 to 22, optional
        Packs the chunks of a .zarr.
    shard : (i, n) or "I/N", optional
        Makes only part i of n of a set, counted from 0 as in range(n); as text, from 1 as the program's --shard. Whichever
        process finishes last gives the set its name.
    resume : bool
        Goes on with a set that an earlier call began, if one did.
    overwrite : bool
        Replaces what exists.
    sidecar : bool
        Writes name.spectroll.json beside a single file, with which `spectroll verify` checks it.
    check_space : bool
        Refuses what the disk has no room for.
    progress : bool or function, optional
        True shows a bar of `tqdm`; None does where that is installed and standard error is a terminal. A function is called
        with the number of rows done and that of all.

    Returns
    -------
    Written
        The draws that this call made, the candidates that they took, and whether the data set is complete.

    Ctrl-C ends it with KeyboardInterrupt: a file leaves nothing behind, and a set can be resumed.
    """
    text = os.fspath(path)
    if dtype is None and isinstance(source, Sampler):
        dtype = source.dtype
    options = {
        "path": text,
        "is_folder": text.endswith(("/", os.sep)),
        "format": None if format is None else choice("format", format, FORMATS),
        "dtype": None if dtype is None else _dtype(dtype),
        "chunk": None if chunk is None else whole("chunk", chunk, 1),
        "zstd": None if zstd is None or zstd is False else 3 if zstd is True else whole("zstd", zstd, 1, 22),
        "shard": None if shard is None else shard_of(shard),
        "resume": bool(resume),
        "overwrite": bool(overwrite),
        "sidecar": bool(sidecar),
        "check_space": bool(check_space),
    }
    with _Shown(progress, text) as shown:
        if isinstance(source, Scene):
            if seed or stream is not None or quantities is not None:
                raise TypeError("a scene has its seed and its quantities from its file: Scene(name, seed=...)")
            scenes = range(len(source)) if n is None else source._range(n)
            complete = _spectroll.write_scenes(
                source._native, (scenes.start, scenes.stop), options, shown.callback
            )
            return Written(shown.done, 0, 0, complete)
        if not isinstance(source, Sampler):
            raise TypeError(f"{type(source).__name__}: a data set is of a Sampler or a Scene")
        if n is None:
            raise TypeError("n: say how many draws, or which")
        indices = range_of(n, "n")
        if indices.step != 1 and len_of(indices) > 1:
            raise ValueError(f"n={n!r}: a data set has draws without gaps")
        native, _ = source._native(quantities_of(quantities)[0])
        first = indices.start if len_of(indices) else 0
        written = _spectroll.write_draws(
            native, (first, len_of(indices)), (seed_of(seed), stream_of(stream)), options, shown.callback
        )
        return Written(*written)


FORMATS: Sequence[str] = ("npy", "npz", "csv", "h5", "mat", "parquet", "zarr", "spd")


def _dtype(dtype: Any) -> str:
    import numpy as np

    return choice("dtype", np.dtype(dtype).name, ("float32", "float16", "float64"))


def shard_of(shard: Any) -> tuple[int, int]:
    """A part and the number of parts, counted from 1 as the library does."""
    if isinstance(shard, str):
        index, _, count = shard.partition("/")
        if index.isdecimal() and count.isdecimal() and 1 <= int(index) <= int(count):
            return int(index), int(count)
        raise ValueError(f'shard={shard!r}: it is "I/N" from "1/N" to "N/N", or (i, n) from (0, n) on')
    try:
        part, parts = shard
    except (TypeError, ValueError):
        raise TypeError(f'shard={shard!r}: it is (i, n), or "I/N"') from None
    parts = whole("shard[1]", parts, 1)
    if not 0 <= part < parts:
        raise ValueError(
            f"shard=({part}, {parts}): parts are counted from 0, so the last is ({parts - 1}, {parts}); as text they are "
            f'counted from 1: "{parts}/{parts}"'
        )
    return whole("shard[0]", part) + 1, parts


class _Shown:
    """Progress, shown or told."""

    def __init__(self, progress: Progress, name: str) -> None:
        self.progress, self.name = progress, name
        self.done, self.all = 0, 0
        self.bar: Any = None

    def __enter__(self) -> _Shown:
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()

    def callback(self, all: int | None, rows: int) -> None:
        if all is not None:
            self.all = all
            self._begin()
        self.done += rows
        if callable(self.progress):
            self.progress(self.done, self.all)
        elif self.bar is not None:
            self.bar.update(rows)

    def _begin(self) -> None:
        if callable(self.progress) or self.progress is False:
            return
        if self.progress is None and not sys.stderr.isatty():
            return
        try:
            from tqdm.auto import tqdm
        except ImportError:
            if self.progress:
                raise ImportError("progress=True shows a bar of tqdm, which is not installed: pip install tqdm") from None
            return
        self.bar = tqdm(total=self.all, unit="draws", unit_scale=True, desc=os.path.basename(self.name.rstrip("/")))

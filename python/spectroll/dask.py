"""Draws as lazy arrays of Dask, and sets of chunks that a cluster writes.

A block is a pure function of its place, so that it does not matter which worker makes it, nor how often. Samplers are
sent to workers once for each graph, and draw on the thread that runs the task.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._sampler import Sampler
from ._values import len_of, quantities_of, range_of, seed_of, stream_of, whole

if TYPE_CHECKING:
    import dask.array as da


def _block(
    sampler: Sampler,
    source: tuple[int, str | None],
    quantity: str,
    indices: tuple[int, int],
    size: int,
    block_id: tuple[int, ...] = (0,),
) -> NDArray[Any]:
    """The draws of a block, by its place."""
    first, count = indices
    start = first + block_id[0] * size
    part = range(start, min(start + size, first + count))
    drawn: NDArray[Any] = sampler.draw(part, seed=source[0], stream=source[1], quantities=quantity)
    return drawn


def array(
    sampler: Sampler,
    n: int | range,
    *,
    seed: int = 0,
    stream: str | None = None,
    quantities: str = "spectra",
    chunks: int = 2**20,
) -> da.Array:
    """See `Sampler.dask`."""
    import dask.array as da
    from dask.base import tokenize

    if not isinstance(quantities, str):
        raise TypeError(f"quantities={quantities!r}: an array of Dask is of one quantity; make one for each")
    (quantity,), _ = quantities_of(quantities)
    indices = range_of(n, "n")
    if indices.step != 1 and len_of(indices) > 1:
        raise ValueError(f"n={n!r}: a lazy array has draws without gaps")
    count, first = len_of(indices), indices.start
    size = min(whole("chunks", chunks, 1), max(count, 1))
    alone = sampler.with_threads(1)
    _, dtype, width, axis, _ = alone._native((quantity,))[1].formats[0]
    rows = (size,) * (count // size) + ((count % size,) if count % size else ())
    shape: tuple[tuple[int, ...], ...] = (rows or (0,),) if axis is None else (rows or (0,), (width,))
    source = seed_of(seed), stream_of(stream)
    token = tokenize(alone._key(), alone.model.to_json(), source, quantity, first, count, size)
    lazy: da.Array = da.map_blocks(  # type: ignore[no-untyped-call]
        _block,
        chunks=shape,
        dtype=dtype,
        meta=np.empty((0,) * len(shape), dtype),
        name=f"spectroll-{quantity}-{token}",
        sampler=alone,
        source=source,
        quantity=quantity,
        indices=(first, count),
        size=size,
    )
    return lazy


def write(
    path: str | os.PathLike[str] | Any,
    sampler: Sampler,
    n: int | range,
    *,
    seed: int = 0,
    stream: str | None = None,
    quantities: str | list[str] | None = None,
    chunks: int = 2**20,
    zarr_format: int = 3,
    overwrite: bool = False,
    compute: bool = True,
) -> Any:
    """Writes a Zarr group with an array for each quantity, one chunk a block, from a cluster's workers.

    Parameters
    ----------
    path : str, path, or a store of zarr
        Wherever zarr writes: a folder that all workers see, or a URL of fsspec such as "s3://bucket/train.zarr".
    sampler, n, seed, stream, quantities, chunks
        See `Sampler.dask`. Chunks of the store are those of the array, so that no two workers write one.
    zarr_format : 3 or 2
    overwrite : bool
        Replaces arrays that exist.
    compute : bool
        False returns the lazy writes, one for each array, to be computed together.
    """
    import dask.array as da
    import zarr
    from dask.base import compute as together

    names, _ = quantities_of(quantities)
    group = zarr.open_group(path, mode="w" if overwrite else "w-", zarr_format=zarr_format)  # type: ignore[arg-type]
    group.attrs.update(attributes(sampler, range_of(n, "n"), seed, stream))
    writes = []
    for name in names:
        lazy = array(sampler, n, seed=seed, stream=stream, quantities=name, chunks=chunks)
        formats = sampler._native((name,))[1].formats[0]
        axes = ["draw"] if formats[3] is None else ["draw", formats[3]]
        target = group.create_array(
            name,
            shape=lazy.shape,
            dtype=lazy.dtype,
            chunks=tuple(max(int(extent), 1) for extent in lazy.chunksize),
            **({"dimension_names": axes} if zarr_format == 3 else {"attributes": {"_ARRAY_DIMENSIONS": axes}}),
        )
        # Blocks are chunks, so that no two tasks write one, and no lock is needed.
        store: Any = da.store
        writes.append(store(lazy, target, lock=False, compute=False))
    grid = group.create_array("wavelength", data=np.asarray(sampler.wavelengths), **_axis(zarr_format))
    grid.attrs["units"] = "nm"
    if not compute:
        return writes
    together(*writes)  # type: ignore[no-untyped-call]
    return group


def _axis(zarr_format: int) -> dict[str, Any]:
    if zarr_format == 3:
        return {"dimension_names": ["wavelength"]}
    return {"attributes": {"_ARRAY_DIMENSIONS": ["wavelength"]}}


def attributes(sampler: Sampler, indices: range, seed: int, stream: str | None) -> dict[str, Any]:
    """The attributes of a store, from which the same draws can be made again: model, settings, seed, stream and start."""
    from ._spectroll import __version__

    return {
        "model": sampler.model.name,
        "kind": sampler.model.kind,
        "recipe": sampler.settings,
        "seed": seed,
        "stream": stream,
        "start": indices.start,
        "program": f"spectroll {__version__} (python)",
    }


__all__ = ["array", "write"]

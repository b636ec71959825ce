"""Draws as data sets of PyTorch.

What a draw is depends on its index alone, so a map-style data set has any sampler, shuffling and number of workers that a
`DataLoader` takes, and an iterable one divides its batches among the workers and ranks that it finds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

import torch
from torch.utils.data import Dataset, IterableDataset, get_worker_info

from ._sampler import Quantities, Sampler
from ._values import len_of, quantities_of, range_of, seed_of, stream_of, whole


def _tensors(drawn: Any) -> Any:
    """Tensors that share the memory of arrays; counts as 64-bit integers, for PyTorch has few unsigned ones."""
    if isinstance(drawn, dict):
        return {name: _tensors(array) for name, array in drawn.items()}
    return torch.from_numpy(drawn.astype(np.int64) if drawn.dtype == np.uint32 else drawn)


class _Draws:
    """Draws of a range of indices."""

    def __init__(self, sampler: Sampler, n: int | range, seed: int, stream: str | None, quantities: Quantities) -> None:
        # Workers are processes, and each has a core.
        self.sampler = sampler.with_threads(1)
        self.indices = range_of(n, "n")
        self.seed, self.stream = seed_of(seed), stream_of(stream)
        names, single = quantities_of(quantities)
        self.quantities = names[0] if single else list(names)

    def __len__(self) -> int:
        return len_of(self.indices)

    def at(self, ids: Any) -> Any:
        """Tensors of draws by their indices."""
        return _tensors(self.sampler.at(ids, seed=self.seed, stream=self.stream, quantities=self.quantities))


class MapDraws(_Draws, Dataset):  # type: ignore[misc]
    """Map-style: item i is draw `indices[i]`."""

    def _ids(self, items: Sequence[int]) -> Any:
        count = len(self)
        places = np.asarray(items, np.int64)
        wrong = places[(places < -count) | (places >= count)]
        if wrong.size:
            raise IndexError(f"item {wrong[0]} of {count}")
        start, step = np.uint64(self.indices.start), np.uint64(self.indices.step % 2**64)
        with np.errstate(over="ignore"):
            return start + step * (places % count).astype(np.uint64)

    def __getitem__(self, item: int) -> Any:
        drawn = self.at(self._ids([item]))
        return {name: tensor[0] for name, tensor in drawn.items()} if isinstance(drawn, dict) else drawn[0]

    def __getitems__(self, items: Sequence[int]) -> Any:
        """A whole batch at once, which the fetcher of `DataLoader` asks for where there is this method."""
        drawn = self.at(self._ids(items))
        if isinstance(drawn, dict):
            return [{name: tensor[i] for name, tensor in drawn.items()} for i in range(len(items))]
        return list(drawn)


class IterableDraws(_Draws, IterableDataset):  # type: ignore[misc]
    """Iterable: batches of draws in order, of which each worker of each rank has its share. Pass `batch_size=None` to
    `DataLoader`, since these are batches already."""

    def __init__(
        self,
        sampler: Sampler,
        n: int | range,
        seed: int,
        stream: str | None,
        quantities: Quantities,
        batch_size: int,
    ) -> None:
        super().__init__(sampler, n, seed, stream, quantities)
        self.batch_size = whole("batch_size", batch_size, 1)

    def __len__(self) -> int:
        """Number of batches of all workers and ranks."""
        return -(-len_of(self.indices) // self.batch_size)

    def __iter__(self) -> Iterator[Any]:
        worker, workers = share()
        for batch in range(worker, len(self), workers):
            start = batch * self.batch_size
            part = self.indices[start : start + self.batch_size]
            yield _tensors(
                self.sampler.draw(part, seed=self.seed, stream=self.stream, quantities=self.quantities)
            )


def share() -> tuple[int, int]:
    """(i, n): the number of this worker among those of all ranks, from 0, and how many there are."""
    info = get_worker_info()
    worker, workers = (info.id, info.num_workers) if info is not None else (0, 1)
    distributed = getattr(torch, "distributed", None)
    rank, ranks = 0, 1
    if distributed is not None and distributed.is_available() and distributed.is_initialized():
        rank, ranks = distributed.get_rank(), distributed.get_world_size()
    return rank * workers + worker, ranks * workers


def dataset(
    sampler: Sampler,
    n: int | range,
    *,
    seed: int = 0,
    stream: str | None = None,
    quantities: Quantities = None,
    batch_size: int | None = None,
) -> MapDraws | IterableDraws:
    """See `Sampler.torch`."""
    if batch_size is None:
        return MapDraws(sampler, n, seed, stream, quantities)
    return IterableDraws(sampler, n, seed, stream, quantities, batch_size)


__all__ = ["IterableDraws", "MapDraws", "dataset", "share"]

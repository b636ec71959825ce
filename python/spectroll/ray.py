"""Draws as data sets of Ray."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._sampler import Quantities, Sampler
from ._values import quantities_of, seed_of, stream_of, whole

if TYPE_CHECKING:
    import ray.data


class Draws:
    """Turns batches of ids into draws, as `ray.data.Dataset.map_batches` and the like want it: a mapping with an array
    "id" becomes one with the ids and an array for each quantity."""

    def __init__(
        self, sampler: Sampler, *, seed: int = 0, stream: str | None = None, quantities: Quantities = None
    ) -> None:
        self.sampler = sampler.with_threads(1)
        self.names, _ = quantities_of(quantities)
        self.seed, self.stream = seed_of(seed), stream_of(stream)

    def __call__(self, batch: dict[str, Any]) -> dict[str, NDArray[Any]]:
        ids = np.asarray(batch["id"], np.uint64)
        drawn = self.sampler.at(ids, seed=self.seed, stream=self.stream, quantities=list(self.names))
        return {"id": batch["id"], **drawn}


def dataset(
    sampler: Sampler,
    n: int,
    seed: int = 0,
    *,
    stream: str | None = None,
    quantities: Quantities = None,
    batch_size: int = 2**16,
    **map_batches: Any,
) -> ray.data.Dataset:
    """Draws 0 to n - 1 as a `ray.data.Dataset`: columns "id" and one for each quantity, made by the workers as they are
    consumed, on one thread each. More arguments go to `map_batches`."""
    import ray.data

    ids = ray.data.range(whole("n", n))
    draws = Draws(sampler, seed=seed, stream=stream, quantities=quantities)
    return ids.map_batches(draws.__call__, batch_size=batch_size, batch_format="numpy", **map_batches)


__all__ = ["Draws", "dataset"]

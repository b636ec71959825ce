"""Arrays of draws in the layouts of the library, always seen as (draws, values)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Format = tuple[str, str, int, str | None, list[str]]


class Arrays:
    """The arrays that a native sampler fills, in its order."""

    __slots__ = ("formats", "layout")

    def __init__(self, formats: list[Format], layout: str) -> None:
        self.formats, self.layout = formats, layout

    def empty(self, shape: tuple[int, ...]) -> tuple[list[NDArray[np.uint8]], dict[str, NDArray[Any]]]:
        """Memory for draws in this shape: bytes to be filled, and the arrays that they are."""
        count = 1
        for extent in shape:
            count *= extent
        buffers, found = [], {}
        for name, dtype, width, axis, _ in self.formats:
            if axis is None or self.layout == "rows":
                base = np.empty((count, width), dtype)
                view = base
            elif self.layout == "padded-rows":
                base = np.empty((count, -(-width // 4) * 4), dtype)
                view = base[:, :width]
            else:
                base = np.empty((width, -(-count // 4) * 4), dtype)
                view = base[:, :count].T
            buffers.append(base.reshape(-1).view(np.uint8))
            found[name] = view.reshape(shape) if axis is None else _shaped(view, shape)
        return buffers, found

    def given(
        self, out: Mapping[str, Any], shape: tuple[int, ...], names: tuple[str, ...]
    ) -> tuple[list[NDArray[np.uint8]], dict[str, NDArray[Any]]]:
        """Arrays of the caller's, checked."""
        if self.layout != "rows":
            raise ValueError(f'out: arrays in layout="{self.layout}" are made, and not given; use layout="rows"')
        if not isinstance(out, Mapping):
            raise TypeError("out: a list of quantities takes a mapping of arrays, by their names")
        missing = [name for name in names if name not in out]
        if missing or len(out) != len(names):
            raise ValueError(f"out: it has the arrays {sorted(out)}, where {sorted(names)} are asked for")
        buffers = []
        for name, dtype, width, axis, _ in self.formats:
            array, wanted = out[name], shape if axis is None else (*shape, width)
            if not isinstance(array, np.ndarray):
                raise TypeError(f"out: {name} is {type(array).__name__}, and not an array")
            if array.shape != wanted or array.dtype != dtype or not array.dtype.isnative:
                raise ValueError(f"out: {name} is {array.shape} {array.dtype}, where {wanted} {dtype} is drawn")
            if not (array.flags.c_contiguous and array.flags.writeable):
                raise ValueError(f"out: {name} must be C-contiguous and writeable")
            buffers.append(array.reshape(-1).view(np.uint8))
        return buffers, dict(out)


def _shaped(view: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """A view of (count, width) with the count in this shape."""
    return view if len(shape) == 1 else view.reshape(*shape, view.shape[1])

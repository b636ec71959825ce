"""The machine: its graphics adapters."""

from __future__ import annotations

from typing import NamedTuple

from . import _spectroll


class Adapter(NamedTuple):
    """A graphics adapter, as its driver describes itself."""

    name: str
    """Name of the adapter; `Sampler(engine=...)` takes a part of it, or its index."""
    backend: str
    """Interface it is reached by: vulkan, metal or dx12."""
    kind: str
    """discrete, integrated, virtual, software or other."""
    driver: str
    """Driver and its version."""


def adapters() -> list[Adapter]:
    """The graphics adapters of this machine, in the order in which `Sampler(engine="0")` counts them."""
    return [Adapter(*adapter) for adapter in _spectroll.adapters()]

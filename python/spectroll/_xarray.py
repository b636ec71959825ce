"""Draws as arrays of xarray."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._values import len_of, quantities_of

if TYPE_CHECKING:
    import xarray

    from ._sampler import Quantities, Sampler


def of_draws(
    sampler: Sampler, indices: range, seed: int, stream: str | None, quantities: Quantities
) -> xarray.DataArray | xarray.Dataset:
    """Draws with their coordinates."""
    import xarray

    names, single = quantities_of(quantities)
    drawn = sampler.draw(indices, seed=seed, stream=stream, quantities=list(names))
    _, arrays = sampler._native(names)
    coordinates = coordinates_of(sampler, indices)
    for name, *_, axis, channels in arrays.formats:
        if axis is None:
            continue
        if axis == "wavelength":
            coordinates["wavelength"] = ("wavelength", sampler.wavelengths, {"units": "nm"})
        elif channels:
            coordinates[axis_of(name, axis)] = channels
    axes = {name: ("draw", axis_of(name, axis)) if axis else ("draw",) for name, *_, axis, _ in arrays.formats}
    variables = {name: (axes[name], drawn[name], attributes(sampler, name)) for name in names}
    attrs = {"model": sampler.model.name, "seed": seed, "stream": stream or "", "kind": sampler.model.kind}
    dataset = xarray.Dataset(variables, coords=coordinates, attrs=attrs)
    if not single:
        return dataset
    array: xarray.DataArray = dataset[names[0]].assign_attrs(attrs)
    return array


def axis_of(name: str, axis: str) -> str:
    """The name of the axis of a quantity's values: a data set has one length for a name, and XYZ are three where xy are two."""
    return f"{name}_{axis}" if axis == "channel" else axis


def coordinates_of(sampler: Sampler, indices: range) -> dict[str, Any]:
    """The indices of draws."""
    count = len_of(indices)
    first = np.uint64(indices[0] if count else 0)
    step = np.uint64(indices.step % 2**64)
    with np.errstate(over="ignore"):
        return {"draw": first + step * np.arange(count, dtype=np.uint64)}


def attributes(sampler: Sampler, name: str) -> dict[str, str]:
    """Units of a quantity."""
    if name in ("spectra", "lrv"):
        return {"units": "1"} if sampler.model.kind == "reflectance" else {"long_name": "power"}
    return {}

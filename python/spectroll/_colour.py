"""Draws for colour-science."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ._sampler import Sampler


def of_draws(sampler: Sampler, indices: range, seed: int, stream: str | None) -> Any:
    """Spectra as `colour.MultiSpectralDistributions`, labelled by their indices."""
    import colour

    spectra = sampler.draw(indices, seed=seed, stream=stream)
    labels = [str(index) for index in indices]
    return colour.MultiSpectralDistributions(
        np.asarray(spectra, np.float64).T, domain=sampler.wavelengths, labels=labels
    )

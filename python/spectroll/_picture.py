"""Pictures for notebooks: a model with its mean, its components and draws in their colours, and the draws of a sampler.

Lines and text take the colour of the page's text, so that they show on light and dark grounds. `spectroll inspect` makes
larger pictures.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ._model import Model
    from ._sampler import Sampler

DRAWS = 60
WIDTH, HEIGHT = 300, 210
LEFT, RIGHT, TOP, BOTTOM = 46, 10, 26, 36
LINES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#6b6b6b", "#8f6f00")


class Panel:
    """A panel of curves over wavelengths."""

    def __init__(self, place: int, title: str, wavelengths: NDArray[Any], values: Iterable[NDArray[Any]]) -> None:
        all = np.concatenate([np.ravel(each) for each in values])
        low, high = float(all.min()), float(all.max())
        margin = 0.05 * ((high - low) or 1.0)
        self.low, self.high = (0.0 if low >= 0 else low - margin), high + margin
        self.x0 = place * WIDTH
        self.wavelengths = np.asarray(wavelengths, float)
        self.parts = [f'<text x="{self.x0 + LEFT}" y="16" font-weight="600">{escape(title)}</text>']
        self._axes()

    def x(self, wavelength: Any) -> Any:
        first, last = self.wavelengths[0], self.wavelengths[-1]
        share = (np.asarray(wavelength) - first) / ((last - first) or 1.0)
        return self.x0 + LEFT + share * (WIDTH - LEFT - RIGHT)

    def y(self, value: Any) -> Any:
        share = (np.asarray(value, float) - self.low) / (self.high - self.low)
        return HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM)

    def _axes(self) -> None:
        left, right = self.x0 + LEFT, self.x0 + WIDTH - RIGHT
        bottom = HEIGHT - BOTTOM
        frame = f"M{left} {TOP}V{bottom}H{right}"
        self.parts.append(f'<path d="{frame}" stroke="currentColor" stroke-opacity=".5" fill="none"/>')
        for wavelength in ticks(self.wavelengths[0], self.wavelengths[-1], 4):
            x = self.x(wavelength)
            self.parts.append(f'<path d="M{x:.1f} {bottom}v4" stroke="currentColor" stroke-opacity=".5"/>')
            self.parts.append(
                f'<text x="{x:.1f}" y="{bottom + 15}" text-anchor="middle" opacity=".75">{wavelength:g}</text>'
            )
        for value in ticks(self.low, self.high, 4):
            y = float(self.y(value))
            self.parts.append(f'<path d="M{left} {y:.1f}h-4" stroke="currentColor" stroke-opacity=".5"/>')
            self.parts.append(
                f'<text x="{left - 7}" y="{y + 3.5:.1f}" text-anchor="end" opacity=".75">{value:g}</text>'
            )
        middle = (left + right) / 2
        self.parts.append(
            f'<text x="{middle}" y="{HEIGHT - 5}" text-anchor="middle" opacity=".75">wavelength (nm)</text>'
        )

    def curve(self, values: Any, colour: str, width: float = 1.4, opacity: float = 1.0) -> None:
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(self.x(self.wavelengths), self.y(values)))
        self.parts.append(
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width}" '
            f'stroke-opacity="{opacity}" stroke-linejoin="round"/>'
        )

    def band(self, low: Any, high: Any, colour: str) -> None:
        x = self.x(self.wavelengths)
        edge = [*zip(x, self.y(high)), *zip(x[::-1], self.y(low)[::-1])]
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in edge)
        self.parts.append(f'<polygon points="{points}" fill="{colour}" fill-opacity=".2"/>')


def ticks(low: float, high: float, count: int) -> list[float]:
    """Round numbers between two, about so many."""
    span = (high - low) or 1.0
    size = 10.0 ** np.floor(np.log10(span / count))
    step = next(size * factor for factor in (1, 2, 2.5, 5, 10) if span / (size * factor) <= count)
    return [round(float(k * step), 12) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def svg(panels: Sequence[Panel], label: str) -> str:
    width = WIDTH * len(panels)
    parts = "".join(part for panel in panels for part in panel.parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{HEIGHT}" viewBox="0 0 {width} {HEIGHT}" '
        f'role="img" aria-label="{escape(label, quote=True)}" font-family="sans-serif" font-size="11" '
        f'fill="currentColor">{parts}</svg>'
    )


def colours(linear: NDArray[Any]) -> list[str]:
    """Colours of sRGB for linear components: what is brighter than 1 as it is in hue."""
    shown = np.clip(linear / np.maximum(1.0, linear.max(axis=1, keepdims=True)), 0.0, 1.0)
    encoded = np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)
    return ["#" + "".join(f"{int(round(255 * float(c))):02x}" for c in rgb) for rgb in encoded]


def drawn(place: int, sampler: Sampler) -> Panel:
    """A panel of draws, each in its colour."""
    wavelengths = sampler.wavelengths
    spectra = sampler.draw(DRAWS)
    fills = ["currentColor"] * DRAWS
    try:
        linear = np.asarray(sampler.draw(DRAWS, quantities="linear_srgb"), float)
    except ValueError:  # a grid without visible light
        linear = None
    if linear is not None:
        if sampler.model.kind == "illuminant":  # of any magnitude
            linear = linear / np.maximum(linear.max(axis=1, keepdims=True), 1e-30)
        fills = colours(linear)
    title = f"{DRAWS} {sampler.model.kind}s" + (", in their colours" if linear is not None else "")
    panel = Panel(place, title, wavelengths, [spectra])
    for spectrum, fill in zip(spectra, fills):
        panel.curve(spectrum, fill, 1.2, 0.9)
    return panel


def of_model(model: Model) -> str:
    """The picture of a model: mean, components, and draws where there can be any."""
    from ._sampler import Sampler

    mean = model.reconstruct(model.weight_mean)
    deviation = np.sqrt(np.einsum("ij,ik,kj->j", model.basis, model.weight_covariance, model.basis))
    first = Panel(0, "mean ± 1 standard deviation", model.wavelengths, [mean - deviation, mean + deviation])
    first.band(mean - deviation, mean + deviation, LINES[0])
    first.curve(mean, LINES[0], 2.0)
    shown = model.basis[: len(LINES)]
    count = len(shown)
    second = Panel(1, f"components 1 to {count}" if count > 1 else "component 1", model.wavelengths, [shown])
    for colour, row in zip(LINES, shown):
        second.curve(row, colour)
    panels = [first, second]
    try:
        panels.append(drawn(2, Sampler(model, engine="cpu", threads=1)))
    except ValueError:
        pass  # nothing of it can be drawn without settings
    return svg(panels, repr(model)[1:-1])


def of_sampler(sampler: Sampler) -> str:
    """The picture of a sampler: some of its draws."""
    return svg([drawn(0, sampler)], repr(sampler)[1:-1])


def page(title: str, picture: str, rows: Iterable[tuple[str, str]]) -> str:
    """A heading, a picture and some facts, for notebooks."""
    facts = "".join(f"<tr><th>{escape(name)}</th><td>{escape(str(value))}</td></tr>" for name, value in rows)
    return f"<div><p><strong>{escape(title)}</strong></p>{picture}<table>{facts}</table></div>"

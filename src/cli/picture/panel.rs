//! Panels of a picture of spectra, two by two, and their axes.

use std::sync::Arc;

use kuva::prelude::{Figure, Layout, Plot, ReferenceLine, TickFormat};
use kuva::render::render::Scene;
use spectroll::evaluation::plot::{Caption, Place, Theme};
use spectroll::{Grid, SpectrumKind};

/// The size of a panel.
pub(super) const PANEL: (f64, f64) = (430.0, 330.0);

/// Margins of a panel for text on its left, right, top and bottom: the same for all, so that their axes align.
pub(super) const MARGINS: [f64; 4] = [70.0, 14.0, 52.0, 48.0];

/// Between panels and around them.
const GAP: f64 = 14.0;

/// One panel: what is drawn, on what axes, and the text around them.
pub(super) type Panel = (Vec<Plot>, Layout, Caption);

/// Draws panels, two in a row.
pub(super) fn arrange<const N: usize>(panels: [Panel; N], theme: Theme) -> Scene {
    let (mut plots, mut layouts, mut text) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (plot, layout, caption)) in panels.into_iter().enumerate() {
        plots.push(plot);
        layouts.push(layout);
        text.extend(caption.draw(&place(index), theme));
    }
    let mut drawing = Figure::new(N.div_ceil(2), 2)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(PANEL.0, PANEL.1)
        .with_spacing(GAP)
        .with_padding(GAP)
        .render();
    drawing.elements.extend(text);
    drawing
}

/// Place of a panel, row by row.
pub(super) fn place(index: usize) -> Place {
    let at = |place: usize, size: f64| GAP + place as f64 * (size + GAP);
    Place { corner: (at(index % 2, PANEL.0), at(index / 2, PANEL.1)), size: PANEL, margins: MARGINS }
}

/// Axes of spectra.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes {
    /// Kind of the spectra.
    pub(super) kind: SpectrumKind,
    /// Their wavelengths.
    pub(super) grid: Grid,
    /// The ground.
    pub(super) theme: Theme,
}

impl Axes {
    /// Axes for values of spectra, with lines at the limits of what is physical where the axes go beyond.
    pub(super) fn values(&self, (low, high): (f64, f64)) -> Layout {
        let mut layout = self.spectra((low, high));
        if low < 0.0 {
            layout = layout.with_reference_line(self.guide(0.0));
        }
        if self.kind == SpectrumKind::Reflectance && high > 1.0 {
            layout = layout.with_reference_line(self.guide(1.0));
        }
        layout
    }

    /// Axes for spectra.
    pub(super) fn spectra(&self, y: (f64, f64)) -> Layout {
        self.theme
            .axes(ends(self.grid), y, MARGINS)
            .with_x_label("wavelength (nm)")
            .with_y_tick_format(TickFormat::Custom(Arc::new(spectral_value)))
    }

    pub(super) fn guide(&self, y: f64) -> ReferenceLine {
        ReferenceLine::horizontal(y).with_color(self.theme.ink()).with_stroke_width(1.0)
    }

    pub(super) fn label(&self) -> &'static str {
        match self.kind {
            SpectrumKind::Reflectance => "reflectance",
            SpectrumKind::Illuminant => "relative power",
        }
    }

    /// The limits of an axis of spectral values.
    pub(super) fn limits<'v>(&self, values: impl Iterator<Item = &'v f64>) -> (f64, f64) {
        let (low, high) = values.fold((0.0, 0.0), |(a, b): (f64, f64), &v| (a.min(v), b.max(v)));
        match self.kind {
            SpectrumKind::Reflectance if high <= 1.0 => (1.05 * low, 1.0),
            SpectrumKind::Illuminant if high <= 0.0 => (1.05 * low, 1.0),
            _ => (1.05 * low, 1.05 * high),
        }
    }
}

/// The points of a spectrum's line. A single band is a line as wide as its step.
pub(super) fn curve(grid: Grid, values: &[f64]) -> Vec<(f64, f64)> {
    match values {
        [value] => [-0.5, 0.5].map(|side| (grid.first() + side * grid.step(), *value)).to_vec(),
        _ => grid.wavelengths().zip(values.iter().copied()).collect(),
    }
}

/// The ends of an axis of wavelengths.
fn ends(grid: Grid) -> (f64, f64) {
    let pad = if grid.len() == 1 { grid.step() } else { 0.0 };
    (grid.first() - pad, grid.last() + pad)
}

/// A value of a spectrum, short enough for the left margin.
fn spectral_value(value: f64) -> String {
    if value.abs() < 1e5 { TickFormat::Auto.format(value) } else { TickFormat::Sci.format(value) }
}

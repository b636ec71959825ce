//! The picture of a file of spectra, two panels: as they were measured, and on a grid.

use kuva::prelude::{LinePlot, Plot};
use kuva::render::render::Scene;
use spectroll::evaluation::plot::{self, Caption, Theme};
use spectroll::wording::wrapped;
use spectroll::{Dataset, SpectrumKind, Table};

use super::colours::Colours;
use super::panel::{self, Axes, MARGINS, Panel, curve, place};

/// The most spectra that are shown: beyond these they hide each other.
const MAX_SHOWN: usize = 400;

/// Contents of a picture.
#[derive(Clone, Copy, Debug)]
pub(in crate::cli) struct Picture<'a> {
    /// Name of the file.
    pub(in crate::cli) name: &'a str,
    /// Describes how it was read.
    pub(in crate::cli) note: &'a str,
    /// The spectra as they were measured.
    pub(in crate::cli) table: &'a Table,
    /// The spectra on a grid, or why they are on none.
    pub(in crate::cli) gridded: Result<&'a Dataset, &'a str>,
    /// Their kind, where it is known.
    pub(in crate::cli) kind: Option<SpectrumKind>,
    /// The ground.
    pub(in crate::cli) theme: Theme,
}

impl Picture<'_> {
    /// The picture, drawn.
    pub(in crate::cli) fn drawing(&self) -> Scene {
        let mut drawing = panel::arrange([self.measured(), self.on_grid()], self.theme);
        if let Err(reason) = self.gridded {
            drawing.elements.extend(place(1).paragraph(&wrapped(reason, 44), self.theme));
        }
        plot::head(&mut drawing, &super::title(self.name), self.note, self.theme);
        drawing
    }

    fn label(&self) -> String {
        match self.kind {
            Some(SpectrumKind::Reflectance) => "reflectance".to_owned(),
            Some(SpectrumKind::Illuminant) => "power, as measured".to_owned(),
            None => "value".to_owned(),
        }
    }

    /// Numbers of the spectra that are shown: all, or as many evenly among them.
    fn shown(&self) -> Vec<usize> {
        let count = self.table.len();
        let shown = count.min(MAX_SHOWN);
        (0..shown).map(|i| i * count / shown).collect()
    }

    /// Each spectrum in a colour of its own where that is known, else one after the other in those of the theme.
    fn colour(&self, of: usize, colours: Option<&Colours>, index: usize) -> String {
        match (colours, self.gridded) {
            (Some(colours), Ok(data)) => colours.of(data.spectra().column(index).as_slice()),
            _ => self.theme.colours()[of % self.theme.colours().len()].to_owned(),
        }
    }

    /// Colours of the spectra, where all of them can be seen: one that is a hundred times too high would be white.
    fn colours(&self) -> Option<Colours> {
        let kind = self.kind?;
        let data = self.gridded.ok()?;
        data.judge(kind).ok()?;
        Some(Colours::new(kind, data.grid(), self.theme))
    }

    fn measured(&self) -> Panel {
        let wavelengths = self.table.wavelengths();
        let (colours, shown) = (self.colours(), self.shown());
        let mut plots: Vec<Plot> = Vec::new();
        let (mut low, mut high) = (0.0f64, 0.0f64);
        for (of, &index) in shown.iter().enumerate() {
            let colour = self.colour(of, colours.as_ref(), index);
            let spectrum = self.table.spectrum(index);
            for v in spectrum.iter().filter(|v| v.is_finite()) {
                (low, high) = (low.min(*v), high.max(*v));
            }
            // A gap is no line.
            let mut run: Vec<(f64, f64)> = Vec::new();
            for (&wavelength, &value) in wavelengths.iter().zip(spectrum).chain([(&0.0, &f64::NAN)]) {
                if value.is_finite() {
                    run.push((wavelength, value));
                } else if !run.is_empty() {
                    if let [(x, y)] = run[..] {
                        run = vec![(x - 0.5, y), (x + 0.5, y)];
                    }
                    let line = LinePlot::new().with_data(std::mem::take(&mut run));
                    plots.push(line.with_color(colour.clone()).with_stroke_width(1.0).into());
                }
            }
        }
        if plots.is_empty() {
            plots.push(LinePlot::new().into());
        }
        let (first, last) = (wavelengths[0], wavelengths[wavelengths.len() - 1]);
        let pad = if first == last { 1.0 } else { 0.0 };
        let top = if high > low { high } else { low + 1.0 };
        let layout = self
            .theme
            .axes((first - pad, last + pad), (1.05 * low, 1.05 * top), MARGINS)
            .with_x_label("wavelength (nm)");
        let caption = Caption {
            title: "As measured".to_owned(),
            note: match shown.len() == self.table.len() {
                true => format!("{} spectra at {} wavelengths", self.table.len(), wavelengths.len()),
                false => format!(
                    "{} of {} spectra at {} wavelengths",
                    shown.len(),
                    self.table.len(),
                    wavelengths.len()
                ),
            },
            vertical: self.label(),
        };
        (plots, layout, caption)
    }

    fn on_grid(&self) -> Panel {
        let data = match self.gridded {
            Ok(data) => data,
            Err(_) => {
                let layout = self.theme.blank(MARGINS);
                let caption = Caption { title: "No model can be fitted".to_owned(), ..Caption::default() };
                return (vec![LinePlot::new().into()], layout, caption);
            }
        };
        let grid = data.grid();
        let axes = Axes {
            kind: self.kind.unwrap_or(SpectrumKind::Illuminant),
            grid: grid.clone(),
            theme: self.theme,
        };
        let colours = self.colours();
        let shown = self.shown();
        let line = |(of, index): (usize, &usize)| {
            let values: Vec<f64> = data.spectra().column(*index).iter().copied().collect();
            let colour = self.colour(of, colours.as_ref(), *index);
            LinePlot::new().with_data(curve(grid, &values)).with_color(colour).with_stroke_width(1.0).into()
        };
        let plots: Vec<Plot> = shown.iter().enumerate().map(line).collect();
        let columns: Vec<f64> = shown
            .iter()
            .flat_map(|&i| data.spectra().column(i).iter().copied().collect::<Vec<_>>())
            .collect();
        let caption = Caption {
            title: format!("At {grid} nm"),
            note: colours.as_ref().map_or("as a model has them", |colours| colours.note()).to_owned(),
            vertical: self.label(),
        };
        (plots, axes.values(axes.limits(columns.iter())), caption)
    }
}

//! The models that are built in, and the data that they are fitted to.

use super::{Fit, Model, ModelError};
use crate::dataset::{BuiltinTable, Dataset, ResampleMethod, Resampling, SpectrumKind, Table};
use crate::grid::Grid;

/// The measurements behind a built-in model, which [`Model::builtin_at`] fits at the wavelengths that are asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BuiltinData {
    /// Kind of the spectra.
    pub kind: SpectrumKind,
    /// The number of spectra.
    pub spectra: usize,
    /// The first wavelength at which all of them were measured, nm.
    pub first: f64,
    /// The last wavelength at which all of them were measured, nm.
    pub last: f64,
    /// The step at which all of them were measured, nm; a finer grid is interpolated.
    pub step: f64,
}

/// A family of built-in models: the same data at different wavelengths.
struct Family {
    kind: SpectrumKind,
    tables: &'static [BuiltinTable],
    /// Models that were fitted once: a fit made now could differ in its last digits, and so would every draw of it.
    fitted: &'static [(&'static str, &'static str)],
}

const MUNSELL_VRHEL: Family = Family {
    kind: SpectrumKind::Reflectance,
    tables: &[BuiltinTable::Munsell, BuiltinTable::Vrhel],
    fitted: &[],
};

const GRANADA: Family = Family {
    kind: SpectrumKind::Illuminant,
    tables: &[BuiltinTable::Granada],
    fitted: &[
        ("400:10:700", include_str!("../../data/granada.json")),
        ("400:5:700", include_str!("../../data/granada-5nm.json")),
    ],
};

impl Model {
    /// The names of the built-in models. `-5nm` is the grid 400:5:700, the others are at 400:10:700.
    pub const BUILTIN: &[&str] = &["munsell-vrhel", "granada", "munsell-vrhel-5nm", "granada-5nm"];

    /// A built-in model: `munsell-vrhel` (reflectances, fitted here to the compiled-in tables) or `granada`
    /// (daylights, fitted once to the measurements of Hernández-Andrés et al. 2001), with or without `-5nm`.
    pub fn builtin(name: &str) -> Result<Model, ModelError> {
        let (family, grid) = family(name)?;
        family.at(name, grid)
    }

    /// A built-in model at other wavelengths: a fit of its data on `grid`, which must lie within what was measured
    /// (see [`builtin_data`](Model::builtin_data)). On the grids of [`builtin`](Model::builtin) it is that model;
    /// `-5nm` in a name makes no difference.
    ///
    /// ```
    /// let grid: spectroll::Grid = "380:5:780".parse()?;
    /// let daylights = spectroll::Model::builtin_at("granada", grid.clone())?;
    /// assert_eq!((daylights.grid(), daylights.components()), (&grid, 6));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn builtin_at(name: &str, grid: Grid) -> Result<Model, ModelError> {
        family(name)?.0.at(name, grid)
    }

    /// The data that a built-in model is fitted to.
    pub fn builtin_data(name: &str) -> Result<BuiltinData, ModelError> {
        let (family, _) = family(name)?;
        Ok(family.data(&family.tables()))
    }
}

/// The family of a name, and the grid that the name stands for.
fn family(name: &str) -> Result<(Family, Grid), ModelError> {
    let fine = Grid::new(400.0, 5.0, 61)?;
    match name {
        "munsell-vrhel" => Ok((MUNSELL_VRHEL, Grid::DEFAULT)),
        "munsell-vrhel-5nm" => Ok((MUNSELL_VRHEL, fine)),
        "granada" => Ok((GRANADA, Grid::DEFAULT)),
        "granada-5nm" => Ok((GRANADA, fine)),
        _ => Err(ModelError::NoBuiltin { name: name.to_owned() }),
    }
}

impl Family {
    fn at(&self, name: &str, grid: Grid) -> Result<Model, ModelError> {
        if let Some((_, text)) = self.fitted.iter().find(|(fitted, _)| fitted.parse().as_ref() == Ok(&grid)) {
            return Model::from_json(name, text);
        }
        let tables = self.tables();
        let BuiltinData { first, last, .. } = self.data(&tables);
        let name = || name.to_owned();
        // Averages where these data are finer than a grid would change the draws of models that are built in.
        let settings = Resampling::default().method(ResampleMethod::Interpolate);
        let data = Dataset::new(&tables, grid.clone(), settings).map_err(|_| ModelError::BuiltinRange {
            name: name(),
            first,
            last,
            grid: grid.clone(),
        })?;
        let fit = Fit::new(self.kind).fit(&data);
        fit.map_err(|source| ModelError::BuiltinFit { name: name(), grid, source })
    }

    fn tables(&self) -> Vec<Table> {
        self.tables.iter().map(|table| table.table()).collect()
    }

    fn data(&self, tables: &[Table]) -> BuiltinData {
        let most = |value: &dyn Fn(&[f64]) -> f64| {
            tables.iter().map(|table| value(table.wavelengths())).fold(f64::NEG_INFINITY, f64::max)
        };
        BuiltinData {
            kind: self.kind,
            spectra: tables.iter().map(Table::len).sum(),
            first: most(&|wavelengths| wavelengths[0]),
            last: -most(&|wavelengths| -wavelengths[wavelengths.len() - 1]),
            step: most(&|wavelengths| wavelengths[1] - wavelengths[0]),
        }
    }
}

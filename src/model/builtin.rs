//! The models that are built in, and the data that they are fitted to.

use super::{Fit, FitDistribution, Model, ModelError};
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
    /// The tables that hold them.
    pub tables: &'static [BuiltinTable],
}

/// A family of built-in models: the same data at different wavelengths.
struct Family {
    kind: SpectrumKind,
    tables: &'static [BuiltinTable],
    /// Models that were fitted once: a fit made now could differ in its last digits, and so would every draw of it.
    fitted: &'static [(&'static str, &'static str)],
    /// The grid of the model unless another is asked for.
    grid: &'static str,
    /// Averages of data where they are finer than a grid would change the draws of the models that came first; lamps with
    /// lines need them.
    method: ResampleMethod,
    /// Bandwidth of the model whose name ends in `-kernel`, if there is one: what a fit finds on that grid
    /// ([`FitDistribution::Kernel`]). The shape of the data is much the same on others.
    bandwidth: Option<f64>,
}

const MUNSELL_VRHEL: Family = Family {
    kind: SpectrumKind::Reflectance,
    tables: &[BuiltinTable::Munsell, BuiltinTable::Vrhel],
    fitted: &[],
    grid: "400:10:700",
    method: ResampleMethod::Interpolate,
    bandwidth: Some(0.306),
};

const GRANADA: Family = Family {
    kind: SpectrumKind::Illuminant,
    tables: &[BuiltinTable::Granada],
    fitted: &[
        ("400:10:700", include_str!("../../data/granada.json")),
        ("400:5:700", include_str!("../../data/granada-5nm.json")),
    ],
    grid: "400:10:700",
    method: ResampleMethod::Interpolate,
    bandwidth: Some(0.209),
};

const MACBETH: Family = Family { tables: &[BuiltinTable::Macbeth], bandwidth: None, ..MUNSELL_VRHEL };

const KOIVISTO: Family = Family { tables: &[BuiltinTable::Koivisto], ..MACBETH };

const KRINOV: Family = Family { tables: &[BuiltinTable::Krinov], grid: "400:10:650", ..MACBETH };

const HOUSER: Family = Family {
    kind: SpectrumKind::Illuminant,
    tables: &[BuiltinTable::Houser],
    method: ResampleMethod::Average,
    ..MACBETH
};

impl Model {
    /// The names of the built-in models. `-5nm` is the grid 400:5:700, `krinov` is at 400:10:650 and the others are at
    /// 400:10:700. `-kernel` is the same model with a normal distribution about each measured spectrum
    /// ([`Distribution::Kernel`](super::Distribution::Kernel)).
    pub const BUILTIN: &[&str] = &[
        "munsell-vrhel",
        "granada",
        "munsell-vrhel-5nm",
        "granada-5nm",
        "macbeth",
        "koivisto",
        "krinov",
        "houser",
        "munsell-vrhel-kernel",
        "granada-kernel",
    ];

    /// A built-in model: `granada` (daylights, with or without `-5nm`) was fitted once to the measurements of
    /// Hernández-Andrés et al. 2001; the others are fitted here to the compiled-in tables ([`BuiltinTable`]).
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

    /// A built-in model of another number of components than 6: a fit of its data on `grid`, as
    /// [`builtin_at`](Model::builtin_at) makes one.
    ///
    /// ```
    /// let grid = spectroll::Grid::DEFAULT;
    /// assert_eq!(spectroll::Model::builtin_with("munsell-vrhel", grid, 8)?.components(), 8);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn builtin_with(name: &str, grid: Grid, components: usize) -> Result<Model, ModelError> {
        family(name)?.0.fit(name, grid, Some(components))
    }

    /// The data that a built-in model is fitted to.
    pub fn builtin_data(name: &str) -> Result<BuiltinData, ModelError> {
        let (family, _) = family(name)?;
        Ok(family.data(&family.tables()))
    }
}

/// The family of a name, without a bandwidth where the name does not end in `-kernel`, and the grid that it stands for.
fn family(name: &str) -> Result<(Family, Grid), ModelError> {
    let stripped = |name: &'_ str, suffix| match name.strip_suffix(suffix) {
        Some(rest) => (rest.to_owned(), true),
        None => (name.to_owned(), false),
    };
    let (family, is_kernel) = stripped(name, "-kernel");
    let (family, suffix) = stripped(&family, "-5nm");
    let mut found = match (family.as_str(), suffix) {
        ("munsell-vrhel", _) => MUNSELL_VRHEL,
        ("granada", _) => GRANADA,
        ("macbeth", false) => MACBETH,
        ("koivisto", false) => KOIVISTO,
        ("krinov", false) => KRINOV,
        ("houser", false) => HOUSER,
        _ => return Err(ModelError::NoBuiltin { name: name.to_owned() }),
    };
    match (is_kernel, found.bandwidth) {
        (true, None) => return Err(ModelError::NoBuiltin { name: name.to_owned() }),
        (true, Some(_)) => {}
        (false, _) => found.bandwidth = None,
    }
    let grid = if suffix { "400:5:700" } else { found.grid };
    Ok((found, grid.parse()?))
}

impl Family {
    fn at(&self, name: &str, grid: Grid) -> Result<Model, ModelError> {
        match self.fitted.iter().find(|(fitted, _)| fitted.parse().as_ref() == Ok(&grid)) {
            Some((_, text)) => self.distributed(name, Model::from_json(name, text)?),
            None => self.fit(name, grid, None),
        }
    }

    fn fit(&self, name: &str, grid: Grid, components: Option<usize>) -> Result<Model, ModelError> {
        let data = self.dataset(name, &grid)?;
        let fit = Fit::new(self.kind);
        let fit = components.map_or(fit, |components| fit.components(components)).fit(&data);
        let name = name.to_owned();
        let model =
            fit.map_err(|source| ModelError::BuiltinFit { name: name.clone(), grid, source: source.into() })?;
        self.distributed(&name, model)
    }

    /// The model with the distribution that its name says.
    fn distributed(&self, name: &str, model: Model) -> Result<Model, ModelError> {
        let Some(bandwidth) = self.bandwidth else { return Ok(model) };
        let (grid, parts) = (model.grid().clone(), model.parts());
        let divided = parts.normalization.divide(&self.dataset(name, &grid)?);
        let name = name.to_owned();
        let (mut spectra, _) =
            divided.map_err(|source| ModelError::BuiltinFit { name, grid, source: source.into() })?;
        spectra.column_iter_mut().for_each(|mut spectrum| spectrum -= &parts.mean);
        Ok(FitDistribution::Kernel(Some(bandwidth)).of(model, &spectra))
    }

    fn dataset(&self, name: &str, grid: &Grid) -> Result<Dataset, ModelError> {
        let tables = self.tables();
        let BuiltinData { first, last, .. } = self.data(&tables);
        let settings = Resampling::default().method(self.method);
        Dataset::new(&tables, grid.clone(), settings).map_err(|_| ModelError::BuiltinRange {
            name: name.to_owned(),
            first,
            last,
            grid: grid.clone(),
        })
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
            tables: self.tables,
            spectra: tables.iter().map(Table::len).sum(),
            first: most(&|wavelengths| wavelengths[0]),
            last: -most(&|wavelengths| -wavelengths[wavelengths.len() - 1]),
            step: most(&|wavelengths| wavelengths[1] - wavelengths[0]),
        }
    }
}

//! The models that are built in, and their fits at other grids.

use serde::Serialize;

use super::{Fit, Model, ModelError};
use crate::dataset::{self, BuiltinTable, Dataset, SpectrumKind, Table};
use crate::grid::{Extrapolation, Grid};

/// A model that is built in, and the data that it is fitted to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BuiltinModel {
    /// Its name.
    pub name: &'static str,
    /// Kind of its spectra.
    pub kind: SpectrumKind,
    /// Number of spectra that it is fitted to.
    pub spectra: usize,
    /// Shortest wavelength of the data, nm.
    pub first_nm: f64,
    /// Longest wavelength of the data, nm.
    pub last_nm: f64,
    /// Largest step of the data, nm.
    pub step_nm: f64,
}

/// The data of a built-in model.
#[derive(Clone, Copy)]
enum Data {
    Surfaces,
    Daylights,
}

impl Data {
    fn of(name: &str) -> Option<Data> {
        match name {
            "munsell-vrhel" | "munsell-vrhel-5nm" => Some(Data::Surfaces),
            "granada" | "granada-5nm" => Some(Data::Daylights),
            _ => None,
        }
    }

    fn kind(self) -> SpectrumKind {
        match self {
            Data::Surfaces => SpectrumKind::Reflectance,
            Data::Daylights => SpectrumKind::Illuminant,
        }
    }

    fn tables(self) -> Vec<Table> {
        match self {
            Data::Surfaces => vec![BuiltinTable::Munsell.table(), BuiltinTable::Vrhel.table()],
            Data::Daylights => vec![dataset::daylights()],
        }
    }
}

impl Model {
    /// The names of the built-in models. `-5nm` is the grid 400:5:700, the others are at 400:10:700.
    pub const BUILTIN: [&str; 4] = ["munsell-vrhel", "granada", "munsell-vrhel-5nm", "granada-5nm"];

    /// A built-in model: `munsell-vrhel` (reflectances, fitted here to the compiled-in tables) or `granada`
    /// (daylights, fitted once to the measurements of Hernández-Andrés et al. 2001), with or without `-5nm`.
    pub fn builtin(name: &str) -> Result<Model, ModelError> {
        let grid = if name.ends_with("-5nm") { fine() } else { Grid::DEFAULT };
        Model::builtin_at(name, grid)
    }

    /// A built-in model at a grid within the range of its data: 400 to 700 nm for `munsell-vrhel`, 300 to 1100 nm for
    /// `granada`.
    ///
    /// ```
    /// let model = spectroll::Model::builtin_at("munsell-vrhel", "420:20:680".parse()?)?;
    /// assert_eq!(model.bands(), 14);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn builtin_at(name: &str, grid: Grid) -> Result<Model, ModelError> {
        let data = Data::of(name).ok_or_else(|| ModelError::NoBuiltin { name: name.to_owned() })?;
        match data {
            // Fitted to the measurements themselves, which are not part of the project.
            Data::Daylights if grid == Grid::DEFAULT => {
                Model::from_json(name, include_str!("../../data/granada.json"))
            }
            Data::Daylights if grid == fine() => {
                Model::from_json(name, include_str!("../../data/granada-5nm.json"))
            }
            _ => fitted(name, data, grid),
        }
    }
}

impl BuiltinModel {
    /// The built-in model of that name.
    pub fn named(name: &str) -> Option<BuiltinModel> {
        let name = Model::BUILTIN.into_iter().find(|known| *known == name)?;
        let data = Data::of(name)?;
        let tables = data.tables();
        let (first_nm, last_nm) = range(&tables);
        let step = |table: &Table| table.wavelengths()[1] - table.wavelengths()[0];
        Some(BuiltinModel {
            name,
            kind: data.kind(),
            spectra: tables.iter().map(Table::len).sum(),
            first_nm,
            last_nm,
            step_nm: tables.iter().map(step).fold(0.0, f64::max),
        })
    }
}

fn fine() -> Grid {
    Grid::new(400.0, 5.0, 61).expect("it is a grid")
}

/// The wavelengths that every one of these tables has.
fn range(tables: &[Table]) -> (f64, f64) {
    let ends = tables.iter().map(|table| {
        let wavelengths = table.wavelengths();
        (wavelengths[0], wavelengths[wavelengths.len() - 1])
    });
    ends.fold((0.0, f64::INFINITY), |(first, last), (a, b)| (first.max(a), last.min(b)))
}

fn fitted(name: &str, data: Data, grid: Grid) -> Result<Model, ModelError> {
    let tables = data.tables();
    let (first, last) = range(&tables);
    if grid.first() < first || grid.last() > last {
        return Err(ModelError::BuiltinRange { name: name.to_owned(), first, last, grid });
    }
    let spectra = Dataset::new(&tables, grid, Extrapolation::Error).expect("the tables cover the grid");
    let refused = |source| ModelError::BuiltinFit { name: name.to_owned(), grid, source };
    Fit::new(data.kind()).fit(&spectra).map_err(refused)
}

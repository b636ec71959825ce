//! The models that are built in.

use super::{Fit, Model, ModelError};
use crate::dataset::{BuiltinTable, Dataset, SpectrumKind};
use crate::grid::{Extrapolation, Grid};

impl Model {
    /// The names of the built-in models. `-5nm` is the grid 400:5:700, the others are at 400:10:700.
    pub const BUILTIN: [&str; 4] = ["munsell-vrhel", "granada", "munsell-vrhel-5nm", "granada-5nm"];

    /// A built-in model: `munsell-vrhel` (reflectances, fitted here to the compiled-in tables) or `granada`
    /// (daylights, fitted once to the measurements of Hernández-Andrés et al. 2001), with or without `-5nm`.
    pub fn builtin(name: &str) -> Result<Model, ModelError> {
        match name {
            "munsell-vrhel" => Ok(munsell_vrhel(Grid::DEFAULT)),
            "munsell-vrhel-5nm" => Ok(munsell_vrhel(Grid::new(400.0, 5.0, 61)?)),
            "granada" => Model::from_json(name, include_str!("../../data/granada.json")),
            "granada-5nm" => Model::from_json(name, include_str!("../../data/granada-5nm.json")),
            _ => Err(ModelError::NoBuiltin { name: name.to_owned() }),
        }
    }
}

fn munsell_vrhel(grid: Grid) -> Model {
    let tables = [BuiltinTable::Munsell.table(), BuiltinTable::Vrhel.table()];
    let data = Dataset::new(&tables, grid, Extrapolation::Error).expect("both tables cover 400 to 700 nm");
    Fit::new(SpectrumKind::Reflectance).fit(&data).expect("632 reflectances have six components")
}

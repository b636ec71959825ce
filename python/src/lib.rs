//! Native half of the Python package `spectroll`: models, recipes with their engines, scenes, files and the program.
//!
//! Everything here takes and returns plain values and bytes; `python/spectroll` makes arrays, mappings and adapters of
//! them. Work is done without the interpreter's lock, and asks every now and then whether somebody pressed Ctrl-C.

mod data;
mod error;
mod metamers;
mod model;
mod process;
mod program;
mod sampler;
mod scene;
mod sensors;
mod write;

use pyo3::prelude::pymodule;

/// Native half of `spectroll`; see the package for its documentation.
#[pymodule(gil_used = false)]
mod _spectroll {
    #[pymodule_export]
    use crate::data::{read, resample, wavelengths};
    #[pymodule_export]
    use crate::error::{DataError, EngineError};
    #[pymodule_export]
    use crate::metamers::metamers;
    #[pymodule_export]
    use crate::model::Model;
    #[pymodule_export]
    use crate::program::{adapters, main};
    #[pymodule_export]
    use crate::sampler::Sampler;
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::sensors::{illuminant, sensors, sensors_of};
    #[pymodule_export]
    use crate::write::{write_draws, write_scenes};

    use pyo3::prelude::*;

    /// Adds the constants.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        spectroll::caught::silence();
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("BUILTIN", spectroll::Model::BUILTIN.to_vec())?;
        module.add("TABLES", crate::data::builtin_tables())?;
        module.add("EXAMPLES", spectroll::scene::PRESETS.iter().map(|(name, _)| *name).collect::<Vec<_>>())
    }
}

//! The model that is drawn from, as an argument.

use spectroll::{Grid, Model};

use crate::cli::model_at;
use crate::cli::wavelengths::grid;

/// A model, and where a built-in one is fitted.
#[derive(clap::Args)]
pub(in crate::cli) struct ModelArguments {
    /// A model file, or a name of `spectroll models`, such as munsell-vrhel or granada
    #[arg(id = "model", value_name = "MODEL")]
    pub(in crate::cli) name: String,
    /// The wavelengths of a built-in model, in nm, at which it is fitted: a grid, a list as in 443,490,560, or a file of
    /// them [default: those of its name]
    #[arg(long, value_name = "START:STEP:STOP|FILE", value_parser = grid)]
    wavelengths: Option<Grid>,
}

impl ModelArguments {
    pub(in crate::cli) fn load(&self) -> anyhow::Result<Model> {
        model_at(&self.name, self.wavelengths.as_ref())
    }
}

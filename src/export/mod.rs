//! Writing of data sets, from a recipe or a scene to a file, a stream or a set of chunks: for the program and for
//! other hosts.
//!
//! A [`DrawExport`] or a [`SceneExport`] says what the rows of a data set are, and [`Output`] where they go. What is
//! written depends on these two alone, and not on the engine that draws.
//!
//! ```
//! use spectroll::export::{DrawExport, Output};
//! use spectroll::{Engine, EngineChoice, Model, Recipe, Stream};
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("reflectances.npy");
//! let recipe = Recipe::builder(&Model::builtin("munsell-vrhel")?).build()?;
//! let engine = Engine::new(&EngineChoice::Auto)?;
//! let export = DrawExport::new(&recipe, Stream::new(1).draws(0..1000));
//! let summary = export.write(&engine, &Output::to(&path)?)?;
//! assert_eq!(summary.draws, 1000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod draws;
mod metamers;
mod model;
mod output;
pub mod provenance;
mod scenes;
mod space;
mod writing;

use std::io;
use std::ops::Range;

pub use draws::{DrawExport, DrawRows};
pub use metamers::{ColourShape, Colours, MetamerExport, MetamerRows};
pub use output::{Destination, Output};
pub use scenes::{ArraySelection, SceneExport, SceneRows, SelectionError, model_sums};
pub use space::{Space, SpaceCheck};
pub use writing::{ExportError, Writing};

use crate::engine::EngineError;
use crate::output::{LrvLabel, SharedArray, SpectraArray};
use crate::quantity::Quantity;
use crate::recipe::Recipe;

/// Rows of a data set, as an engine draws them: draws, or scenes.
pub trait Rows {
    /// A sum that engines share exactly where they round alike: what tells those apart which have not the CPU's bytes.
    fn rounding(&mut self) -> Result<String, EngineError>;

    /// Draws some rows, counted from the first of the data set, and hands their columns on in order, window by window,
    /// with the number of rows. The first error ends it.
    fn draw(&mut self, rows: Range<u64>, window: &mut Window) -> Result<(), ExportError>;

    /// The values of the arrays that all rows share, in the order of their descriptions and in the types that these say.
    /// An error names a value that does not fit its type.
    fn shared(&self, described: &[SharedArray]) -> io::Result<Vec<SharedArray>>;
}

/// Takes the columns of some rows, and their number.
pub type Window<'a> = dyn FnMut(&[&[u8]], u64) -> Result<(), ExportError> + 'a;

/// Parts of a data set besides its rows: what formats need to know, and small files that lie beside the rows.
#[derive(Clone, Debug)]
pub struct Companions {
    /// The arrays of spectra.
    pub(crate) spectra: Vec<SpectraArray>,
    /// The number of the first row.
    pub(crate) first: u64,
    /// Small files that lie beside the chunks of a set, by name.
    pub(crate) files: Vec<(&'static str, String)>,
}

impl Companions {
    /// Makes those of rows of a recipe's spectra, from `first` on.
    fn of_recipe(recipe: &Recipe, lrv: LrvLabel, first: u64) -> Companions {
        let name = Quantity::Spectra.name().to_owned();
        let spectra = SpectraArray { name, group: None, kind: recipe.model().kind(), lrv };
        Companions { spectra: vec![spectra], first, files: vec![("_model.json", recipe.model().to_json())] }
    }
}

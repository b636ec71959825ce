#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

// In the order in which the data passes through them.
mod grid;

mod dataset;

pub mod colorimetry;

mod fit;
mod model;

mod condition;
mod program;
mod quantity;
mod region;

mod level;
mod normal;
mod philox;
mod real;
mod stream;
mod truncated;

mod cover;

mod cpu;
mod outputs;
mod recipe;

mod wgsl;

mod sampler;

mod engine;
#[cfg(test)]
mod probe;

pub mod output;
pub mod provenance;

#[cfg(feature = "report")]
pub mod costs;
#[cfg(feature = "report")]
#[doc(hidden)]
pub mod plot;
#[cfg(feature = "report")]
pub mod statistics;
#[cfg(feature = "report")]
pub mod stress;

#[cfg(feature = "report")]
pub mod report;

pub mod scene;

pub use dataset::{Builtin, Dataset, DatasetError, Kind, Table};
pub use engine::{Adapter, Batch, Choice, Drawer, Engine, EngineError, Summary, adapters};
pub use fit::{Fit, FitError};
pub use grid::{Extend, Grid, GridError};
pub use model::{MAX_COMPONENTS, Model, ModelError, Normalization, Parts};
pub use philox::philox;
pub use program::{Bounds, Tally};
pub use quantity::{Element, Format, Interval, Layout, Quantity};
pub use real::Real;
pub use recipe::{
    DEFAULT_MAX_ATTEMPTS, Drawn, Intensity, Luminance, Proposal, Recipe, RecipeBuilder, RecipeError,
    ScalarDrawer,
};
pub use sampler::{Prepared, Sampler, SamplerError};
pub use stream::{Draws, Stream, StreamRng};
pub use wgpu;
pub use wgsl::TextError;

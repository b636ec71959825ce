#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

// In the order in which the data pass through them: a room imports only from those above it.
#[doc(hidden)]
pub mod caught;
mod grid;
#[doc(hidden)]
pub mod plain_file;
pub mod suggestion;
mod threads;
#[doc(hidden)]
pub mod wording;

mod dataset;

pub mod colorimetry;

mod sensors;

mod affine;
mod draw_status;
mod quantity;

mod random;

mod cover;
mod mixture;

mod model;

mod program;

mod cpu;
mod wgsl;

mod recipe;

mod sampler;

mod engine;

mod metamers;

pub mod scene;

pub mod output;

pub mod export;

#[cfg(feature = "report")]
#[doc(hidden)]
pub mod evaluation;

// The code of the pages, which is compiled and run with that of the items. `tests/commands.rs` sees to it that none is missing.
#[cfg(doctest)]
mod pages {
    #[doc = include_str!("../docs/guide.md")]
    mod guide {}
    #[doc = include_str!("../docs/scenes.md")]
    mod scenes {}
    #[doc = include_str!("../docs/embedding.md")]
    mod embedding {}
    #[doc = include_str!("../docs/metamers.md")]
    mod metamers {}
}

// The program, which other hosts may carry as well, as the Python package does. It names the library as they do.
#[cfg(feature = "cli")]
extern crate self as spectroll;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;

pub use colorimetry::{Illuminant, IlluminantError, Observer};
pub use dataset::{
    BuiltinTable, Dataset, DatasetError, Decimal, Missing, ReadOptions, Reading, Remedy, ResampleMethod,
    Resampling, Separator, SpectraCounts, SpectrumKind, Table, TableLayout, Unphysical, WavelengthUnit,
};
pub use draw_status::DrawStatus;
pub use engine::{
    Adapter, ArithmeticChoice, ArithmeticVerdict, Batch, DrawSummary, Engine, EngineChoice, EngineError,
    Probe, ProbedAdapter, Session, WantedAdapter, adapters, probe, probed_adapters, wanted_backends,
};
pub use grid::{Extrapolation, Grid, GridError};
pub use metamers::{
    Answer, AnswerCounts, ColourConversion, ColourSpace, HardColours, MetamerError, MetamerWindow, Metamers,
    UnreachableColours,
};
pub use model::{
    BuiltinData, Distribution, Fit, FitDistribution, FitError, MAX_COMPONENTS, MixtureComponent, Model,
    ModelError, ModelParts, Normalization,
};
pub use program::Bounds;
pub use quantity::{ArrayFormat, Dtype, Layout, Quantity, ValueRange};
pub use random::philox::philox;
pub use random::real::Real;
pub use random::stream::{DrawRange, Draws, Stream, StreamRng};
pub use recipe::{
    CoverSize, DEFAULT_MAX_ATTEMPTS, Draw, Intensity, Lrv, PointlessSetting, ProposalKind, Recipe,
    RecipeBuilder, RecipeError, RecipeSettings, ResponseTarget, ScalarSampler, XyzScale,
};
pub use sampler::{PrepareOptions, Prepared, Sampler, SamplerError, SamplerOptions};
pub use sensors::{MAX_SENSORS, ResponseScale, SensorError, Sensors};
pub use threads::ThreadError;
// What stands in signatures, so that hosts take the same versions.
pub use wgsl::{
    Arithmetic, ArithmeticTrait, Binding, BindingRole, ComputeShader, Dialect, Indexing, ModuleOptions,
    ShaderVariant, Stores, TableStorage, WgslError,
};
pub use {half, nalgebra, rand, wgpu};

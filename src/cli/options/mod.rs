//! Groups of options that several commands share.

pub(super) mod config;
mod data;
mod engine;
mod model;
mod output;
mod recipe;
mod sensors;
mod shard;
mod summary;

pub(super) use data::DataArguments;
pub(super) use engine::EngineArguments;
pub(super) use model::ModelArguments;
pub(super) use output::{OutputArguments, Purpose};
pub(super) use recipe::RecipeArguments;
pub(super) use sensors::{IlluminantSource, illuminant, looks_like_a_file, sensors};
pub(super) use summary::SummaryArguments;

//! From a recipe or a scene to a file or a set of chunks.

pub mod provenance;

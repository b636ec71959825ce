//! The library as a page calls it: objects that take text and numbers, and hand back arrays.
//!
//! A [`Data`] is what was chosen or dropped, a [`Fitted`] the model of it, a [`Drawing`] a recipe that can be drawn, by the
//! CPU here or by a [`Kernel`] that the page runs on WebGPU, and an [`Export`] the file that is downloaded. Nothing is
//! computed here that the library does not compute: what the page shows is what the program makes, byte for byte.
//! Settings come as JSON, in the names of the program's options and of the data sets that it writes.

mod colour;
mod command;
mod data;
mod drawing;
mod export;
mod fitted;
mod kernel;
mod metamers;
mod refusal;
mod settings;

pub use colour::{encode_colours, locus};
pub use data::{Data, builtins};
pub use drawing::{Drawing, Drawn};
pub use export::Export;
pub use fitted::Fitted;
pub use kernel::Kernel;
pub use metamers::Metamers;
pub use refusal::Refusal;

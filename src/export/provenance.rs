//! Provenance that a data set records: sums that tell whether two programs would draw the same.

use crate::model::Model;
use crate::program::Proposal;
use crate::recipe::Recipe;
use crate::wgsl::{self, Dialect};

/// The BLAKE3 sum of a model, as its file has it.
pub fn model_sum(model: &Model) -> String {
    blake3::hash(model.to_json().as_bytes()).to_hex().to_string()
}

/// The BLAKE3 sum of a recipe's shader, in the form for any device, and of the numbers that it reads.
pub fn shader_sum(recipe: &Recipe) -> String {
    let mut hasher = blake3::Hasher::new();
    let (text, tables) = wgsl::shader(recipe.program(), Dialect::Baseline);
    hasher.update(text.as_bytes());
    for value in tables.values {
        hasher.update(&value.to_le_bytes());
    }
    for word in recipe.program().proposal.iter().flat_map(Proposal::words).flatten() {
        hasher.update(&word.to_le_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// Running sum of bytes.
#[derive(Clone, Debug, Default)]
pub struct Sum(blake3::Hasher);

impl Sum {
    /// Takes the next bytes.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The sum, in hexadecimal.
    pub fn finish(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}

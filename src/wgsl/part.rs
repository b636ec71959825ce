//! Parts of a draw that a shader can be written without, so that their cost can be measured.

use serde::Serialize;

/// A part of a draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// The generator's ten rounds, of each block of words.
    Philox,
    /// Logarithm, root, sine and cosine.
    Normals,
    /// All but one product of each band with the normals, both for the test and for what is stored.
    Reconstruction,
    /// Test that the spectrum is physical.
    Test,
    /// All but one of the stores of a spectrum.
    Store,
}

impl Part {
    /// All parts, in the order in which a draw does them.
    pub const ALL: [Part; 5] = [Part::Philox, Part::Normals, Part::Reconstruction, Part::Test, Part::Store];

    /// Name of the part.
    pub fn name(self) -> &'static str {
        match self {
            Part::Philox => "Philox",
            Part::Normals => "normals",
            Part::Reconstruction => "reconstruction",
            Part::Test => "test",
            Part::Store => "store",
        }
    }
}

/// Words without rounds, which still differ from draw to draw.
pub(super) const PHILOX: &str = "fn philox(counter: vec4<u32>, key: vec2<u32>) -> vec4<u32> {
    return counter ^ key.xyxy;
}
";

/// Uniform numbers instead of normals.
pub(super) const NORMAL: &str = "fn normal_pair(x: u32, y: u32) -> vec2<f32> {
    return vec2(f32(x), f32(y)) * 2.3283064e-10f;
}
";

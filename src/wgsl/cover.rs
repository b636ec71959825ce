//! A cover's candidates as WGSL text.

use super::proposal::choice;
use super::writer::word;
use crate::cover::BoxMixture;

const TRUNCATED: &str = include_str!("../../shaders/truncated.wgsl");
const COVER: &str = include_str!("../../shaders/cover.wgsl");

impl BoxMixture<f32> {
    /// `candidate(key, index, stream, attempt) -> Candidate`: the coordinates, as `Normals` that are made of as many
    /// floats as `padded`, and whether thinning keeps them. Reads [`words`](Self::words), of which `proposal_row(i)` gives four.
    /// Needs the fragments that make random words and normals.
    pub(crate) fn text(&self, padded: usize) -> String {
        let k = self.components;
        let blocks = (0..self.blocks())
            .map(|b| format!("    let w{b} = philox(vec4(index, attempt, stream | {b}u), key);\n"));
        let coordinates = (0..k).map(|j| format!("    let c{j} = coordinate(row, {j}u, {});\n", word(j + 1)));
        let normals = (0..padded).map(|j| if j < k { format!("c{j}.x") } else { "0f".to_owned() });
        let first = "bitcast<f32>(proposal_row(row).z)".to_owned();
        let cost = (0..k).fold(first, |sum, j| format!("rounded({sum} + c{j}.y)"));
        format!(
            "{TRUNCATED}
{}
{COVER}
struct Candidate {{ z: Normals, kept: bool }}

fn candidate(key: vec2<u32>, index: vec2<u32>, stream: u32, attempt: u32) -> Candidate {{
{}    let row = choose({});
{}    let cost = {cost};
    return Candidate(Normals({}), cost < chi_square({}));
}}
",
            choice(&self.alias, k + 1, "let row = proposal_row(c * ROWS);\n    return vec2(row.x, row.y);"),
            blocks.collect::<String>(),
            word(0),
            coordinates.collect::<String>(),
            normals.collect::<Vec<_>>().join(", "),
            word(k + 1),
        )
    }
}

#[cfg(test)]
mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::super::guards::{Zero, written};
    use crate::cover::tests::near_white;
    use crate::wgsl::{Arithmetic, Dialect, generator};

    const PROPOSAL_ROW: &str = "@group(0) @binding(4) var<storage, read> cover: array<vec4<u32>>;
        fn proposal_row(i: u32) -> vec4<u32> { return cover[i]; }";

    #[test]
    fn the_text_is_valid_without_any_capability() {
        let proposal = near_white().proposal().rounded::<f32>();
        let normals = [
            (6, "struct Normals { z0: f32, z1: f32, z2: f32, z3: f32, z4: f32, z5: f32 }"),
            (8, "alias Normals = array<f32, 8>;"),
        ];
        for (padded, normals) in normals {
            let candidates = written(&proposal.text(padded), Arithmetic::Plain, Zero::Parameter);
            let text = [normals, &generator(Dialect::Baseline), &candidates, PROPOSAL_ROW].join("\n");
            let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).unwrap();
            let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
            validator.validate(&module).map_err(|e| e.emit_to_string(&text)).unwrap();
        }
    }
}

//! A recipe's compute shader without the types of any graphics interface: its text, its bindings, and the bytes that go
//! into them.

use bytemuck::{Pod, Zeroable};

use super::{
    Arithmetic, Dialect, GIVEN_AT, INDICES_AT, Indexing, OUTPUTS_AT, PARAMETERS_AT, PROGRESS_AT, PROPOSAL_AT,
    Stores, TABLES_AT, WORKGROUP, WgslError, attempts_per_dispatch, draws_per_thread, is_sliced, shader_of,
};
use crate::program::{Program, Proposal};
use crate::quantity::{ArrayFormat, Quantity};
use crate::random::stream::{DrawRange, Draws};

/// Bytes of an index.
const INDEX_BYTES: u64 = 8;

/// Variant of a recipe's compute shader.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ShaderVariant {
    /// Capabilities of the device.
    pub dialect: Dialect,
    /// Source of the indices of draws.
    pub indexing: Indexing,
    /// Form of the arithmetic.
    pub arithmetic: Arithmetic,
    /// Way of rows to the buffers.
    pub stores: Stores,
}

/// Content of a binding of a compute shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BindingRole {
    /// Uniform of the range of draws: [`ComputeShader::parameters`].
    Parameters,
    /// Numbers of the model, in a storage buffer that is read: [`ComputeShader::contents`].
    Tables,
    /// Boxes of a cover or centres of a model, about which candidates are made, in a storage buffer that is read:
    /// [`ComputeShader::contents`].
    Proposal,
    /// A word of progress for each draw, in a storage buffer that is read and written: zeros before the first dispatch.
    Progress,
    /// Indices of the draws, two words each, low and high, in a storage buffer that is read.
    Indices,
    /// Responses that the draws are given, f32, draw by draw, in a storage buffer that is read.
    Given,
    /// Values of a quantity, in a storage buffer that is written.
    Output(Quantity),
}

/// A binding of a compute shader, in group 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Number of the binding.
    pub binding: u32,
    /// Content of the binding.
    pub role: BindingRole,
}

/// A recipe's compute shader, for hosts on any graphics interface. See
/// [`Recipe::compute_shader`](crate::Recipe::compute_shader).
///
/// One thread makes one or two draws. A range is drawn by [`workgroups`](ComputeShader::workgroups) in one dimension, as
/// many times as [`dispatches`](ComputeShader::dispatches) says, with the storage that earlier dispatches wrote visible to
/// later ones.
#[derive(Clone, Debug)]
pub struct ComputeShader {
    text: String,
    bindings: Vec<Binding>,
    /// Bytes of the tables, and of the boxes or centres.
    tables: Vec<u8>,
    proposal: Vec<u8>,
    formats: Vec<ArrayFormat>,
    variant: ShaderVariant,
    max_attempts: u32,
    /// Number of candidates of a draw that one dispatch tries.
    slice: u32,
    draws_per_thread: u32,
    /// Number of responses that each draw is given.
    given: usize,
}

/// Uniform that the shader declares as `Parameters`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct Parameters {
    pub(crate) key: [u32; 2],
    pub(crate) first: [u32; 2],
    pub(crate) count: u32,
    pub(crate) stream: u32,
    pub(crate) max_attempts: u32,
    pub(crate) plane: u32,
    pub(crate) row: u32,
    pub(crate) slice: u32,
    pub(crate) zero: u32,
    pub(crate) padding: u32,
}

impl ComputeShader {
    /// Name of the entry point.
    pub const ENTRY_POINT: &'static str = "main";

    /// Number of threads in a workgroup.
    pub const WORKGROUP_SIZE: u32 = WORKGROUP;

    pub(crate) fn new(program: &Program, variant: ShaderVariant) -> Result<ComputeShader, WgslError> {
        let (text, tables) = shader_of(program, variant);
        ComputeShader::with_text(program, variant, text, &tables.values)
    }

    /// Puts the shader together of a text that was written for a program, and the numbers of its tables.
    pub(crate) fn with_text(
        program: &Program,
        variant: ShaderVariant,
        text: String,
        tables: &[f32],
    ) -> Result<ComputeShader, WgslError> {
        let slice = attempts_per_dispatch(program, variant.dialect);
        if slice == 0 {
            return Err(WgslError::TooManyBands(program.bands()));
        }
        let formats: Vec<_> = program.outputs.iter().map(|output| output.format).collect();
        let others = [
            (PARAMETERS_AT, BindingRole::Parameters, true),
            (TABLES_AT, BindingRole::Tables, !tables.is_empty()),
            (PROPOSAL_AT, BindingRole::Proposal, program.proposal.is_some()),
            (PROGRESS_AT, BindingRole::Progress, is_sliced(program, variant.dialect)),
            (INDICES_AT, BindingRole::Indices, variant.indexing == Indexing::List),
            (GIVEN_AT, BindingRole::Given, program.given > 0),
        ];
        let others = others.into_iter().filter(|(.., is_there)| *is_there);
        let outputs = formats.iter().map(|format| format.quantity);
        let outputs = outputs.map(|quantity| Binding {
            binding: OUTPUTS_AT + quantity as u32,
            role: BindingRole::Output(quantity),
        });
        let bindings = others.map(|(binding, role, _)| Binding { binding, role }).chain(outputs).collect();
        let proposal = program.proposal.iter().flat_map(Proposal::words);
        Ok(ComputeShader {
            text,
            bindings,
            tables: bytemuck::cast_slice(tables).to_vec(),
            proposal: proposal.flat_map(bytemuck::cast::<_, [u8; 16]>).collect(),
            formats,
            variant,
            max_attempts: program.max_attempts,
            slice,
            draws_per_thread: draws_per_thread(program, variant.dialect),
            given: program.given,
        })
    }

    /// WGSL text of the shader.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Variant of the text.
    pub fn variant(&self) -> ShaderVariant {
        self.variant
    }

    /// Bindings of the shader, all in group 0 and visible to the compute stage.
    pub fn bindings(&self) -> &[Binding] {
        &self.bindings
    }

    /// Formats of the output arrays, in the order of [`Quantity`].
    pub fn formats(&self) -> &[ArrayFormat] {
        &self.formats
    }

    /// Size in bytes of what a binding needs where there is room for this number of draws.
    pub fn bytes(&self, role: BindingRole, room: u64) -> u64 {
        let capacity = room.max(1).next_multiple_of(u64::from(self.draws_per_thread));
        match role {
            BindingRole::Parameters => size_of::<Parameters>() as u64,
            BindingRole::Tables => self.tables.len() as u64,
            BindingRole::Proposal => self.proposal.len() as u64,
            BindingRole::Progress => 4 * capacity,
            BindingRole::Indices => INDEX_BYTES * capacity,
            BindingRole::Given => size_of::<f32>() as u64 * self.given as u64 * capacity,
            BindingRole::Output(quantity) => {
                let format = self.formats.iter().find(|format| format.quantity == quantity);
                format.map_or(0, |format| format.bytes(capacity).next_multiple_of(4))
            }
        }
    }

    /// Content of a binding that is the same for all draws, in this machine's order of bytes; `None` of any other.
    pub fn contents(&self, role: BindingRole) -> Option<&[u8]> {
        match role {
            BindingRole::Tables => Some(&self.tables),
            BindingRole::Proposal => Some(&self.proposal),
            _ => None,
        }
    }

    /// Content of the uniform for a range of draws, in buffers with room for `room` of them: planes are that far apart,
    /// rounded up to a multiple of 4. For draws of a list, the range counts its entries from 0.
    pub fn parameters(&self, draws: DrawRange, room: u64) -> [u8; 48] {
        bytemuck::cast(Parameters {
            key: draws.stream.key(),
            first: draws.stream.index_words(draws.first),
            count: draws.count as u32,
            stream: draws.stream.id() << 8,
            max_attempts: self.max_attempts,
            plane: room.next_multiple_of(4) as u32,
            row: draws.stream.row(),
            slice: self.slice,
            zero: 0,
            padding: 0,
        })
    }

    /// Words of the indices of draws, low and high of each: the content of [`BindingRole::Indices`].
    pub fn indices(draws: Draws) -> Vec<[u32; 2]> {
        let words = |number| draws.range.stream.index_words(draws.index(number));
        (0..draws.count()).map(words).collect()
    }

    /// Number of workgroups that make this number of draws, in one dimension.
    pub fn workgroups(&self, count: u64) -> u32 {
        count.div_ceil(self.draws_per_workgroup()) as u32
    }

    /// Number of draws that a workgroup makes.
    pub fn draws_per_workgroup(&self) -> u64 {
        u64::from(WORKGROUP * self.draws_per_thread)
    }

    /// Number of dispatches that make a range whose draws may take all the candidates that they are allowed.
    pub fn dispatches(&self) -> u32 {
        self.max_attempts.div_ceil(self.slice)
    }

    /// Number of candidates of a draw that one dispatch tries.
    pub(crate) fn slice(&self) -> u32 {
        self.slice
    }

    /// Number of responses that each draw is given.
    pub(crate) fn given(&self) -> usize {
        self.given
    }

    pub(crate) fn max_attempts(&self) -> u32 {
        self.max_attempts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::recipe::Recipe;
    use crate::wgsl::layout::{assert_layout, offsets};

    #[test]
    fn parameters_lie_as_the_shader_reads_them() {
        let recipe = Recipe::builder(&Model::builtin("granada").unwrap()).build().unwrap();
        let exact = ShaderVariant { arithmetic: Arithmetic::Exact, ..ShaderVariant::default() };
        for (variant, members) in [
            (
                ShaderVariant::default(),
                offsets!(Parameters: key, first, count, stream, max_attempts, plane, row).to_vec(),
            ),
            (exact, offsets!(Parameters: key, first, count, stream, max_attempts, plane, row, zero).to_vec()),
        ] {
            let (text, _) = shader_of(recipe.program(), variant);
            assert_layout(&text, "Parameters", &members, size_of::<Parameters>());
        }
    }

    #[test]
    fn the_text_declares_the_bindings() {
        let surface = Model::builtin("munsell-vrhel").unwrap();
        let recipe = Recipe::builder(&surface).lrv(0.99).bounds(crate::program::Bounds::Scaled);
        let recipe = recipe.quantities([Quantity::Spectra, Quantity::Attempts]).build().unwrap();
        for (indexing, arithmetic) in [Indexing::Range, Indexing::List]
            .into_iter()
            .flat_map(|i| [(i, Arithmetic::Plain), (i, Arithmetic::Exact)])
        {
            let variant = ShaderVariant { indexing, arithmetic, ..ShaderVariant::default() };
            let shader = ComputeShader::new(recipe.program(), variant).unwrap();
            let module = naga::front::wgsl::parse_str(shader.text()).unwrap();
            let mut declared: Vec<_> =
                module.global_variables.iter().filter_map(|(_, g)| g.binding).map(|b| b.binding).collect();
            let mut listed: Vec<_> = shader.bindings().iter().map(|b| b.binding).collect();
            declared.sort_unstable();
            listed.sort_unstable();
            assert_eq!(declared, listed, "{variant:?}");
        }
    }
}

//! Buffers of a range of draws: those that a sampler makes, and those that its host gives.

use wgpu::{BufferUsages, Device};

use super::prepared::Prepared;
use super::{Sampler, SamplerError};
use crate::quantity::Quantity;
use crate::random::stream::DrawRange;
use crate::wgsl::{Binding, BindingRole};

/// Settings of buffers for a range of draws.
#[derive(Clone, Debug)]
pub struct PrepareOptions<'a> {
    /// Usages of the buffers that are made for quantities, besides storage (`COPY_SRC`).
    pub usages: BufferUsages,
    /// Parts of the host's buffers that quantities go into, whose usages have `STORAGE`; the others get buffers of their
    /// own.
    pub outputs: Vec<(Quantity, wgpu::BufferBinding<'a>)>,
    /// Part of a buffer of the host's that has the indices of a list, whose usages have `STORAGE`; otherwise one is made,
    /// of zeros, with the usage `COPY_DST`: [`Prepared::indices`].
    pub indices: Option<wgpu::BufferBinding<'a>>,
    /// Part of a buffer of the host's with the f32 responses that each draw is given, draw by draw, for recipes with
    /// [given sensors](crate::RecipeBuilder::given), whose usages have `STORAGE`. Passes read what it holds when they run.
    pub given: Option<wgpu::BufferBinding<'a>>,
}

impl Default for PrepareOptions<'_> {
    fn default() -> Self {
        PrepareOptions { usages: BufferUsages::COPY_SRC, outputs: Vec::new(), indices: None, given: None }
    }
}

impl Sampler {
    /// Refuses what the limits of a device, or the buffers of its host, have no room for.
    fn check(&self, device: &Device, draws: DrawRange, options: &PrepareOptions) -> Result<(), SamplerError> {
        let limits = device.limits();
        let (largest, limit) = self.limit(&limits);
        if draws.count > largest {
            return Err(SamplerError::TooMany { count: draws.count, largest, limit });
        }
        let alignment = u64::from(limits.min_storage_buffer_offset_alignment);
        let outputs = options.outputs.iter().map(|(quantity, part)| (BindingRole::Output(*quantity), part));
        let indices = options.indices.iter().map(|part| (BindingRole::Indices, part));
        let given = options.given.iter().map(|part| (BindingRole::Given, part));
        for (role, part) in outputs.chain(indices).chain(given) {
            let what = match role {
                BindingRole::Output(quantity) => format!("the {quantity} of {} draws", draws.count),
                BindingRole::Given => format!("the responses that {} draws are given", draws.count),
                _ => format!("the indices of {} draws", draws.count),
            };
            let needed = self.shader.bytes(role, draws.count);
            match role {
                BindingRole::Output(quantity) if needed == 0 => return Err(SamplerError::NotAsked(quantity)),
                _ => {}
            }
            let (offset, rest) = (part.offset, part.buffer.size().saturating_sub(part.offset));
            let bytes = part.size.map_or(rest, |size| size.get().min(rest));
            if bytes < needed {
                return Err(SamplerError::SmallBuffer { what, offset, bytes, needed });
            }
            if !offset.is_multiple_of(alignment) {
                return Err(SamplerError::Misaligned { what, offset, alignment });
            }
        }
        Ok(())
    }

    /// Prepares as [`Sampler::prepare_with`] does, for any number of dispatches.
    pub(crate) fn prepare_slices(
        &self,
        device: &Device,
        draws: DrawRange,
        options: &PrepareOptions,
    ) -> Result<Prepared, SamplerError> {
        self.check(device, draws, options)?;
        let parameters = self.shader.parameters(draws, draws.count);
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let parameters = filled(device, "spectroll parameters", uniform, &parameters)?;
        let (mut progress, mut indices, mut given, mut outputs) = (None, None, None, Vec::new());
        let (storage, copied) = (BufferUsages::STORAGE, BufferUsages::COPY_DST);
        let buffer = |role, label: &str, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: self.shader.bytes(role, draws.count),
                usage,
                mapped_at_creation: false,
            })
        };
        let of_host = |quantity| options.outputs.iter().find(|(other, _)| *other == quantity);
        let bound = |role| match role {
            BindingRole::Parameters => whole(&parameters),
            BindingRole::Tables => whole(self.tables.as_ref().expect("the shader has tables")),
            BindingRole::Proposal => whole(self.proposal.as_ref().expect("the shader has a proposal")),
            BindingRole::Progress => {
                whole(progress.insert(buffer(role, "spectroll progress", storage | copied)))
            }
            BindingRole::Indices => match &options.indices {
                Some(part) => {
                    indices = Some(part.buffer.clone());
                    (part.buffer.clone(), part.offset, part.size)
                }
                None => whole(indices.insert(buffer(role, "spectroll indices", storage | copied))),
            },
            BindingRole::Given => match &options.given {
                Some(part) => (part.buffer.clone(), part.offset, part.size),
                None => whole(given.insert(buffer(role, "spectroll given responses", storage | copied))),
            },
            BindingRole::Output(quantity) => match of_host(quantity) {
                Some((_, part)) => {
                    outputs.push(part.buffer.clone());
                    (part.buffer.clone(), part.offset, part.size)
                }
                None => {
                    let label = format!("spectroll {quantity}");
                    outputs.push(buffer(role, &label, storage | options.usages));
                    whole(outputs.last().expect("it was put there"))
                }
            },
        };
        let bound: Vec<_> = self.shader.bindings().iter().map(|binding| binding.role).map(bound).collect();
        let entries: Vec<_> = self.shader.bindings().iter().zip(&bound).map(entry).collect();
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("spectroll"),
            layout: &self.layout,
            entries: &entries,
        });
        let (count, prepared) = (draws.count, draws.count);
        Ok(Prepared {
            sampler: self.clone(),
            bindings,
            parameters,
            progress,
            indices,
            given,
            outputs,
            dispatched: count,
            prepared,
        })
    }
}

/// Part of a buffer: where it begins, and its size, or all that follows.
type Part = (wgpu::Buffer, u64, Option<wgpu::BufferSize>);

fn whole(buffer: &wgpu::Buffer) -> Part {
    (buffer.clone(), 0, None)
}

fn entry<'a>((binding, (buffer, offset, size)): (&Binding, &'a Part)) -> wgpu::BindGroupEntry<'a> {
    let part = wgpu::BufferBinding { buffer, offset: *offset, size: *size };
    wgpu::BindGroupEntry { binding: binding.binding, resource: wgpu::BindingResource::Buffer(part) }
}

/// Makes a buffer of these bytes; of four zeros where there are none, since a binding is not empty.
pub(crate) fn filled(
    device: &Device,
    label: &'static str,
    usage: BufferUsages,
    bytes: &[u8],
) -> Result<wgpu::Buffer, SamplerError> {
    let (limits, size) = (device.limits(), bytes.len().max(4).next_multiple_of(4) as u64);
    let bound = match usage.contains(BufferUsages::STORAGE) {
        true => (limits.max_storage_buffer_binding_size, "max_storage_buffer_binding_size"),
        false => (limits.max_uniform_buffer_binding_size, "max_uniform_buffer_binding_size"),
    };
    let (largest, limit) = bound.min((limits.max_buffer_size, "max_buffer_size"));
    if size > largest {
        return Err(SamplerError::LargeTable { label, bytes: size, largest, limit });
    }
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage,
        mapped_at_creation: true,
    });
    // Not `create_buffer_init`, which panics where the device is lost or has no memory left.
    let mut view = buffer.get_mapped_range_mut(..).map_err(|_| SamplerError::NoBuffer { label })?;
    view.slice(..bytes.len()).copy_from_slice(bytes);
    drop(view);
    buffer.unmap();
    Ok(buffer)
}

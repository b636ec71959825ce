//! Types of a tape's compiler: how many words a value takes, and where its parts are.

use naga::{ArraySize, Handle, Type, TypeInner as T};

use super::compiler::{Compiler, Frame, Shape};

impl Compiler<'_> {
    /// Number of registers of a value.
    pub(super) fn words(&self, ty: Handle<Type>) -> usize {
        match &self.module.types[ty].inner {
            T::Scalar(_) => 1,
            T::Vector { size, .. } => *size as usize,
            T::Array { base, size: ArraySize::Constant(count), .. } => {
                count.get() as usize * self.words(*base)
            }
            T::Struct { members, .. } => members.iter().map(|member| self.words(member.ty)).sum(),
            other => panic!("registers of {other:?}"),
        }
    }

    /// Words from one element to the next, the number of elements, and their shape: in registers, or in a buffer.
    pub(super) fn elements(&self, ty: Handle<Type>, in_buffer: bool) -> (usize, usize, Shape) {
        match &self.module.types[ty].inner {
            T::Vector { size, .. } => (1, *size as usize, Shape::Scalar),
            T::Array { base, size, stride } => {
                let count = match size {
                    ArraySize::Constant(count) => count.get() as usize,
                    _ => usize::MAX,
                };
                let step = if in_buffer { *stride as usize / 4 } else { self.words(*base) };
                (step, count, Shape::Of(*base))
            }
            other => panic!("elements of {other:?}"),
        }
    }

    /// Offsets of the scalars of a value, in words.
    pub(super) fn layout(&self, shape: &Shape, in_buffer: bool) -> Vec<usize> {
        let Shape::Of(ty) = shape else { return vec![0] };
        match &self.module.types[*ty].inner {
            T::Scalar(_) => vec![0],
            T::Struct { members, .. } => {
                let mut offset = 0;
                let mut words = Vec::new();
                for member in members {
                    let start = if in_buffer { member.offset as usize / 4 } else { offset };
                    words.extend(
                        self.layout(&Shape::Of(member.ty), in_buffer).iter().map(|word| start + word),
                    );
                    offset += if in_buffer { 0 } else { self.words(member.ty) };
                }
                words
            }
            _ => {
                let (step, count, element) = self.elements(*ty, in_buffer);
                let element = self.layout(&element, in_buffer);
                (0..count).flat_map(|i| element.iter().map(move |word| i * step + word)).collect()
            }
        }
    }

    /// Offset and shape of a member or of an element whose number is known.
    pub(super) fn member(&self, shape: &Shape, index: usize, in_buffer: bool) -> (usize, Shape) {
        let Shape::Of(ty) = shape else { panic!("members of a scalar") };
        match &self.module.types[*ty].inner {
            T::Struct { members, .. } => {
                let before = members[..index].iter().map(|member| self.words(member.ty)).sum();
                let offset = if in_buffer { members[index].offset as usize / 4 } else { before };
                (offset, Shape::Of(members[index].ty))
            }
            _ => {
                let (step, _, element) = self.elements(*ty, in_buffer);
                (index * step, element)
            }
        }
    }

    /// Type of a value in registers, where it is composed.
    pub(super) fn composed(&self, frame: &Frame, handle: Handle<naga::Expression>) -> (usize, usize) {
        match frame.info[handle].ty.inner_with(&self.module.types) {
            T::Vector { size, .. } => (1, *size as usize),
            T::Array { base, size: ArraySize::Constant(count), .. } => {
                (self.words(*base), count.get() as usize)
            }
            other => panic!("elements of {other:?}"),
        }
    }
}

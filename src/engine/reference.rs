//! Draws of the CPU, to hold those of a device against, byte for byte.

use super::{Batch, EngineError};
use crate::cpu::{Kernel, fill_here};
use crate::quantity::{ArrayFormat, Quantity};
use crate::random::philox::philox;
use crate::random::stream::Draws;
use crate::recipe::Recipe;

/// The draws of a recipe, as the CPU makes them.
pub(super) struct Reference {
    kernel: Kernel<f32>,
    formats: Vec<ArrayFormat>,
}

/// First difference of two batches of draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Difference {
    /// Index of the draw.
    pub(super) index: u64,
    pub(super) quantity: Quantity,
}

impl Reference {
    pub(super) fn new(recipe: &Recipe) -> Reference {
        let program = recipe.program().with_status();
        let formats = program.outputs.iter().map(|output| output.format).collect();
        Reference { kernel: Kernel::new(&program), formats }
    }

    /// First difference of a batch that is a window of `draws`, in the order of the quantities.
    pub(super) fn difference(&self, batch: &Batch, draws: Draws) -> Option<Difference> {
        let before = batch.draws.first.wrapping_sub(draws.range.first);
        let (window, count) = (draws.part(before, batch.draws.count), batch.draws.count);
        let words = |format: &ArrayFormat| vec![0u32; format.bytes(count).div_ceil(4) as usize];
        let mut arrays: Vec<_> = self.formats.iter().map(words).collect();
        let mut slices: Vec<_> = arrays.iter_mut().map(Vec::as_mut_slice).collect();
        fill_here(&self.kernel, window, &mut slices);
        self.formats.iter().zip(&arrays).find_map(|(format, words)| {
            let (ours, theirs) = (bytemuck::cast_slice(words), batch.bytes(format.quantity));
            let number = first_difference(*format, count, ours, theirs)?;
            Some(Difference { index: window.index(number), quantity: format.quantity })
        })
    }
}

/// Number of the first draw in a plane that differs. What pads planes does not count.
fn first_difference(format: ArrayFormat, count: u64, ours: &[u8], theirs: &[u8]) -> Option<u64> {
    let plane = (format.bytes(count) as usize / format.planes()).max(1);
    let row = format.stride() * format.dtype.size();
    let used = count as usize * row;
    ours.chunks(plane).zip(theirs.chunks(plane)).find_map(|(ours, theirs)| {
        let (ours, theirs) = (&ours[..used], &theirs[..used]);
        if ours == theirs {
            return None;
        }
        ours.iter().zip(theirs).position(|(a, b)| a != b).map(|at| (at / row) as u64)
    })
}

/// Draws of a schedule that are made again on the CPU: a share of the windows.
pub(super) struct Recheck {
    references: Vec<Reference>,
    share: f64,
    windows: u32,
    /// Number of draws that were made again.
    draws: u64,
}

impl Recheck {
    pub(super) fn new<'a>(recipes: impl Iterator<Item = &'a Recipe>, share: f64) -> Recheck {
        Recheck { references: recipes.map(Reference::new).collect(), share, windows: 0, draws: 0 }
    }

    /// Whether the next window is one of the share: the first always is, and the others by chance.
    fn takes_next(&mut self) -> bool {
        let word = philox([self.windows, 0, 0, 0], [0, 0])[0];
        self.windows = self.windows.wrapping_add(1);
        self.windows == 1 || f64::from(word) < self.share * 2f64.powi(32)
    }

    /// Makes a window again, if it is one of the share. Returns the number of draws that were made again.
    pub(super) fn check(
        &mut self,
        batches: &[Batch],
        draws: &[Draws],
        adapter: &str,
    ) -> Result<u64, EngineError> {
        if !self.takes_next() {
            return Ok(0);
        }
        let before = self.draws;
        for ((batch, draws), reference) in batches.iter().zip(draws).zip(&self.references) {
            if let Some(Difference { index, quantity }) = reference.difference(batch, *draws) {
                return Err(EngineError::Differs { adapter: adapter.to_owned(), index, quantity });
            }
            self.draws += batch.draws.count;
        }
        Ok(self.draws - before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::quantity::{Dtype, Layout};
    use crate::random::stream::Stream;

    /// Arrays of a window as an engine would hand them over, one of which is then changed.
    #[test]
    fn one_bit_is_a_difference() {
        let model = Model::builtin("munsell-vrhel").unwrap();
        for (layout, dtype) in
            [(Layout::Rows, Dtype::F32), (Layout::Planes, Dtype::F32), (Layout::PaddedRows, Dtype::F16)]
        {
            let recipe = Recipe::builder(&model).layout(layout).spectra_dtype(dtype);
            let recipe = recipe.quantities([Quantity::Spectra, Quantity::Weights]).build().unwrap();
            let reference = Reference::new(&recipe);
            let draws: Draws = Stream::new(5).draws(100..110).into();
            let mut arrays: Vec<Vec<u32>> =
                reference.formats.iter().map(|f| vec![0; f.bytes(10).div_ceil(4) as usize]).collect();
            let mut slices: Vec<_> = arrays.iter_mut().map(Vec::as_mut_slice).collect();
            fill_here(&reference.kernel, draws, &mut slices);
            let difference = |arrays: &[Vec<u32>]| {
                let bytes = arrays.iter().map(|words| bytemuck::cast_slice(words));
                reference.difference(&Batch::new(draws.range, &reference.formats, bytes), draws)
            };
            assert_eq!(difference(&arrays), None);
            arrays[0][3] ^= 1;
            let found = difference(&arrays).expect("a bit is off");
            assert_eq!(found.quantity, Quantity::Spectra);
            assert!((100..110).contains(&found.index));
        }
    }

    #[test]
    fn a_share_of_the_windows_is_made_again() {
        let taken = |share| {
            let mut recheck = Recheck::new(std::iter::empty(), share);
            (0..10_000).filter(|_| recheck.takes_next()).count()
        };
        assert_eq!((taken(0.0), taken(1.0)), (1, 10_000));
        assert!((80..130).contains(&taken(0.01)), "{}", taken(0.01));
    }
}

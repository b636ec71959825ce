//! Arrays that draws go into, a column for each output, and the loop over all cores that fills them.

use bytemuck::cast_slice_mut;
use half::f16;
use half::slice::HalfFloatSliceExt;
use multiversion::multiversion;
use rayon::prelude::*;

use super::lanes::Done;
use super::{Candidates, Kernel, Take, Value};
use crate::draw_status::DrawStatus;
use crate::quantity::{ArrayFormat, Dtype, Layout, ValueRange};
use crate::random::stream::Draws;

/// Number of lanes of the f32 engine: a vector register of AVX-512, two of AVX2.
const LANES: usize = 16;

/// Largest number of draws that a core takes at once: enough that lanes which idle at the end do not count.
const CHUNK: usize = 4096;

/// The part of an array that some consecutive draws go into.
struct Column<'a> {
    format: ArrayFormat,
    /// Words of 32 bits of each plane, whatever the values are; rows are one plane.
    planes: Vec<&'a mut [u32]>,
}

/// Makes draws in f32, in order, on the threads of the pool in which this is called. Each array has the words of one
/// output, and is as long as [`ArrayFormat::bytes`] says. Padding is left as it is.
pub(crate) fn fill(kernel: &Kernel<f32>, draws: Draws, arrays: &mut [&mut [u32]]) {
    assert_eq!(draws.given.len(), kernel.given * draws.count() as usize, "responses for each draw");
    let count = draws.count() as usize;
    let size = (count / (4 * rayon::current_num_threads())).clamp(8 * LANES, CHUNK).next_multiple_of(4);
    let chunks = chunks(kernel, (count, size), arrays);
    chunks.into_par_iter().enumerate().for_each(|(chunk, columns)| {
        let first = chunk * size;
        fill_chunk(kernel, draws.part(first as u64, size.min(count - first) as u64), columns);
    });
}

/// Makes draws as [`fill`] does, on this thread alone.
pub(crate) fn fill_here(kernel: &Kernel<f32>, draws: Draws, arrays: &mut [&mut [u32]]) {
    assert_eq!(draws.given.len(), kernel.given * draws.count() as usize, "responses for each draw");
    let count = draws.count() as usize;
    let size = count.next_multiple_of(4).max(4);
    chunks(kernel, (count, size), arrays).into_iter().for_each(|columns| fill_chunk(kernel, draws, columns));
}

/// The columns of each `size` of `count` draws.
fn chunks<'a>(
    kernel: &Kernel<f32>,
    (count, size): (usize, usize),
    arrays: &'a mut [&mut [u32]],
) -> Vec<Vec<Column<'a>>> {
    let mut chunks: Vec<Vec<Column>> = (0..count.div_ceil(size)).map(|_| Vec::new()).collect();
    for (output, words) in kernel.outputs.iter().zip(arrays) {
        for (chunk, column) in chunks.iter_mut().zip(split(output.format, words, count, size)) {
            chunk.push(column);
        }
    }
    chunks
}

/// The columns of each `size` draws, a multiple of 4.
fn split(format: ArrayFormat, words: &mut [u32], count: usize, size: usize) -> Vec<Column<'_>> {
    let words_of = |values: usize| (values * format.dtype.size()).div_ceil(4);
    let plane = words_of(format.values(count as u64) as usize / format.planes());
    let mut columns: Vec<_> =
        (0..count.div_ceil(size)).map(|_| Column { format, planes: Vec::new() }).collect();
    for plane in words.chunks_mut(plane.max(1)) {
        for (column, words) in columns.iter_mut().zip(plane.chunks_mut(words_of(size * format.stride()))) {
            column.planes.push(words);
        }
    }
    columns
}

// x86-64-v4 and v3, by what of them matters here; on other architectures the baseline has vectors (NEON).
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi2+fma",
    "x86_64+avx2+bmi2+fma"
))]
fn fill_chunk(kernel: &Kernel<f32>, draws: Draws, columns: Vec<Column>) {
    fill_in_lanes::<LANES>(kernel, draws, columns);
}

#[inline(always)]
fn fill_in_lanes<const L: usize>(kernel: &Kernel<f32>, draws: Draws, columns: Vec<Column>) {
    let widest = kernel.outputs.iter().map(|output| output.format.width).max().unwrap_or(0);
    let row = vec![0.0; widest.next_multiple_of(8)];
    let halves = vec![f16::ZERO; row.len()];
    kernel.in_lanes::<L>(draws, &mut Filling { kernel, columns, row, halves });
}

/// The columns that draws go into.
struct Filling<'a> {
    kernel: &'a Kernel<f32>,
    columns: Vec<Column<'a>>,
    /// Row for values that are not stored as they are, in whole eights: there are instructions that round eight at
    /// once.
    row: Vec<f32>,
    halves: Vec<f16>,
}

impl<const L: usize> Take<f32, L> for Filling<'_> {
    #[inline(always)]
    fn take(&mut self, done: &[Done], candidates: &Candidates<f32, L>) {
        for (number, (output, column)) in self.kernel.outputs.iter().zip(&mut self.columns).enumerate() {
            if let Value::Status = output.value {
                for done in done {
                    column.planes[0][done.number] = bytemuck::cast(done.status);
                }
                continue;
            }
            let (values, unit) = candidates.output(number, &output.value);
            let values = &values[..output.format.width];
            match output.format.dtype {
                Dtype::F16 => {
                    let (row, halves) = (&mut self.row, &mut self.halves);
                    column.put_halves(values, &unit, done, self.kernel.range, row, halves);
                }
                _ => column.put(values, &unit, done, &mut self.row),
            }
        }
    }
}

impl Column<'_> {
    /// Stores the values of draws times their units, zeros where one failed. `row` is that of [`Filling`].
    fn put<const L: usize>(&mut self, values: &[[f32; L]], unit: &[f32; L], done: &[Done], row: &mut [f32]) {
        let (stride, width) = (self.format.stride(), self.format.width);
        if self.format.layout != Layout::Planes {
            let rows = cast_slice_mut(self.planes[0]);
            for done in done {
                copy(values, unit, done, &mut rows[done.number * stride..][..width]);
            }
            return;
        }
        for done in done {
            let row = &mut row[..width];
            copy(values, unit, done, row);
            for (plane, value) in self.planes.iter_mut().zip(&*row) {
                plane[done.number] = value.to_bits();
            }
        }
    }

    /// Stores values as [`Filling::put`] does, in 16 bits, kept in an interval.
    fn put_halves<const L: usize>(
        &mut self,
        values: &[[f32; L]],
        unit: &[f32; L],
        done: &[Done],
        interval: ValueRange,
        row: &mut [f32],
        halves: &mut [f16],
    ) {
        let (stride, width) = (self.format.stride(), self.format.width);
        let [least, largest] = interval.halves();
        let eights = width.next_multiple_of(8);
        for done in done {
            copy(values, unit, done, &mut row[..width]);
            if done.status != DrawStatus::FAILED {
                row[..width].iter_mut().for_each(|value| *value = value.clamp(least, largest));
            }
            halves[..eights].convert_from_f32_slice(&row[..eights]);
            let halves = &halves[..width];
            match self.format.layout {
                Layout::Planes => {
                    for (plane, half) in self.planes.iter_mut().zip(halves) {
                        cast_slice_mut(plane)[done.number] = *half;
                    }
                }
                _ => {
                    let rows = cast_slice_mut(self.planes[0]);
                    rows[done.number * stride..][..width].copy_from_slice(halves);
                }
            }
        }
    }
}

/// Copies the values of a draw times their unit. By fours, and not inlined: with AVX-512 LLVM would make gathers of it, at several
/// times the cost of plain loads.
#[inline(never)]
fn copy<const L: usize>(values: &[[f32; L]], unit: &[f32; L], done: &Done, row: &mut [f32]) {
    if done.status == DrawStatus::FAILED {
        return row.fill(0.0);
    }
    let lane = done.lane;
    let unit = unit[lane];
    let (from, from_rest) = values.as_chunks::<4>();
    let (to, to_rest) = row.as_chunks_mut::<4>();
    for (to, from) in to.iter_mut().zip(from) {
        *to = [from[0][lane] * unit, from[1][lane] * unit, from[2][lane] * unit, from[3][lane] * unit];
    }
    for (to, from) in to_rest.iter_mut().zip(from_rest) {
        *to = from[lane] * unit;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::program::Bounds;
    use crate::quantity::Quantity;
    use crate::random::stream::{DrawRange, Stream};
    use crate::recipe::{Intensity, Recipe, RecipeBuilder};

    /// Recipes of every kind, some of whose draws fail.
    fn recipes() -> Vec<(Recipe, u32)> {
        let [surface, light, kernel] =
            ["munsell-vrhel", "granada", "munsell-vrhel-kernel"].map(|name| Model::builtin(name).unwrap());
        let surface = || Recipe::builder(&surface);
        let all_but = |builder: RecipeBuilder, quantity| {
            builder.quantities(Quantity::ALL.iter().copied().filter(|q| *q != quantity))
        };
        let lit = |builder| all_but(builder, Quantity::Intensity);
        let recipe = |builder: RecipeBuilder, max_attempts| (builder.build().unwrap(), max_attempts);
        vec![
            recipe(Recipe::builder(&light), 100),
            recipe(
                all_but(Recipe::builder(&light).intensity(Intensity::LogUniform(0.15, 150.0)), Quantity::Lrv),
                100,
            ),
            recipe(surface(), 100),
            recipe(lit(surface().covariance_scale(25.0)), 3),
            recipe(lit(surface().lrv(0.6)).layout(Layout::Planes), 100),
            recipe(
                lit(surface().lrv(0.6).bounds(Bounds::Scaled))
                    .layout(Layout::PaddedRows)
                    .spectra_dtype(Dtype::F16),
                100,
            ),
            recipe(
                lit(surface().lrv(0.8).bounds(Bounds::Both)).layout(Layout::Planes).spectra_dtype(Dtype::F16),
                2,
            ),
            recipe(surface().spectra_dtype(Dtype::F16), 100),
            recipe(lit(Recipe::builder(&kernel)), 100),
        ]
    }

    fn kernel(recipe: &(Recipe, u32)) -> Kernel<f32> {
        let program = recipe.0.program().with_status();
        Kernel::new(&crate::program::Program { max_attempts: recipe.1, ..program })
    }

    fn arrays(kernel: &Kernel<f32>, count: u64) -> Vec<Vec<u32>> {
        let words = |format: ArrayFormat| vec![0; format.bytes(count).div_ceil(4) as usize];
        kernel.outputs.iter().map(|output| words(output.format)).collect()
    }

    fn in_lanes<const L: usize>(kernel: &Kernel<f32>, draws: DrawRange) -> Vec<Vec<u32>> {
        let mut arrays = arrays(kernel, draws.count);
        let count = draws.count as usize;
        let draws = draws.into();
        let all = count.next_multiple_of(4).max(4);
        let columns = kernel.outputs.iter().zip(&mut arrays);
        let columns = columns.flat_map(|(output, words)| split(output.format, words, count, all)).collect();
        fill_in_lanes::<L>(kernel, draws, columns);
        arrays
    }

    #[test]
    fn any_number_of_lanes_gives_the_scalar_draws() {
        for recipe in recipes() {
            let kernel = kernel(&recipe);
            for count in [1, 7, 15, 16, 17, 33, 1000] {
                let draws = Stream::new(1).draws((1 << 32) - 20..).part(0, count);
                let expected = in_lanes::<1>(&kernel, draws);
                assert!(in_lanes::<2>(&kernel, draws) == expected);
                assert!(in_lanes::<7>(&kernel, draws) == expected);
                assert!(in_lanes::<16>(&kernel, draws) == expected);
                assert!(in_lanes::<32>(&kernel, draws) == expected);
            }
        }
    }

    /// `in_lanes` is compiled for the baseline, `fill` runs the best that this machine has, in chunks.
    #[test]
    fn every_level_of_instructions_gives_the_same_bytes() {
        for recipe in recipes() {
            let kernel = kernel(&recipe);
            for count in [0, 1, 4097, 20_003] {
                let draws = Stream::new(2).draws(0..count);
                let mut filled = arrays(&kernel, count);
                let mut slices: Vec<_> = filled.iter_mut().map(Vec::as_mut_slice).collect();
                fill(&kernel, draws.into(), &mut slices);
                let expected = if count == 0 { arrays(&kernel, 0) } else { in_lanes::<1>(&kernel, draws) };
                assert!(filled == expected);
                let mut filled = arrays(&kernel, count);
                let mut slices: Vec<_> = filled.iter_mut().map(Vec::as_mut_slice).collect();
                fill_here(&kernel, draws.into(), &mut slices);
                assert!(filled == expected);
            }
        }
    }

    /// The arrays hold what `Kernel::draw` gives, where the format says it lies.
    #[test]
    fn values_lie_where_their_format_says() {
        for recipe in recipes() {
            let kernel = kernel(&recipe);
            let count = 37;
            let arrays = in_lanes::<16>(&kernel, Stream::new(3).draws(0..count));
            for i in 0..count {
                let (values, status) = kernel.draw(Stream::new(3), i);
                for ((output, values), words) in kernel.outputs.iter().zip(values).zip(&arrays) {
                    let format = output.format;
                    let at = |j: usize| match format.layout {
                        Layout::Planes => j * count.next_multiple_of(4) as usize + i as usize,
                        _ => i as usize * format.stride() + j,
                    };
                    match format.dtype {
                        Dtype::U32 => assert_eq!(bytemuck::cast::<_, DrawStatus>(words[i as usize]), status),
                        Dtype::F64 => unreachable!("draws are not in f64"),
                        Dtype::F32 => {
                            (0..format.width).for_each(|j| assert_eq!(words[at(j)], values[j].to_bits()))
                        }
                        Dtype::F16 => {
                            let halves: &[f16] = bytemuck::cast_slice(words);
                            let [least, largest] = kernel.range.halves();
                            for j in 0..format.width {
                                let value = values[j];
                                let kept = if value == 0.0 { 0.0 } else { value.clamp(least, largest) };
                                assert_eq!(halves[at(j)], f16::from_f32(kept));
                            }
                        }
                    }
                }
            }
        }
    }
}

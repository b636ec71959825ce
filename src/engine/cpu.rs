//! The CPU engine: one thread keeps all cores on the next window while the caller has the last.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Instant;

use super::{Batch, EngineError, Pace};
use crate::cpu::{self, Kernel};
use crate::quantity::{Format, Quantity};
use crate::recipe::Recipe;
use crate::stream::Draws;

/// How many windows there are: one with the caller, one being computed, one between them.
const WINDOWS: usize = 3;

/// The words of each output.
type Window = Vec<Vec<u32>>;

pub(super) struct Drawer<'a> {
    pool: &'a rayon::ThreadPool,
    recipe: &'a Recipe,
    kernel: Kernel<f32>,
    formats: Vec<Format>,
    /// Windows that were used before: memory that the system has given already.
    windows: Vec<Window>,
}

impl<'a> Drawer<'a> {
    pub(super) fn new(pool: &'a rayon::ThreadPool, recipe: &'a Recipe) -> Self {
        let program = recipe.program().tallied();
        let formats = program.outputs.iter().map(|output| output.format).collect();
        Drawer { pool, recipe, kernel: Kernel::new(&program), formats, windows: Vec::new() }
    }

    /// Makes `draws` with their spectra in the caller's memory, which has as many words as they need, and hands them to
    /// `sink` as one batch.
    pub(super) fn fill<E>(
        &mut self,
        draws: Draws,
        spectra: &mut [u32],
        sink: &mut impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<(), E> {
        let words = |format: &Format| format.bytes(draws.count).div_ceil(4) as usize;
        let is_spectra = |format: &&Format| format.quantity == Quantity::Spectra;
        let mut others: Vec<_> =
            self.formats.iter().filter(|f| !is_spectra(f)).map(|format| vec![0; words(format)]).collect();
        let mut spectra = Some(spectra);
        let mut rest = others.iter_mut();
        let mut arrays: Vec<&mut [u32]> = Vec::new();
        for format in &self.formats {
            arrays.push(match is_spectra(&format) {
                true => spectra.take().expect("each quantity is there once"),
                false => rest.next().expect("there is one for each"),
            });
        }
        self.pool.install(|| cpu::fill(&self.kernel, draws, &mut arrays));
        sink(Batch::new(draws, &self.formats, arrays.iter().map(|words| bytemuck::cast_slice(words))))
    }

    pub(super) fn draw<E: From<EngineError>>(
        &mut self,
        draws: Draws,
        sink: &mut impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<(), E> {
        let (full, filled) = sync_channel(WINDOWS);
        let (empty, emptied) = sync_channel(WINDOWS);
        self.windows.resize_with(WINDOWS, || vec![Vec::new(); self.formats.len()]);
        for window in self.windows.drain(..) {
            empty.send(window).expect("there is room, and a receiver");
        }
        let (pool, kernel, formats) = (self.pool, &self.kernel, &self.formats);
        let pace = Pace::new(self.recipe, formats, u64::MAX);
        std::thread::scope(|scope| {
            let computing = scope.spawn(move || compute(pool, kernel, formats, pace, draws, emptied, full));
            // Dropped before the thread is waited for, which might itself be waiting for a window.
            let empty = empty;
            for (part, window) in filled {
                sink(Batch::new(part, formats, window.iter().map(|words| bytemuck::cast_slice(words))))?;
                let _ = empty.send(window); // nobody fills it after the last
            }
            let emptied = computing.join().expect("computing does not panic");
            self.windows.extend(emptied.try_iter());
            Ok(())
        })
    }
}

/// Fills windows until all draws are made, or the caller has gone. Returns where the windows come back to.
fn compute(
    pool: &rayon::ThreadPool,
    kernel: &Kernel<f32>,
    formats: &[Format],
    mut pace: Pace,
    draws: Draws,
    emptied: Receiver<Window>,
    full: SyncSender<(Draws, Window)>,
) -> Receiver<Window> {
    let mut offset = 0;
    while let Some(part) = pace.window(draws, offset) {
        let Ok(mut window) = emptied.recv() else { break };
        let start = Instant::now();
        for (format, words) in formats.iter().zip(&mut window) {
            words.resize(format.bytes(part.count).div_ceil(4) as usize, 0);
        }
        let mut arrays: Vec<_> = window.iter_mut().map(Vec::as_mut_slice).collect();
        pool.install(|| cpu::fill(kernel, part, &mut arrays));
        pace.learn(part.count, start);
        offset += part.count;
        if full.send((part, window)).is_err() {
            break;
        }
    }
    emptied
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use crate::engine::{Choice, Engine};
    use crate::model::Model;
    use crate::recipe::Recipe;
    use crate::stream::Stream;

    /// Every thread of the caller's pool waits for draws at once: they must come from others.
    #[test]
    fn draws_are_made_for_callers_that_are_rayon_workers() {
        let recipe = Recipe::new(&Model::builtin("granada").unwrap()).build().unwrap();
        let engine = Engine::new(&Choice::Cpu).unwrap();
        let draws = Stream::new(1).draws(0..5000);
        let expected = engine.collect(&recipe, draws).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(pool.install(|| engine.collect(&recipe, draws)).unwrap(), expected);
        let all: Vec<_> = (0..64).into_par_iter().map(|_| engine.collect(&recipe, draws).unwrap()).collect();
        assert!(all.iter().all(|spectra| *spectra == expected));
    }
}

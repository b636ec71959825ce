//! The CPU engine: one thread keeps all cores on the next window while the caller has the last.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Instant;

use super::{Batch, EngineError, Pace};
use crate::cpu::{self, Kernel};
use crate::program::Tally;
use crate::recipe::Recipe;
use crate::stream::Draws;

/// How many windows there are: one with the caller, one being computed, one between them.
const WINDOWS: usize = 3;

#[derive(Default)]
struct Window {
    spectra: Vec<f32>,
    tallies: Vec<Tally>,
}

pub(super) fn draw<E: From<EngineError>>(
    recipe: &Recipe,
    draws: Draws,
    sink: &mut impl FnMut(Batch) -> Result<(), E>,
) -> Result<(), E> {
    let (full, filled) = sync_channel(WINDOWS);
    let (empty, emptied) = sync_channel(WINDOWS);
    for _ in 0..WINDOWS {
        empty.send(Window::default()).expect("there is room, and a receiver");
    }
    std::thread::scope(|scope| {
        // Dropped before the scope waits for its thread, which might be waiting for a window.
        let empty = empty;
        scope.spawn(move || compute(recipe, draws, emptied, full));
        for (part, window) in filled {
            sink(Batch { draws: part, spectra: &window.spectra, tallies: &window.tallies })?;
            let _ = empty.send(window); // nobody needs it after the last window
        }
        Ok(())
    })
}

/// Fills windows until all draws are made, or the caller has gone.
fn compute(recipe: &Recipe, draws: Draws, emptied: Receiver<Window>, full: SyncSender<(Draws, Window)>) {
    let kernel = Kernel::<f32>::new(recipe.program());
    let mut pace = Pace::new(recipe, u64::MAX);
    let mut offset = 0;
    while let Some(part) = pace.window(draws, offset) {
        let Ok(mut window) = emptied.recv() else { return };
        let start = Instant::now();
        window.spectra.resize(part.count as usize * kernel.bands(), 0.0);
        window.tallies.resize(part.count as usize, Tally::FAILED);
        cpu::fill(&kernel, part, &mut window.spectra, &mut window.tallies);
        pace.learn(part.count, start);
        offset += part.count;
        if full.send((part, window)).is_err() {
            return;
        }
    }
}

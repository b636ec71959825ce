//! The CPU engine: one thread keeps all cores on the next window while the caller has the last.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Instant;

use super::{Batch, EngineError, Member, Pace, Window};
use crate::cpu::{self, Kernel};
use crate::quantity::{Format, Quantity};
use crate::stream::Draws;

/// How many windows there are: one with the caller, one being computed, one between them.
const WINDOWS: usize = 3;

/// The words of each output of each member.
type Room = Vec<Vec<Vec<u32>>>;

pub(super) struct Drawer<'a> {
    pool: &'a rayon::ThreadPool,
    members: Vec<Role>,
    pace: Pace,
    /// Windows that were used before: memory that the system has given already.
    rooms: Vec<Room>,
}

/// A member of the ensemble.
struct Role {
    kernel: Kernel<f32>,
    formats: Vec<Format>,
    per_step: u64,
}

impl<'a> Drawer<'a> {
    pub(super) fn new(pool: &'a rayon::ThreadPool, members: &[Member]) -> Self {
        let role = |member: &Member| {
            let program = member.recipe.program().tallied();
            let formats = program.outputs.iter().map(|output| output.format).collect();
            Role { kernel: Kernel::new(&program), formats, per_step: member.per_step }
        };
        let roles: Vec<_> = members.iter().map(role).collect();
        let pace = Pace::new(members, roles.iter().map(|role| role.formats.as_slice()), u64::MAX);
        Drawer { pool, members: roles, pace, rooms: Vec::new() }
    }

    /// Makes `draws` of the only member with their spectra in the caller's memory, which has as many words as they
    /// need, and hands them to `sink` as one batch.
    pub(super) fn fill<E>(
        &mut self,
        draws: Draws,
        spectra: &mut [u32],
        sink: &mut impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<(), E> {
        let Role { kernel, formats, .. } = &self.members[0];
        let words = |format: &Format| format.bytes(draws.count).div_ceil(4) as usize;
        let is_spectra = |format: &&Format| format.quantity == Quantity::Spectra;
        let mut others: Vec<_> =
            formats.iter().filter(|f| !is_spectra(f)).map(|format| vec![0; words(format)]).collect();
        let mut spectra = Some(spectra);
        let mut rest = others.iter_mut();
        let mut arrays: Vec<&mut [u32]> = Vec::new();
        for format in formats {
            arrays.push(match is_spectra(&format) {
                true => spectra.take().expect("each quantity is there once"),
                false => rest.next().expect("there is one for each"),
            });
        }
        self.pool.install(|| cpu::fill(kernel, draws, &mut arrays));
        sink(Batch::new(draws, formats, arrays.iter().map(|words| bytemuck::cast_slice(words))))
    }

    pub(super) fn draw<E: From<EngineError>>(
        &mut self,
        draws: &[Draws],
        steps: u64,
        sink: &mut impl FnMut(&[Batch]) -> Result<(), E>,
    ) -> Result<(), E> {
        let (full, filled) = sync_channel(WINDOWS);
        let (empty, emptied) = sync_channel(WINDOWS);
        let members = &self.members;
        self.rooms
            .resize_with(WINDOWS, || members.iter().map(|m| vec![Vec::new(); m.formats.len()]).collect());
        for room in self.rooms.drain(..) {
            empty.send(room).expect("there is room, and a receiver");
        }
        let (pool, pace) = (self.pool, &mut self.pace);
        std::thread::scope(|scope| {
            let computing = scope.spawn(move || compute(pool, members, pace, (draws, steps), emptied, full));
            // Dropped before the thread is waited for, which might itself be waiting for a window.
            let empty = empty;
            for (window, room) in filled {
                let members = members.iter().zip(draws).zip(&room);
                let batches = members.map(|((member, draws), words)| {
                    let arrays = words.iter().map(|words| bytemuck::cast_slice(words));
                    Batch::new(window.of(*draws, member.per_step), &member.formats, arrays)
                });
                sink(&batches.collect::<Vec<_>>())?;
                let _ = empty.send(room); // nobody fills it after the last
            }
            let emptied = computing.join().expect("computing does not panic");
            self.rooms.extend(emptied.try_iter());
            Ok(())
        })
    }
}

/// Fills windows until all steps are made, or the caller has gone. Returns where the windows come back to.
fn compute(
    pool: &rayon::ThreadPool,
    members: &[Role],
    pace: &mut Pace,
    (draws, steps): (&[Draws], u64),
    emptied: Receiver<Room>,
    full: SyncSender<(Window, Room)>,
) -> Receiver<Room> {
    let mut offset = 0;
    while let Some(window) = pace.window(steps, offset) {
        let Ok(mut room) = emptied.recv() else { break };
        let start = Instant::now();
        for ((member, draws), arrays) in members.iter().zip(draws).zip(&mut room) {
            let part = window.of(*draws, member.per_step);
            for (format, words) in member.formats.iter().zip(&mut *arrays) {
                words.resize(format.bytes(part.count).div_ceil(4) as usize, 0);
            }
            let mut arrays: Vec<_> = arrays.iter_mut().map(Vec::as_mut_slice).collect();
            pool.install(|| cpu::fill(&member.kernel, part, &mut arrays));
        }
        pace.learn(window.steps, start);
        offset += window.steps;
        if full.send((window, room)).is_err() {
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

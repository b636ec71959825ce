//! The CPU engine: one thread keeps all cores on the next window while the caller has the last.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Instant;

use super::schedule::{Job, Pace, Window};
use super::{Batch, EngineError};
use crate::cpu::{self, Kernel};
use crate::quantity::{ArrayFormat, Quantity};
use crate::random::stream::Draws;
use crate::threads;

/// Number of windows: one with the caller, one being computed, one between them.
const WINDOWS: usize = 3;

/// Threads that draw.
#[derive(Debug)]
pub(super) enum Threads {
    /// The thread of the caller alone.
    Caller,
    /// Threads of the engine's own: those of a caller might all be waiting for their draws.
    Pool(Arc<rayon::ThreadPool>),
}

impl Threads {
    /// Threads of this number, one per core where it is `None`.
    pub(super) fn new(count: Option<NonZeroUsize>) -> Result<Threads, EngineError> {
        if count.is_some_and(|count| count.get() == 1) {
            return Ok(Threads::Caller);
        }
        let pool = threads::pool(count)?;
        Ok(if pool.current_num_threads() == 1 { Threads::Caller } else { Threads::Pool(Arc::new(pool)) })
    }

    /// A pool for work that is not drawing: the threads that draw, or one for a thread of the caller's.
    pub(super) fn pool(&self) -> Result<Arc<rayon::ThreadPool>, EngineError> {
        match self {
            Threads::Caller => Ok(Arc::new(threads::pool(Some(NonZeroUsize::MIN))?)),
            Threads::Pool(pool) => Ok(pool.clone()),
        }
    }

    pub(super) fn count(&self) -> usize {
        match self {
            Threads::Caller => 1,
            Threads::Pool(pool) => pool.current_num_threads(),
        }
    }

    /// Makes draws, with the words of each output in an array.
    fn fill(&self, kernel: &Kernel<f32>, draws: Draws, arrays: &mut [&mut [u32]]) {
        match self {
            Threads::Caller => cpu::fill_here(kernel, draws, arrays),
            Threads::Pool(pool) => pool.install(|| cpu::fill(kernel, draws, arrays)),
        }
    }
}

/// The words of each output of each job.
type Room = Vec<Vec<Vec<u32>>>;

pub(super) struct CpuSchedule<'a> {
    threads: &'a Threads,
    jobs: Vec<ReadyJob>,
    pace: Pace,
    /// Windows that were used before, to reuse their memory.
    rooms: Vec<Room>,
}

/// A job of the schedule, with its kernel.
struct ReadyJob {
    kernel: Kernel<f32>,
    formats: Vec<ArrayFormat>,
    per_step: u64,
}

impl<'a> CpuSchedule<'a> {
    pub(super) fn new(threads: &'a Threads, jobs: &[Job]) -> Self {
        let role = |job: &Job| {
            let program = job.recipe.program().with_status();
            let formats = program.outputs.iter().map(|output| output.format).collect();
            ReadyJob { kernel: Kernel::new(&program), formats, per_step: job.per_step }
        };
        let roles: Vec<_> = jobs.iter().map(role).collect();
        let pace = Pace::new(jobs, roles.iter().map(|role| role.formats.as_slice()), u64::MAX);
        CpuSchedule { threads, jobs: roles, pace, rooms: Vec::new() }
    }

    /// Makes the draws of the only job with some of its arrays in the caller's memory, each exactly as long as it is,
    /// and hands them to `sink` as one batch.
    pub(super) fn fill<E>(
        &mut self,
        draws: Draws,
        given: Vec<(Quantity, &mut [u32])>,
        sink: &mut impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<(), E> {
        let ReadyJob { kernel, formats, .. } = &self.jobs[0];
        let words = |format: &ArrayFormat| format.bytes(draws.count()).div_ceil(4) as usize;
        let is_given = |format: &&ArrayFormat| given.iter().any(|(quantity, _)| *quantity == format.quantity);
        let mut others: Vec<_> = formats
            .iter()
            .filter(|format| !is_given(format))
            .map(|format| (format.quantity, vec![0; words(format)]))
            .collect();
        let others = others.iter_mut().map(|(quantity, words)| (*quantity, words.as_mut_slice()));
        let mut all: Vec<_> = given.into_iter().chain(others).collect();
        all.sort_by_key(|(quantity, _)| *quantity); // the order of the formats
        let mut arrays: Vec<_> = all.into_iter().map(|(_, words)| words).collect();
        self.threads.fill(kernel, draws, &mut arrays);
        sink(Batch::new(draws.range, formats, arrays.iter().map(|words| bytemuck::cast_slice(words))))
    }

    pub(super) fn draw<E: From<EngineError>>(
        &mut self,
        draws: &[Draws],
        steps: u64,
        sink: &mut impl FnMut(&[Batch]) -> Result<(), E>,
    ) -> Result<(), E> {
        let (full, filled) = sync_channel(WINDOWS);
        let (empty, emptied) = sync_channel(WINDOWS);
        let jobs = &self.jobs;
        self.rooms.resize_with(WINDOWS, || jobs.iter().map(|m| vec![Vec::new(); m.formats.len()]).collect());
        for room in self.rooms.drain(..) {
            empty.send(room).expect("there is room, and a receiver");
        }
        let (threads, pace) = (self.threads, &mut self.pace);
        std::thread::scope(|scope| {
            let work = move || compute(threads, jobs, pace, (draws, steps), emptied, full);
            let computing = threads::spawn_scoped(scope, work).map_err(EngineError::from)?;
            // Dropped before the thread is waited for, which might itself be waiting for a window.
            let empty = empty;
            for (window, room) in filled {
                let jobs = jobs.iter().zip(draws).zip(&room);
                let batches = jobs.map(|((job, draws), words)| {
                    let arrays = words.iter().map(|words| bytemuck::cast_slice(words));
                    Batch::new(window.of(*draws, job.per_step).range, &job.formats, arrays)
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

/// Fills windows until all steps are drawn, or the caller has gone. Returns the channel on which windows come back.
fn compute(
    threads: &Threads,
    jobs: &[ReadyJob],
    pace: &mut Pace,
    (draws, steps): (&[Draws], u64),
    emptied: Receiver<Room>,
    full: SyncSender<(Window, Room)>,
) -> Receiver<Room> {
    let mut offset = 0;
    while let Some(window) = pace.window(steps, offset) {
        let Ok(mut room) = emptied.recv() else { break };
        let start = Instant::now();
        for ((job, draws), arrays) in jobs.iter().zip(draws).zip(&mut room) {
            let part = window.of(*draws, job.per_step);
            for (format, words) in job.formats.iter().zip(&mut *arrays) {
                words.resize(format.bytes(part.count()).div_ceil(4) as usize, 0);
            }
            let mut arrays: Vec<_> = arrays.iter_mut().map(Vec::as_mut_slice).collect();
            threads.fill(&job.kernel, part, &mut arrays);
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

    use crate::engine::{Engine, EngineChoice};
    use crate::model::Model;
    use crate::random::stream::Stream;
    use crate::recipe::Recipe;

    /// Draws come from threads of the engine's own, since every thread of the caller's pool may wait for them at
    /// once.
    #[test]
    fn draws_are_made_for_callers_that_are_rayon_workers() {
        let recipe = Recipe::builder(&Model::builtin("granada").unwrap()).build().unwrap();
        let engine = Engine::new(&EngineChoice::Cpu).unwrap();
        let draws = Stream::new(1).draws(0..5000);
        let expected = engine.collect(&recipe, draws).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(pool.install(|| engine.collect(&recipe, draws)).unwrap(), expected);
        let all: Vec<_> = (0..64).into_par_iter().map(|_| engine.collect(&recipe, draws).unwrap()).collect();
        assert!(all.iter().all(|spectra| *spectra == expected));
    }
}

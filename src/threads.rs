//! Threads of the library's own. Rayon's global pool is never used: it panics where it cannot start its threads, and a
//! forked child waits in it for threads that it has not got.

use std::io;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, Builder, JoinHandle, Scope, ScopedJoinHandle};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Error returned where the system starts no more threads, as where their number is limited (`ulimit -u`, containers).
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot start a thread: {0}; ask for fewer, or raise the limit on them")]
pub struct ThreadError(String);

/// Starts a pool of this number of threads; where it is `None`, of one per core, or as many of them as start.
pub(crate) fn pool(threads: Option<NonZeroUsize>) -> Result<ThreadPool, ThreadError> {
    let start = |count| ThreadPoolBuilder::new().num_threads(count).build();
    let mut count = threads.map_or_else(cores, NonZeroUsize::get);
    let mut pool = start(count);
    while pool.is_err() && threads.is_none() && count > 1 {
        count /= 2;
        pool = start(count);
    }
    pool.map_err(|e| ThreadError(e.to_string()))
}

/// Number of cores that the operating system gives.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// Starts a thread.
pub(crate) fn spawn(work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, ThreadError> {
    Builder::new().spawn(work).map_err(error)
}

/// Starts a thread that ends within `scope`.
pub(crate) fn spawn_scoped<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    work: impl FnOnce() -> T + Send + 'scope,
) -> Result<ScopedJoinHandle<'scope, T>, ThreadError> {
    Builder::new().spawn_scoped(scope, work).map_err(error)
}

fn error(source: io::Error) -> ThreadError {
    ThreadError(source.to_string())
}

/// Number of parts per thread, so that none waits long for another.
const PARTS: u64 = 8;

/// Results of `each` for all numbers below `count`, in order. A thread is started for every `grain` of them at most, so
/// that starting it does not cost more than it saves.
pub(crate) fn map<R: Send>(count: u64, grain: u64, each: impl Fn(u64) -> R + Sync) -> Vec<R> {
    let threads = (cores() as u64).min(count.div_ceil(grain.max(1))).max(1);
    if threads == 1 {
        return (0..count).map(each).collect();
    }
    let size = count.div_ceil(threads * PARTS);
    let next = AtomicU64::new(0);
    let work = || {
        let mut parts = Vec::new();
        loop {
            let first = next.fetch_add(size, Ordering::Relaxed);
            if first >= count {
                return parts;
            }
            parts.push((first, (first..count.min(first + size)).map(&each).collect::<Vec<R>>()));
        }
    };
    let mut parts = thread::scope(|scope| {
        // A thread that cannot be started leaves its work to the others.
        let start = |_| Builder::new().spawn_scoped(scope, work).ok();
        let others: Vec<_> = (1..threads).filter_map(start).collect();
        let mut parts = work();
        for other in others {
            match other.join() {
                Ok(found) => parts.extend(found),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        parts
    });
    parts.sort_unstable_by_key(|(first, _)| *first);
    parts.into_iter().flat_map(|(_, results)| results).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_however_many_there_are() {
        for count in [0, 1, 2, 15, 16, 17, 1000, 4097] {
            for grain in [0, 1, 100, u64::MAX] {
                let expected: Vec<u64> = (0..count).map(|number| number * number).collect();
                assert_eq!(map(count, grain, |number| number * number), expected, "{count} by {grain}");
            }
        }
    }

    #[test]
    #[should_panic(expected = "number 700")]
    fn a_panic_is_passed_on() {
        map(1000, 1, |number| assert!(number != 700, "number 700"));
    }
}

//! Threads of the library's own. Rayon's global pool is never used: it panics where it cannot start its threads, and a
//! forked child waits in it for threads that it has not got.

use std::io;
use std::num::NonZeroUsize;
use std::thread::{Builder, JoinHandle, Scope, ScopedJoinHandle};

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

fn cores() -> usize {
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

//! Work on all cores by threads that end with it. No pool outlives a call: the child of a process that forks inherits
//! pools without their threads, and would wait for these for ever.

use std::num::NonZeroUsize;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

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
        let start = |_| thread::Builder::new().spawn_scoped(scope, work).ok();
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

/// Number of threads that this process can run at once, which takes reading files to find out.
fn cores() -> usize {
    static CORES: OnceLock<usize> = OnceLock::new();
    *CORES.get_or_init(|| thread::available_parallelism().map_or(1, NonZeroUsize::get))
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

//! Data sets of many files: chunks of draws, each written once and whole, and a manifest of their BLAKE3 sums.
//!
//! A set is written in a folder beside its name, `NAME.partial`, and renamed when every chunk is there. A run that is
//! killed leaves the chunks that it finished, and the next goes on from them. Processes that share a set divide its
//! chunks; whichever finds all of them done seals it. Since a chunk depends on the plan alone, nothing of this shows
//! in the bytes. Locks keep two processes from the same chunks, and a set from being replaced while it is written.

mod audit;
pub(super) mod check;
mod layout;
mod manifest;
mod occupy;
mod parts;
mod pool;
mod resume;
mod seal;
mod writer;
mod zarr;

use std::ops::Range;

pub use audit::{Fault, Piece, SetAudit};
pub use layout::ChunkFormat;
pub use manifest::SetPlan;
pub use seal::{SetStatus, merge};
pub use writer::SetWriter;

/// Part of a set's chunks that one of several processes writes: the `index`-th of `count`, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Number of the part, from 1.
    pub index: u64,
    /// Number of parts.
    pub count: u64,
}

impl Shard {
    /// The whole set.
    pub const WHOLE: Shard = Shard { index: 1, count: 1 };

    /// Chunks of the part; parts differ by one chunk at most.
    pub fn of(self, chunks: u64) -> Range<u64> {
        let bound = |i: u64| (u128::from(i) * u128::from(chunks) / u128::from(self.count)) as u64;
        bound(self.index - 1)..bound(self.index)
    }
}

/// Treatment of a set that exists already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetMode {
    /// Refuse to touch it.
    Create,
    /// Begin again, and replace it once the new set is complete.
    Replace,
    /// Check it, and do what is missing.
    Resume,
}

/// Number of chunks that are done, and of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Number of chunks that are done.
    pub done: u64,
    /// Number of all chunks.
    pub chunks: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_divide_the_chunks() {
        for (chunks, count) in [(0, 3), (1, 3), (10, 3), (7, 7), (1000, 64), (u64::MAX, 5)] {
            let shards = (1..=count).map(|index| Shard { index, count }.of(chunks));
            let mut end = 0;
            for shard in shards {
                assert_eq!(shard.start, end);
                assert!(shard.end - shard.start <= chunks.div_ceil(count));
                end = shard.end;
            }
            assert_eq!(end, chunks);
        }
    }
}

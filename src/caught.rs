//! Panics of other people's parsers: on a damaged file they are an error of the file, and nobody wants to read them.

use std::cell::Cell;
use std::panic;
#[cfg(any(feature = "hdf5", feature = "parquet", feature = "spreadsheets"))]
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static IS_PARSING: Cell<bool> = const { Cell::new(false) };
}

/// Runs a parser that may panic on this thread; `None` where it did.
#[cfg(any(feature = "hdf5", feature = "parquet", feature = "spreadsheets"))]
pub(crate) fn caught<T>(parse: impl FnOnce() -> T) -> Option<T> {
    let before = IS_PARSING.replace(true);
    let parsed = catch_unwind(AssertUnwindSafe(parse)).ok();
    IS_PARSING.set(before);
    parsed
}

/// Lets panics that are caught here pass in silence, for programs: a library leaves the hook of its process alone.
pub fn silence() {
    let told = panic::take_hook();
    panic::set_hook(Box::new(move |panic| {
        if !IS_PARSING.get() {
            told(panic);
        }
    }));
}

#[cfg(all(test, any(feature = "hdf5", feature = "parquet", feature = "spreadsheets")))]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_none() {
        assert_eq!(caught(|| caught(|| 3)), Some(Some(3)));
        assert_eq!(caught(|| -> u8 { panic!("a parser gave up") }), None);
        assert!(!IS_PARSING.get());
    }
}

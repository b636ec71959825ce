//! State that a process does not inherit. The child of a fork has the memory of its parent but not its threads: pools,
//! devices and locks that were in use are of no use there. Each process therefore makes its own, and what it inherited
//! is left alone, for even to end it would be to wait for threads that are not there.

use std::process;
use std::ptr;
use std::sync::atomic::{AtomicPtr, Ordering};

/// A value of each process, made when it is first asked for.
pub(crate) struct PerProcess<T> {
    /// Value of this process, or of an ancestor; null before the first.
    current: AtomicPtr<Owned<T>>,
}

struct Owned<T> {
    process: u32,
    value: T,
}

impl<T: Default> PerProcess<T> {
    pub(crate) const fn new() -> PerProcess<T> {
        PerProcess { current: AtomicPtr::new(ptr::null_mut()) }
    }

    /// The value of this process. No lock is taken: a thread that vanished in a fork might hold it.
    pub(crate) fn get(&self) -> &T {
        let process = process::id();
        let mut found = self.current.load(Ordering::Acquire);
        loop {
            // SAFETY: the pointer is null or came from `Box::into_raw` below, and nothing is freed before `drop`.
            match unsafe { found.as_ref() } {
                Some(owned) if owned.process == process => return &owned.value,
                _ => {}
            }
            let made = Box::into_raw(Box::new(Owned { process, value: T::default() }));
            match self.current.compare_exchange(found, made, Ordering::AcqRel, Ordering::Acquire) {
                // What an ancestor made stays as it is.
                // SAFETY: as above.
                Ok(_) => return unsafe { &(*made).value },
                Err(other) => {
                    // SAFETY: nobody else has seen it.
                    drop(unsafe { Box::from_raw(made) });
                    found = other;
                }
            }
        }
    }
}

impl<T> Drop for PerProcess<T> {
    fn drop(&mut self) {
        let current = *self.current.get_mut();
        // SAFETY: as in `get`; this is the last that anybody sees of it.
        if unsafe { current.as_ref() }.is_some_and(|owned| owned.process == process::id()) {
            // SAFETY: as above.
            drop(unsafe { Box::from_raw(current) });
        }
    }
}

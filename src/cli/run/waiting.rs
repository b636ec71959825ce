//! A word about work that takes long before anything is drawn.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::threads;

/// Time without a word.
const SILENCE: Duration = Duration::from_secs(2);

/// Time between later words.
const PAUSE: Duration = Duration::from_secs(10);

/// Says from time to time that something is being done, for as long as it lives.
pub(in crate::cli) struct Waiting(Option<(Sender<()>, JoinHandle<()>)>);

impl Waiting {
    /// Begins `work`, which reads as in "fitting the model"; without a word where the run is quiet.
    pub(in crate::cli) fn begin(work: &str, quiet: bool) -> Waiting {
        if quiet {
            return Waiting(None);
        }
        let (ended, end) = channel();
        let (work, start) = (work.to_owned(), Instant::now());
        let tell = move || {
            let mut pause = SILENCE;
            while end.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
                tell!("{work} ({:.0} s so far)", start.elapsed().as_secs_f64());
                pause = PAUSE;
            }
        };
        // Where no thread starts, the work goes on in silence.
        Waiting(threads::spawn(tell).ok().map(|thread| (ended, thread)))
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        if let Some((ended, thread)) = self.0.take() {
            drop(ended);
            let _ = thread.join();
        }
    }
}

//! Ctrl-C and the like, which long work asks for from time to time.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use spectroll::export::{Destination, Output};

/// Somebody pressed Ctrl-C.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; {0}")]
pub(super) struct Interrupted(pub(super) String);

/// The exit code of interrupted work.
pub(super) const EXIT_CODE: u8 = 130;

/// Set once somebody asked for an end. Empty until [`watch`].
static INTERRUPTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Catches Ctrl-C and the like from here on, for [`check`] to see; before, they end the program. The end of its
/// terminal stays ignored where whoever started it ignores that, as `nohup` does. Shells ignore SIGINT for whatever
/// scripts start with `&`, and mean nothing by it.
pub(super) fn watch() {
    let flag = INTERRUPTED.get_or_init(Arc::default);
    let register = |signal| {
        signal_hook::flag::register(signal, flag.clone()).expect("it is a signal that can be handled");
    };
    register(signal_hook::consts::SIGINT);
    register(signal_hook::consts::SIGTERM);
    // Schedulers send these before they kill a job, and the system as a limit of time or size is reached.
    #[cfg(unix)]
    for signal in [
        signal_hook::consts::SIGUSR1,
        signal_hook::consts::SIGUSR2,
        signal_hook::consts::SIGQUIT,
        signal_hook::consts::SIGXCPU,
        signal_hook::consts::SIGXFSZ,
    ] {
        register(signal);
    }
    #[cfg(unix)]
    if !is_ignored(signal_hook::consts::SIGHUP) {
        register(signal_hook::consts::SIGHUP);
    }
}

/// Catches the first Ctrl-C, for work that keeps what is done; the second one ends the program at once.
pub(super) fn watch_once() {
    // Before the flag is set by the same signal.
    end_at_once(INTERRUPTED.get_or_init(Arc::default).clone());
    watch();
}

/// Lets Ctrl-C end the program at once from when `flag` is set, also where a shell had it ignored.
fn end_at_once(flag: Arc<AtomicBool>) {
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, EXIT_CODE.into(), flag.clone())
            .expect("it is a signal that can be handled");
    }
}

/// Opens an output, and watches from when that should not be ended by the signal itself. Checking what is there of a set
/// may take minutes and be ended at any moment; a file that is begun may not. Standard output may: it leaves nothing to
/// remove, and whoever does not read it would never let the signal be seen.
pub(super) fn around<T>(output: &Output, open: impl FnOnce() -> T) -> T {
    match output.destination() {
        Destination::Stdout(_) => {
            end_at_once(Arc::new(AtomicBool::new(true)));
            open()
        }
        Destination::Set(_) => {
            let opened = open();
            watch();
            opened
        }
        _ => {
            watch();
            open()
        }
    }
}

/// Whether a signal is ignored, as far as Linux tells.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

/// A break once Ctrl-C was pressed.
pub(super) fn flow() -> ControlFlow<()> {
    match INTERRUPTED.get().is_some_and(|flag| flag.load(Ordering::Relaxed)) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    }
}

/// An error once Ctrl-C was pressed, for work that leaves nothing behind.
pub(super) fn check() -> Result<(), Interrupted> {
    match flow() {
        ControlFlow::Break(()) => Err(Interrupted("nothing was left behind".to_owned())),
        ControlFlow::Continue(()) => Ok(()),
    }
}

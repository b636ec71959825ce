//! The `spectroll` program. See `spectroll --help`, and the library's documentation for everything below the surface.

use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_drivers();
    spectroll::caught::silence();
    ExitCode::from(spectroll::cli::main(std::env::args_os().collect()))
}

/// Silences Mesa's software driver, which complains on standard error where the variable is unset, as in containers.
fn quiet_drivers() {
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: this is the first statement of the program, so no other thread reads the environment.
        unsafe { std::env::set_var("XDG_RUNTIME_DIR", std::env::temp_dir()) };
    }
}

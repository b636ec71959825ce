//! The program, as the wheel carries it.

use std::ffi::OsString;

use pyo3::prelude::*;

use crate::error::Error;

/// Runs the program with the words of `sys.argv`, and ends the process with its exit code.
#[pyfunction]
pub(crate) fn main(py: Python<'_>) -> PyResult<()> {
    // Python only notes that Ctrl-C was pressed, for code that is not run here.
    let signal = py.import("signal")?;
    signal.call_method1("signal", (signal.getattr("SIGINT")?, signal.getattr("SIG_DFL")?))?;
    let os = py.import("os")?;
    if os.getattr("environ")?.call_method1("get", ("XDG_RUNTIME_DIR",))?.is_none() {
        // Mesa's software driver complains on standard error where the variable is unset, as in containers.
        let folder = py.import("tempfile")?.call_method0("gettempdir")?;
        os.getattr("environ")?.set_item("XDG_RUNTIME_DIR", folder)?;
    }
    let mut words: Vec<OsString> = py.import("sys")?.getattr("argv")?.extract()?;
    if let Some(name) = words.first_mut() {
        *name = "spectroll".into();
    }
    let code = py.detach(|| spectroll::cli::main(words));
    std::process::exit(code.into());
}

/// The graphics adapters of this machine: for each its name, interface, kind and driver.
#[pyfunction]
pub(crate) fn adapters(py: Python<'_>) -> PyResult<Vec<(String, String, String, String)>> {
    let all = py.detach(spectroll::adapters).map_err(Error::from)?;
    Ok(all.into_iter().map(|a| (a.name, a.backend, a.kind, a.driver)).collect())
}

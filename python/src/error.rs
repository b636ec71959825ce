//! Exceptions: the kind that Python has for an error of the library, with the library's message.

use std::io;

use pyo3::exceptions::{
    PyFileExistsError, PyFileNotFoundError, PyKeyboardInterrupt, PyNotADirectoryError, PyOSError,
    PyValueError,
};
use pyo3::prelude::*;
use pyo3::{PyErr, create_exception};

use spectroll::export::{ExportError, SelectionError};
use spectroll::output::OutputError;
use spectroll::scene::SceneError;
use spectroll::{
    DatasetError, FitError, GridError, ModelError, RecipeError, Remedy, SamplerError, SensorError, WgslError,
};

create_exception!(
    spectroll,
    DataError,
    PyValueError,
    "Measured data, a model file or a data set that is not what it should be."
);
create_exception!(
    spectroll,
    EngineError,
    pyo3::exceptions::PyRuntimeError,
    "Draws cannot be made, or not all of them: there is no such adapter, say, or it failed."
);

/// An error of this crate, which becomes an exception at the border to Python.
pub(crate) struct Error(PyErr);

pub(crate) type Result<T> = std::result::Result<T, Error>;

impl From<Error> for PyErr {
    fn from(error: Error) -> PyErr {
        error.0
    }
}

impl From<PyErr> for Error {
    fn from(error: PyErr) -> Error {
        Error(error)
    }
}

/// A `ValueError`.
pub(crate) fn value(message: impl ToString) -> Error {
    Error(PyValueError::new_err(message.to_string()))
}

/// Bad data.
pub(crate) fn data(message: impl ToString) -> Error {
    Error(DataError::new_err(message.to_string()))
}

/// An `OSError` of the kind that its number says, with a message of ours.
pub(crate) fn os(source: &io::Error, message: impl ToString) -> Error {
    let message = message.to_string();
    Error(match (source.raw_os_error(), source.kind()) {
        (Some(number), _) => PyOSError::new_err((number, message)), // which Python makes the right kind of
        (None, io::ErrorKind::NotFound) => PyFileNotFoundError::new_err(message),
        (None, io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput) => PyValueError::new_err(message),
        (None, _) => PyOSError::new_err(message),
    })
}

macro_rules! values {
    ($($kind:ty),+) => {
        $(impl From<$kind> for Error {
            fn from(error: $kind) -> Error {
                value(error)
            }
        })+
    };
}

values!(RecipeError, SensorError, GridError, WgslError, SceneError, SelectionError, SamplerError);

impl From<spectroll::EngineError> for Error {
    fn from(error: spectroll::EngineError) -> Error {
        Error(EngineError::new_err(error.to_string()))
    }
}

impl From<DatasetError> for Error {
    fn from(error: DatasetError) -> Error {
        match &error {
            DatasetError::Read { source, .. } => os(source, &error),
            _ => data(format!("{error}{}", argument(error.remedy()))),
        }
    }
}

impl From<FitError> for Error {
    fn from(error: FitError) -> Error {
        match &error {
            FitError::Unphysical(unphysical) => data(format!("{error}{}", argument(unphysical.remedy))),
            FitError::NotReflectances { .. } => data(format!("{error}{}", argument(Remedy::Scale(0.01)))),
            _ => value(error),
        }
    }
}

/// The argument that does what the message of an error about data advises.
fn argument(remedy: Remedy) -> String {
    match remedy {
        Remedy::MissingValue(value) => format!(" (missing_values=[{value}], missing=\"drop\")"),
        Remedy::Missing => " (at=, missing=\"drop\")".to_owned(),
        Remedy::Scale(factor) => format!(" (scale={factor}, or kind=\"illuminant\")"),
        Remedy::Unit(unit) => format!(" (unit=\"{unit}\")"),
        Remedy::Layout => " (layout=\"columns\" or \"rows\")".to_owned(),
        Remedy::Dialect => " (separator=, decimal=, skip=)".to_owned(),
        Remedy::Decimal => " (decimal=\".\" or \",\")".to_owned(),
        Remedy::MeasuredAt => " (wavelengths=)".to_owned(),
        Remedy::Wavelengths => " (at=, extrapolate=)".to_owned(),
        _ => String::new(),
    }
}

impl From<ModelError> for Error {
    fn from(error: ModelError) -> Error {
        match &error {
            ModelError::Read { source, .. } => os(source, &error),
            ModelError::NoBuiltin { .. }
            | ModelError::BuiltinRange { .. }
            | ModelError::BuiltinFit { .. }
            | ModelError::Grid(_) => value(error),
            _ => data(error),
        }
    }
}

impl From<OutputError> for Error {
    fn from(error: OutputError) -> Error {
        const NO_SPACE: i32 = 28; // ENOSPC
        let message = format!("{error}{}", remedy(&error));
        match &error {
            OutputError::Write { source, .. } | OutputError::Read { source, .. } => os(source, message),
            OutputError::Exists { .. }
            | OutputError::FolderExists { .. }
            | OutputError::Unfinished { .. } => Error(PyFileExistsError::new_err(message)),
            OutputError::NoFolder { .. } => Error(PyFileNotFoundError::new_err(message)),
            OutputError::NotAFolder { .. } => Error(PyNotADirectoryError::new_err(message)),
            OutputError::NoSpace { .. } => Error(PyOSError::new_err((NO_SPACE, message))),
            OutputError::Busy { .. } | OutputError::NoLocks { .. } | OutputError::Replaced { .. } => {
                Error(PyOSError::new_err(message))
            }
            OutputError::Damaged { .. }
            | OutputError::DamagedParts { .. }
            | OutputError::Manifest { .. }
            | OutputError::ManifestVersion { .. }
            | OutputError::Incomplete { .. }
            | OutputError::NotASet { .. } => data(message),
            _ => value(message),
        }
    }
}

/// The argument that does what the message of an error advises.
fn remedy(error: &OutputError) -> &'static str {
    match error {
        OutputError::Exists { .. } | OutputError::FolderExists { .. } => " (overwrite=True does)",
        OutputError::Unfinished { .. } => " (resume=True or overwrite=True)",
        OutputError::Damaged { .. } => " (overwrite=True)",
        OutputError::DamagedParts { .. } => " (resume=True)",
        OutputError::Manifest { .. } | OutputError::ManifestVersion { .. } => {
            " (overwrite=True replaces the set)"
        }
        OutputError::NothingMade { .. } => ": make each with shard=(i, n) and resume=True",
        OutputError::NoSpace { .. } => " (check_space=False overrides)",
        OutputError::UnknownFormat { .. } => " (format=)",
        OutputError::Cannot { remedy, .. } if remedy.contains("quantity") => " (quantities=)",
        OutputError::Cannot { holds: "spectra", remedy: "choose spectra alone", .. } => " (quantities=)",
        OutputError::Cannot { holds: "f32 and f64" | "f32 alone, as text", .. } => " (dtype=)",
        _ => "",
    }
}

impl From<ExportError> for Error {
    fn from(error: ExportError) -> Error {
        match error {
            ExportError::Engine(error) => error.into(),
            ExportError::Output(error) => error.into(),
            ExportError::Interrupted => {
                Error(PyKeyboardInterrupt::new_err("interrupted; nothing was left behind"))
            }
            ExportError::Metamers(error) => value(error),
            ExportError::Unfinished { ref cause, .. } if matches!(**cause, ExportError::Interrupted) => {
                Error(PyKeyboardInterrupt::new_err(format!("{error}: pass resume=True to go on")))
            }
            unfinished @ ExportError::Unfinished { .. } => {
                let message = format!("{unfinished}: pass resume=True to go on");
                match unfinished {
                    ExportError::Unfinished { cause, .. } => match *cause {
                        ExportError::Output(
                            OutputError::Write { ref source, .. } | OutputError::Read { ref source, .. },
                        ) => os(source, message),
                        _ => Error(EngineError::new_err(message)),
                    },
                    _ => unreachable!("it is unfinished"),
                }
            }
            other => Error(PyOSError::new_err(other.to_string())),
        }
    }
}

/// Asks whether somebody pressed Ctrl-C, from work that does not hold the interpreter's lock.
pub(crate) fn check_signals() -> PyResult<()> {
    Python::attach(|py| py.check_signals())
}

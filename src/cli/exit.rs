//! The errors of the program itself, and the exit code that each kind of error has.

use std::io;

use spectroll::export::{ExportError, SelectionError};
use spectroll::output::OutputError;
use spectroll::scene::SceneError;
use spectroll::{
    DatasetError, EngineError, FitError, MetamerError, ModelError, PointlessSetting, Quantity, RecipeError,
    Remedy, SensorError, Unphysical, WgslError,
};

use super::interrupt::{self, Interrupted};

/// A request that cannot be meant, beyond what the argument parser can tell.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct Usage(pub(super) String);

/// A data set is not what was written.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct Unverified(pub(super) String);

/// The exit code of an error.
pub(super) fn code(error: &anyhow::Error) -> u8 {
    if error.is::<Interrupted>() {
        interrupt::EXIT_CODE
    } else if let Some(error) = error.downcast_ref::<EngineError>() {
        of_engine(error)
    } else if let Some(error) = error.downcast_ref::<OutputError>() {
        of_output(error)
    } else if let Some(error) = error.downcast_ref::<ExportError>() {
        of_export(error)
    } else if matches!(
        error.downcast_ref(),
        Some(ModelError::BuiltinRange { .. } | ModelError::BuiltinFit { .. })
    ) {
        2 // nothing that was read is wrong: the grid was asked for
    } else if error.is::<DatasetError>()
        || error.is::<Unphysical>()
        || error.is::<FitError>()
        || error.is::<ModelError>()
        || error.is::<SensorError>()
    {
        4
    } else if error.is::<Unverified>() {
        5
    } else if error.is::<RecipeError>()
        || error.is::<SceneError>()
        || error.is::<SelectionError>()
        || error.is::<WgslError>()
        || error.is::<Usage>()
    {
        2
    } else {
        1
    }
}

fn of_engine(error: &EngineError) -> u8 {
    match error {
        EngineError::NoAdapter { .. } | EngineError::NoAdapters | EngineError::UnknownBackend { .. } => 3,
        EngineError::Differs { .. } => 5,
        _ => 1,
    }
}

fn of_output(error: &OutputError) -> u8 {
    use OutputError::{
        Cannot, Damaged, DamagedParts, LargeChunks, Manifest, ManyChunks, NotBuilt, NotStreamed,
        UnknownFormat, Unrepaired,
    };
    match error {
        UnknownFormat { .. }
        | Cannot { .. }
        | NotBuilt { .. }
        | NotStreamed
        | ManyChunks { .. }
        | LargeChunks { .. } => 2,
        Damaged { .. } | DamagedParts { .. } | Manifest { .. } | Unrepaired { .. } => 5,
        _ => 1,
    }
}

fn of_export(error: &ExportError) -> u8 {
    match error {
        ExportError::Engine(error) => of_engine(error),
        ExportError::Output(error) => of_output(error),
        ExportError::Interrupted => interrupt::EXIT_CODE,
        ExportError::Metamers(_) => 2,
        ExportError::Unfinished { cause, .. } => of_export(cause),
        _ => 1,
    }
}

/// The option that does what the message of an error advises, for messages of the library, which knows no options.
pub(super) fn remedy(error: &anyhow::Error) -> &'static str {
    let output = error.downcast_ref::<OutputError>().or(match error.downcast_ref::<ExportError>() {
        Some(ExportError::Output(error)) => Some(error),
        _ => None,
    });
    if let Some(error) = output {
        return match error {
            OutputError::UnknownFormat { .. } => " (--format)",
            OutputError::Exists { .. } | OutputError::FolderExists { .. } | OutputError::ManyFiles { .. } => {
                " (--force does)"
            }
            OutputError::Damaged { .. } => " (`spectroll verify --repair`, or --force)",
            OutputError::DamagedParts { .. } => " (--resume)",
            OutputError::ManifestVersion { .. }
            | OutputError::Manifest { .. }
            | OutputError::Unrepaired { .. } => " (--force replaces the set)",
            OutputError::NoSidecar { .. } => " (--sidecar)",
            OutputError::NothingMade { .. } => ": make each with --shard I/N --resume",
            OutputError::Unfinished { .. } => " (--resume or --force)",
            OutputError::NoSpace { .. } => " (--force-space overrides)",
            OutputError::ManyChunks { .. } | OutputError::LargeChunks { .. } => " (--chunk)",
            OutputError::NotStreamed => " (--format csv or npy)",
            OutputError::Cannot { remedy, .. } if remedy.contains("quantity") => " (--quantities)",
            OutputError::Cannot { holds: "spectra", remedy: "choose spectra alone", .. } => " (--quantities)",
            OutputError::Cannot { holds: "one array" | "spectra", .. } => " (--arrays)",
            OutputError::Cannot { holds: "f32 and f64" | "f32 alone, as text", .. } => " (--dtype)",
            OutputError::Write { source, .. } => of_value(source),
            OutputError::NotBuilt { .. } => " (cargo build --features)",
            _ => "",
        };
    }
    match error.downcast_ref() {
        Some(ExportError::Metamers(MetamerError::Hard { .. })) => return " (--max-attempts, --hard mode)",
        Some(ExportError::Metamers(_)) => return " (--hard skip, --nearest)",
        _ => {}
    }
    if let Some(ExportError::Stdout(source)) = error.downcast_ref() {
        return of_value(source);
    }
    if let Some(error) = error.downcast_ref::<RecipeError>() {
        return of_recipe(error);
    }
    if let Some(error) = error.downcast_ref::<FitError>() {
        return match error {
            FitError::Power { .. } => " (--normalize none)",
            FitError::TooFewSpectra { spectra: ..=1, .. } => "",
            FitError::TooFewSpectra { .. }
            | FitError::Rank { .. }
            | FitError::Components(_)
            | FitError::Share(_) => " (-k)",
            _ => "",
        };
    }
    if matches!(error.downcast_ref(), Some(ModelError::BuiltinRange { .. })) {
        return " (--wavelengths; `spectroll fit` takes other data)";
    }
    if matches!(error.downcast_ref(), Some(WgslError::LargeTable { .. } | WgslError::ConstantCentres)) {
        return " (--tables buffer)";
    }
    let engine = error.downcast_ref::<EngineError>().or(match error.downcast_ref::<ExportError>() {
        Some(ExportError::Engine(error)) => Some(error),
        Some(ExportError::Unfinished { cause, .. }) => match &**cause {
            ExportError::Engine(error) => Some(error),
            _ => None,
        },
        _ => None,
    });
    match engine {
        Some(EngineError::NoAdapters) => " (--engine cpu)",
        Some(EngineError::Differs { .. }) => " (--engine cpu, or --arithmetic exact)",
        _ => "",
    }
}

/// The option that does what the message of an error of data advises, and the command that shows how a file was read.
pub(super) fn data_remedy(error: &anyhow::Error) -> Option<String> {
    let remedy = match (error.downcast_ref::<DatasetError>(), error.downcast_ref::<Unphysical>()) {
        (Some(DatasetError::Read { .. }), _) => return None,
        (Some(DatasetError::NotMeasured { remedy, .. }), _) if !remedy.is_empty() => {
            return Some(" (--wavelengths, --missing drop or interpolate)".to_owned());
        }
        (Some(error), _) => error.remedy(),
        (_, Some(error)) => error.remedy,
        _ => match error.downcast_ref::<FitError>() {
            Some(FitError::Unphysical(error)) => error.remedy,
            Some(FitError::NotReflectances { .. }) => Remedy::Scale(0.01),
            _ => return None,
        },
    };
    let options = match remedy {
        Remedy::MissingValue(value) => format!(" (--missing-value={value} --missing drop)"),
        Remedy::Missing => " (--wavelengths, --missing drop)".to_owned(),
        Remedy::Scale(factor) => format!(" (--scale {factor}, or --kind illuminant)"),
        Remedy::Unit(unit) => format!(" (--unit {unit})"),
        Remedy::Layout => " (--layout columns or rows)".to_owned(),
        Remedy::Dialect => " (--separator, --decimal, --skip)".to_owned(),
        Remedy::Decimal => " (--decimal point or comma)".to_owned(),
        Remedy::MeasuredAt => " (FILE@380:5:780)".to_owned(),
        Remedy::Wavelengths => " (--wavelengths, --extrapolate)".to_owned(),
        _ => String::new(),
    };
    Some(options)
}

/// The option for a value that does not fit the type in which it was to be written.
fn of_value(error: &io::Error) -> &'static str {
    if error.kind() == io::ErrorKind::InvalidData { " (--dtype f32)" } else { "" }
}

fn of_recipe(error: &RecipeError) -> &'static str {
    match error {
        RecipeError::Pointless(setting) => match setting {
            PointlessSetting::Bounds => ": --bounds needs --lrv",
            PointlessSetting::Illuminant => {
                ": --illuminant needs --quantities xyz, linear_srgb, lrv or responses"
            }
            PointlessSetting::Observer => ": --observer needs --lrv, or --quantities xyz, linear_srgb or lrv",
            PointlessSetting::Sensors => ": --sensors needs --quantities responses",
            PointlessSetting::ResponseScale => ": --response-scale needs --quantities responses",
            PointlessSetting::WhiteResponseScale => " (--response-scale absolute)",
            PointlessSetting::XyzScale => ": --xyz-scale needs --quantities xyz or linear_srgb",
        },
        RecipeError::Quantity { quantity: Quantity::Intensity, .. } => {
            ": --quantities intensity needs --intensity"
        }
        RecipeError::Quantity { quantity: Quantity::Responses, .. } => {
            ": --quantities responses needs --sensors"
        }
        RecipeError::Response { .. }
        | RecipeError::ResponseOfIlluminant { .. }
        | RecipeError::UnreachableResponse { .. }
        | RecipeError::ResponseRange { .. } => " (--target)",
        RecipeError::Sensors(error) if matches!(**error, SensorError::White { .. }) => {
            " (--response-scale absolute)"
        }
        RecipeError::TooFewToGive { .. } => " (-k)",
        RecipeError::Sensors(_) => " (--sensors, --target)",
        RecipeError::Illuminant(_) => " (--illuminant)",
        RecipeError::Quantity { .. } | RecipeError::Nothing => " (--quantities)",
        RecipeError::Lrv(_) | RecipeError::LrvOfIlluminant | RecipeError::UnreachableLrv { .. } => " (--lrv)",
        RecipeError::Intensity(_)
        | RecipeError::IntensityRange { .. }
        | RecipeError::IntensityOfReflectance
        | RecipeError::NoPowers => " (--intensity)",
        RecipeError::CovarianceScale(_) => " (--cov-scale)",
        RecipeError::NoCover { .. } => " (--proposal plain)",
        RecipeError::MaxAttempts(_) | RecipeError::Hopeless { .. } => " (--max-attempts)",
        _ => "",
    }
}

/// Whether whoever read standard output has what it wanted and went away.
pub(super) fn is_broken_pipe(error: &anyhow::Error) -> bool {
    // Not any cause: whatever becomes of a file is an error.
    let stdout = error.downcast_ref::<std::io::Error>().or(match error.downcast_ref::<ExportError>() {
        Some(ExportError::Stdout(error)) => Some(error),
        _ => None,
    });
    stdout.is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}

#[cfg(test)]
mod tests {
    use std::io::{Error, ErrorKind};
    use std::path::PathBuf;

    use super::*;

    #[test]
    fn only_the_reader_of_standard_output_may_go_away() {
        let broken = || Error::from(ErrorKind::BrokenPipe);
        assert!(is_broken_pipe(&broken().into()));
        assert!(is_broken_pipe(&ExportError::Stdout(broken()).into()));
        assert!(!is_broken_pipe(&ExportError::Stdout(ErrorKind::StorageFull.into()).into()));
        let file = OutputError::Write { path: PathBuf::from("a.npy"), source: broken() };
        assert!(!is_broken_pipe(&file.into()));
    }
}

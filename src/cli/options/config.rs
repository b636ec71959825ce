//! `--config FILE.toml`: any flag, by its name without the dashes; what is also given as a flag is that flag.
//!
//! ```toml
//! model = "munsell-vrhel"
//! count = 1000000
//! lrv = 0.4
//! quiet = true
//! ```

use std::ffi::OsString;

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use spectroll::plain_file::read_text;
use toml::Value;

use crate::cli::exit::Usage;

/// The largest configuration that is read, in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// The arguments of the program, with those of the file that they name put in where they are missing.
pub(in crate::cli) fn expand(command: &Command, given: Vec<OsString>) -> Result<Vec<OsString>, Usage> {
    // Arguments that are still missing, or wrong, are for the real parse to name.
    let Ok(matches) = command.clone().ignore_errors(true).try_get_matches_from(&given) else {
        return Ok(given);
    };
    let Some((name, matches)) = matches.subcommand() else { return Ok(given) };
    let Some(path) = matches.try_get_one::<String>("config").ok().flatten() else { return Ok(given) };
    let mut command = command.clone();
    command.build();
    let subcommand = command.find_subcommand(name).expect("it was found when parsing");

    let unusable = |reason: String| Usage(format!("cannot use the configuration {path:?}: {reason}"));
    let text = read_text(path, MAX_BYTES).map_err(|e| unusable(e.to_string()))?;
    let table: toml::Table = text.parse().map_err(|e: toml::de::Error| unusable(e.to_string()))?;
    let mut all = given;
    for (key, value) in table {
        let Some(argument) = subcommand.get_arguments().find(|a| name_of(a) == key && key != "config") else {
            return Err(unusable(format!("`spectroll {name}` has no flag {key:?}")));
        };
        // A conflict is declared on one of the two.
        let conflict =
            |a: &Arg, b: &Arg| subcommand.get_arg_conflicts_with(a).iter().any(|c| c.get_id() == b.get_id());
        let is_rival = |other: &&Arg| {
            other.get_id() == argument.get_id() || conflict(other, argument) || conflict(argument, other)
        };
        if subcommand.get_arguments().filter(is_rival).any(|rival| is_given(matches, rival)) {
            continue;
        }
        all.extend(words(argument, &value).map_err(|e| unusable(format!("{key}: {e}")))?);
    }
    Ok(all)
}

/// Name of an argument in the file.
fn name_of(argument: &Arg) -> String {
    argument.get_long().unwrap_or(argument.get_id().as_str()).to_owned()
}

fn is_given(matches: &ArgMatches, argument: &Arg) -> bool {
    matches.value_source(argument.get_id().as_str()) == Some(ValueSource::CommandLine)
}

/// An argument as it would be typed.
fn words(argument: &Arg, value: &Value) -> Result<Vec<OsString>, String> {
    let is_switch = matches!(argument.get_action(), ArgAction::SetTrue);
    let texts: Vec<String> = match value {
        Value::Boolean(on) if is_switch => {
            let switch = argument.get_long().filter(|_| *on).map(|long| format!("--{long}").into());
            return Ok(switch.into_iter().collect());
        }
        Value::Array(values) => values.iter().map(text).collect::<Result<_, _>>()?,
        Value::Boolean(true) => vec![String::new()], // a flag whose value may be left out
        single => vec![text(single)?],
    };
    if is_switch {
        return Err("expected true or false".to_owned());
    }
    Ok(texts
        .into_iter()
        .map(|text| match argument.get_long() {
            Some(long) if text.is_empty() => format!("--{long}").into(),
            Some(long) => format!("--{long}={text}").into(),
            None => text.into(),
        })
        .collect())
}

fn text(value: &Value) -> Result<String, String> {
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(number) => Ok(number.to_string()),
        Value::Float(number) => Ok(number.to_string()),
        other => Err(format!("a {} cannot be a flag", other.type_str())),
    }
}

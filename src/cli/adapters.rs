//! `spectroll adapters`: a list of the adapters that can draw.

use std::io::Write;

use serde::Serialize;
use spectroll::{Adapter, EngineError, Probe};

/// List the graphics adapters of this machine
///
/// Each is opened and tried: whether its draws have the bytes of the CPU, in plain arithmetic or in exact arithmetic, which
/// is slower, and what its compiler does with sums and products.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Print the list as JSON
    #[arg(long)]
    json: bool,
}

/// An adapter, and what came of its trial.
#[derive(Serialize)]
struct Listed<'a> {
    #[serde(flatten)]
    adapter: &'a Adapter,
    /// `None` where it could not be tried.
    #[serde(flatten)]
    probe: Option<&'a Probe>,
    /// Reason for which it could not be tried.
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let adapters = spectroll::probed_adapters()?;
    let mut out = std::io::stdout();
    if arguments.json {
        let listed = |(adapter, probe): &'_ (Adapter, Result<Probe, EngineError>)| -> serde_json::Value {
            let error = probe.as_ref().err().map(ToString::to_string);
            serde_json::json!(Listed { adapter, probe: probe.as_ref().ok(), error })
        };
        writeln!(out, "{}", serde_json::to_string_pretty(&adapters.iter().map(listed).collect::<Vec<_>>())?)?;
        return Ok(());
    }
    for (index, (adapter, probe)) in adapters.iter().enumerate() {
        writeln!(out, "{index}: {adapter}")?;
        match probe {
            Ok(probe) => writeln!(out, "   {probe}")?,
            Err(error) => writeln!(out, "   cannot be tried: {error}")?,
        }
    }
    if adapters.is_empty() {
        writeln!(out, "{}", EngineError::NoAdapters)?;
    }
    writeln!(out, "-: CPU, with --engine cpu")?;
    Ok(())
}

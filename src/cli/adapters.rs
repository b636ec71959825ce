//! `spectroll adapters`: a list of the adapters that can draw.

use std::io::Write;

/// List the graphics adapters of this machine
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Print the list as JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let adapters = spectroll::adapters()?;
    let mut out = std::io::stdout();
    if arguments.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&adapters)?)?;
        return Ok(());
    }
    for (index, adapter) in adapters.iter().enumerate() {
        writeln!(out, "{index}: {adapter}")?;
    }
    if adapters.is_empty() {
        writeln!(out, "no graphics adapter; a Vulkan driver gives one (Debian: mesa-vulkan-drivers)")?;
    }
    writeln!(out, "-: CPU, with --engine cpu")?;
    Ok(())
}

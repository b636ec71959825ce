//! `spectroll completions` and `spectroll man`: what packagers install beside the program.

use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;

use clap::Command;
use clap_complete::Shell;

/// Print completions for a shell
#[derive(clap::Args)]
pub(crate) struct CompletionsArguments {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Print the manual page, or write one for each command
#[derive(clap::Args)]
pub(crate) struct ManArguments {
    /// A folder for the pages of all commands [default: the main page, on standard output]
    #[arg(value_name = "FOLDER")]
    folder: Option<PathBuf>,
}

pub(crate) fn completions(mut command: Command, arguments: &CompletionsArguments) -> anyhow::Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "spectroll", &mut text);
    Ok(io::stdout().write_all(&text)?)
}

pub(crate) fn man(command: Command, arguments: &ManArguments) -> anyhow::Result<()> {
    match &arguments.folder {
        Some(folder) => {
            fs::create_dir_all(folder)?;
            Ok(clap_mangen::generate_to(command, folder)?)
        }
        None => Ok(clap_mangen::Man::new(command).render(&mut io::stdout())?),
    }
}

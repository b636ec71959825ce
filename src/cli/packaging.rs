//! `spectroll completions` and `spectroll man`: files that packagers install beside the program.

use std::fs;
use std::io::{self, Write};
use std::iter;
use std::path::PathBuf;

use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;
use spectroll::output::{IfExists, OutputError, write_file};

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

pub(crate) fn man(mut command: Command, arguments: &ManArguments) -> anyhow::Result<()> {
    let Some(folder) = &arguments.folder else {
        return Ok(Man::new(command).render(&mut io::stdout())?);
    };
    fs::create_dir_all(folder).map_err(|source| OutputError::Write { path: folder.clone(), source })?;
    command.build();
    for command in iter::once(&command).chain(command.get_subcommands().filter(|c| c.get_name() != "help")) {
        let page = Man::new(command.clone());
        let mut text = Vec::new();
        page.render(&mut text)?;
        write_file(folder.join(page.get_filename()), IfExists::Replace, &text)?;
    }
    Ok(())
}

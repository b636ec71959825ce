//! Options of where to draw.

use std::num::NonZeroUsize;

use clap::ValueEnum;
use spectroll::{Engine, EngineChoice, EngineError};

use crate::cli::parse::threads;

/// The kinds of place that can be asked for by name.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum EngineName {
    /// The best graphics hardware; the CPU where there is none
    Auto,
    /// The best graphics adapter, be it software
    Gpu,
    /// The CPU, without any driver
    Cpu,
}

/// The choice of what draws, for the commands that do.
#[derive(clap::Args)]
pub(in crate::cli) struct EngineArguments {
    /// Draw on this engine [default: auto]
    #[arg(long, value_enum, conflicts_with = "adapter")]
    engine: Option<EngineName>,
    /// Draw on the adapter of this index or name (see `spectroll adapters`)
    #[arg(long, value_name = "NAME|INDEX")]
    adapter: Option<String>,
    /// Draw with this number of threads on the CPU [default: one per core]
    #[arg(short, long, value_name = "N", value_parser = threads, allow_negative_numbers = true)]
    pub(in crate::cli) threads: Option<NonZeroUsize>,
}

impl EngineArguments {
    /// Engine that was asked for; `None` where none was.
    pub(in crate::cli) fn choice(&self) -> Option<EngineChoice> {
        let named = self.engine.map(|engine| match engine {
            EngineName::Auto => EngineChoice::Auto,
            EngineName::Gpu => EngineChoice::Gpu,
            EngineName::Cpu => EngineChoice::Cpu,
        });
        self.adapter.clone().map(EngineChoice::Adapter).or(named)
    }

    /// The engine that was asked for.
    pub(in crate::cli) fn open(&self) -> Result<Engine, EngineError> {
        Engine::with_threads(&self.choice().unwrap_or_default(), self.threads)
    }
}

//! Options of where to draw.

use std::num::NonZeroUsize;

use clap::ValueEnum;
use spectroll::{ArithmeticChoice, Engine, EngineChoice, EngineError};

use crate::cli::parse::{share, threads};

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
    /// The arithmetic of an adapter's shaders
    #[arg(long, value_enum, default_value = "auto")]
    arithmetic: ArithmeticChoice,
    /// Make this share of what an adapter draws again on the CPU, and stop at a difference, as in 1e-4
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share, allow_negative_numbers = true)]
    verify_draws: f64,
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

    /// Whether the arithmetic or a check of an adapter's draws was asked for.
    pub(in crate::cli) fn checks_or_chooses_arithmetic(&self) -> bool {
        self.arithmetic != ArithmeticChoice::default() || self.verify_draws > 0.0
    }

    /// The engine that was asked for.
    pub(in crate::cli) fn open(&self) -> Result<Engine, EngineError> {
        self.open_as(&self.choice().unwrap_or_default())
    }

    /// Another engine than was asked for, with the settings that were.
    pub(in crate::cli) fn open_as(&self, choice: &EngineChoice) -> Result<Engine, EngineError> {
        let engine = Engine::with_threads(choice, self.threads)?;
        Ok(engine.with_arithmetic(self.arithmetic).with_recheck(self.verify_draws))
    }
}

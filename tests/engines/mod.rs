//! Engines that tests share, and recipes of the built-in models.

// Each test binary has this module, and none uses all of it.
#![allow(dead_code)]

use std::sync::OnceLock;

use spectroll::{ArithmeticChoice, Engine, EngineChoice, Model, Recipe, RecipeBuilder};

/// The best adapter, or the one that `WGPU_ADAPTER_NAME` picks; without one, tests fail.
pub(crate) fn gpu() -> &'static Engine {
    static GPU: OnceLock<Engine> = OnceLock::new();
    GPU.get_or_init(|| {
        Engine::new(&EngineChoice::Gpu).unwrap_or_else(|e| panic!("this needs an adapter: {e}"))
    })
}

/// The same adapter in each form of arithmetic.
pub(crate) fn forms() -> &'static [Engine; 2] {
    static FORMS: OnceLock<[Engine; 2]> = OnceLock::new();
    FORMS.get_or_init(|| {
        [ArithmeticChoice::Plain, ArithmeticChoice::Exact].map(|arithmetic| {
            let engine =
                Engine::new(&EngineChoice::Gpu).unwrap_or_else(|e| panic!("this needs an adapter: {e}"));
            engine.with_arithmetic(arithmetic)
        })
    })
}

/// Whether the adapter is the processor, which has the CPU's bytes in both forms of arithmetic.
pub(crate) fn gpu_is_software() -> bool {
    gpu().adapter().is_some_and(|adapter| adapter.kind == "software")
}

pub(crate) fn cpu() -> &'static Engine {
    static CPU: OnceLock<Engine> = OnceLock::new();
    CPU.get_or_init(|| Engine::new(&EngineChoice::Cpu).expect("the CPU is always there"))
}

pub(crate) fn surfaces() -> RecipeBuilder {
    Recipe::builder(&Model::builtin("munsell-vrhel").expect("it is built in"))
}

pub(crate) fn lights() -> RecipeBuilder {
    Recipe::builder(&Model::builtin("granada").expect("it is built in"))
}

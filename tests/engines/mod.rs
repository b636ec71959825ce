//! Engines that tests share, and recipes of the built-in models.

// Each test binary has this module, and none uses all of it.
#![allow(dead_code)]

use std::sync::OnceLock;

use spectroll::{
    ArithmeticChoice, BuiltinTable, Dataset, Engine, EngineChoice, Extrapolation, Fit, FitDistribution, Grid,
    Model, Recipe, RecipeBuilder, SpectrumKind,
};

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

/// Surfaces about each of those that were measured.
pub(crate) fn kernel_surfaces() -> RecipeBuilder {
    Recipe::builder(&Model::builtin("munsell-vrhel-kernel").expect("it is built in"))
}

/// The same at other wavelengths, of as many components.
pub(crate) fn kernel_at(grid: &str, components: usize) -> RecipeBuilder {
    let grid: Grid = grid.parse().expect("a grid");
    let model = Model::builtin_with("munsell-vrhel-kernel", grid, components);
    Recipe::builder(&model.expect("its data have these wavelengths"))
}

/// Lamps from four normal distributions.
pub(crate) fn lamps() -> RecipeBuilder {
    lamps_at("400:10:700", 6)
}

/// The same at other wavelengths, of as many components.
pub(crate) fn lamps_at(grid: &str, components: usize) -> RecipeBuilder {
    let grid: Grid = grid.parse().expect("a grid");
    let data = Dataset::new(&[BuiltinTable::Houser.table()], grid, Extrapolation::Error);
    let fit = Fit::new(SpectrumKind::Illuminant).components(components);
    let fit = fit.distribution(FitDistribution::Mixture(4));
    Recipe::builder(&fit.fit(&data.expect("they have these wavelengths")).expect("lamps can be fitted"))
}

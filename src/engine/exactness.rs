//! Trials of devices: whether one draws what the CPU draws, and in which form of arithmetic.
//!
//! WGSL leaves a compiler free to fuse a product into a sum, to rearrange sums, and to round roots and quotients its own
//! way. Whether one does so can differ from shader to shader, so a trial decides: the very pipeline that is to draw makes
//! some draws that the CPU makes as well, and every byte counts. The plain form is tried first, then the exact one, which
//! costs more. A result is kept as long as the process lives, by adapter, driver and shader.

use std::collections::HashMap;
use std::fmt;
use std::sync::{LazyLock, Mutex};

use serde::{Deserialize, Serialize};

use super::EngineError;
use super::gpu::{Gpu, GpuSchedule};
use super::reference::Reference;
use super::schedule::Job;
use crate::model::Model;
use crate::random::stream::{Draws, Stream};
use crate::recipe::Recipe;
use crate::sampler::Sampler;
use crate::wgsl::{
    Arithmetic, ArithmeticTrait, BindingRole, CASES, ComputeShader, Indexing, ShaderVariant, WORKGROUP,
    self_test,
};

/// The most draws of a trial.
const TRIAL_DRAWS: u64 = 65_536;

/// Products that the CPU forms in a trial, at most: a tenth of a second on one core.
const TRIAL_PRODUCTS: f64 = (1u64 << 28) as f64;

/// Divisor of both on a software adapter: there are few, which tests try at length, and they draw slowly.
const SOFTWARE: u64 = 8;

/// Choice of the arithmetic in which a device draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum ArithmeticChoice {
    /// Plain where that has the bytes of the CPU, exact otherwise.
    #[default]
    Auto,
    /// Plain: operations as they stand.
    Plain,
    /// Exact: operations that no compiler can fuse or rearrange.
    Exact,
}

impl ArithmeticChoice {
    /// The forms to try, in order.
    fn forms(self) -> &'static [Arithmetic] {
        match self {
            ArithmeticChoice::Auto => &[Arithmetic::Plain, Arithmetic::Exact],
            ArithmeticChoice::Plain => &[Arithmetic::Plain],
            ArithmeticChoice::Exact => &[Arithmetic::Exact],
        }
    }
}

/// Form of arithmetic in which a device draws, and whether a trial found its draws to be those of the CPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ArithmeticVerdict {
    /// Form of arithmetic.
    pub arithmetic: Arithmetic,
    /// Whether every byte of the trial was that of the CPU.
    pub is_exact: bool,
}

impl ArithmeticVerdict {
    /// The verdict on both of two pipelines: the lesser.
    pub(super) fn and(self, other: ArithmeticVerdict) -> ArithmeticVerdict {
        let arithmetic = match (self.arithmetic, other.arithmetic) {
            (Arithmetic::Plain, Arithmetic::Plain) => Arithmetic::Plain,
            _ => Arithmetic::Exact,
        };
        ArithmeticVerdict { arithmetic, is_exact: self.is_exact && other.is_exact }
    }
}

impl fmt::Display for ArithmeticVerdict {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let bytes = if self.is_exact { "the CPU's bytes" } else { "not the CPU's bytes" };
        write!(f, "{} arithmetic, {bytes}", self.arithmetic)
    }
}

/// Results of trials, by the adapter with its driver, and the sum of the shader.
static TRIALS: LazyLock<Mutex<HashMap<(String, blake3::Hash), bool>>> = LazyLock::new(Mutex::default);

/// Finds the form in which a device is to draw from a recipe, and compiles it.
pub(super) fn sampler(
    gpu: &Gpu,
    recipe: &Recipe,
    indexing: Indexing,
    choice: ArithmeticChoice,
) -> Result<(Sampler, ArithmeticVerdict), EngineError> {
    let (device, _) = gpu.device();
    let program = recipe.program().with_status();
    let forms = choice.forms();
    for (i, &arithmetic) in forms.iter().enumerate() {
        let variant = ShaderVariant { indexing, arithmetic, ..Sampler::variant(device) };
        let shader = Sampler::shader_of(&program, variant)?;
        let key = (format!("{} {}", gpu.adapter(), gpu.adapter().int64), sum(&shader));
        let known = TRIALS.lock().expect("no holder panics").get(&key).copied();
        let is_last = i + 1 == forms.len();
        if known == Some(false) && !is_last {
            continue;
        }
        let sampler = Sampler::with_shader(device, shader, None)?;
        let is_exact = match known {
            Some(is_exact) => is_exact,
            None => {
                let is_exact = trial(gpu, recipe, &sampler, indexing)?;
                TRIALS.lock().expect("no holder panics").insert(key, is_exact);
                is_exact
            }
        };
        if is_exact || is_last {
            return Ok((sampler, ArithmeticVerdict { arithmetic, is_exact }));
        }
    }
    unreachable!("the last form is taken whatever comes of it")
}

/// Sum of all that a shader is made of.
fn sum(shader: &ComputeShader) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(shader.text().as_bytes());
    for role in [BindingRole::Tables, BindingRole::Proposal] {
        hasher.update(shader.contents(role).unwrap_or_default());
    }
    hasher.finalize()
}

/// Number of draws in the trial of a recipe: fewer where one takes very many products, and on a software adapter.
fn trial_draws(recipe: &Recipe, is_software: bool) -> u64 {
    let program = recipe.program();
    let products = (program.bands() * program.components()) as f64 / recipe.acceptance();
    let divisor = if is_software { SOFTWARE } else { 1 };
    ((TRIAL_PRODUCTS / products) as u64 / divisor).clamp(4, TRIAL_DRAWS / divisor) / 4 * 4
}

/// Responses that the draws of a trial are given, where a recipe gives them any: about those of the model's mean spectrum,
/// which have many spectra.
fn trial_responses(recipe: &Recipe, count: u64) -> Vec<f32> {
    if recipe.program().given == 0 {
        return Vec::new();
    }
    let (_, responses) = recipe.free();
    let shifted = |i: u64, mean: &f64| (mean * (1.0 + ((i % 64) as f64 - 32.0) / 1024.0)) as f32;
    (0..count).flat_map(|i| responses.offset.iter().map(move |mean| shifted(i, mean))).collect()
}

/// Whether the draws of a pipeline are those of the CPU.
fn trial(gpu: &Gpu, recipe: &Recipe, sampler: &Sampler, indexing: Indexing) -> Result<bool, EngineError> {
    let count = trial_draws(recipe, gpu.adapter().kind == "software");
    agrees(gpu, recipe, sampler, indexing, count)
}

/// Whether this number of a pipeline's draws are those of the CPU.
fn agrees(
    gpu: &Gpu,
    recipe: &Recipe,
    sampler: &Sampler,
    indexing: Indexing,
    count: u64,
) -> Result<bool, EngineError> {
    let job = Job { recipe, per_step: 1 };
    let mut schedule = GpuSchedule::of_samplers(gpu, &[job], vec![sampler.clone()])?;
    let reference = Reference::new(recipe);
    let stream = Stream::named(0, "trial");
    let indices: Vec<u64> = (0..count).collect();
    let draws: Draws = match indexing {
        Indexing::Range => stream.draws(0..count).into(),
        Indexing::List => stream.at(&indices),
    };
    let given = trial_responses(recipe, count);
    let draws = draws.with_given(&given);
    let mut is_exact = true;
    schedule.draw::<EngineError>(&[draws], count, &mut |batches| {
        is_exact = is_exact && reference.difference(&batches[0], draws).is_none();
        Ok(())
    })?;
    Ok(is_exact)
}

/// The verdict on a device by draws of a built-in model, for what is not about one recipe.
pub(super) fn standard(gpu: &Gpu, choice: ArithmeticChoice) -> Result<ArithmeticVerdict, EngineError> {
    let model = Model::builtin("munsell-vrhel").expect("it is built in");
    let recipe = Recipe::builder(&model).build().expect("it can be drawn");
    sampler(gpu, &recipe, Indexing::Range, choice).map(|(_, verdict)| verdict)
}

/// Traits of a device's arithmetic, and the form in which it is to draw. See [`probe`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Probe {
    /// Form of arithmetic, and whether draws are those of the CPU.
    #[serde(flatten)]
    pub verdict: ArithmeticVerdict,
    /// Traits that the device has, each with the number of cases in which it showed, of [`Probe::CASES`]. Any but
    /// [`ArithmeticTrait::OtherSums`] and [`ArithmeticTrait::OtherProducts`] are none of the exact form's concern.
    pub traits: Vec<(ArithmeticTrait, u32)>,
}

impl Probe {
    /// Number of cases of each trait.
    pub const CASES: u32 = CASES;
}

impl fmt::Display for Probe {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let traits: Vec<_> = self.traits.iter().map(|(found, _)| found.name()).collect();
        match traits.is_empty() {
            true => write!(f, "{}", self.verdict),
            false => write!(f, "{} ({})", self.verdict, traits.join(", ")),
        }
    }
}

/// Tries the arithmetic of a host's device: a self-test in one dispatch, and draws of a built-in model in the plain and,
/// where need be, the exact form. Submits work and waits for it, which a [`Sampler`] never does: once, when the device is
/// opened, and before its frames.
///
/// ```
/// use spectroll::{Model, Recipe, Sampler, SamplerOptions, wgpu};
///
/// # fn host() -> Option<(wgpu::Device, wgpu::Queue)> { None }
/// # let Some((device, queue)) = host() else { return Ok(()) };
/// let probe = spectroll::probe(&device, &queue)?;
/// let recipe = Recipe::builder(&Model::builtin("granada")?).build()?;
/// let options = SamplerOptions { arithmetic: probe.verdict.arithmetic, ..SamplerOptions::default() };
/// let sampler = Sampler::with_options(&device, &recipe, options)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn probe(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Probe, EngineError> {
    of(&Gpu::of_host(device, queue))
}

/// The probe of a device that is open.
pub(super) fn of(gpu: &Gpu) -> Result<Probe, EngineError> {
    let counters = run_self_test(gpu)?;
    let traits = ArithmeticTrait::ALL.iter().copied().zip(counters);
    let traits = traits.filter(|(_, cases)| *cases > 0).collect();
    Ok(Probe { verdict: standard(gpu, ArithmeticChoice::Auto)?, traits })
}

/// The counters of the self-test.
fn run_self_test(gpu: &Gpu) -> Result<Vec<u32>, EngineError> {
    use wgpu::BufferUsages as Usage;
    let (device, queue) = gpu.device();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("spectroll self-test"),
        source: wgpu::ShaderSource::Wgsl(self_test().into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("spectroll self-test"),
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    // Buffers are zeros at first.
    let buffer = |size, usage| {
        let label = Some("spectroll self-test");
        device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation: false })
    };
    let size = 4 * ArithmeticTrait::ALL.len() as u64;
    let zero = buffer(16, Usage::UNIFORM);
    let counters = buffer(size, Usage::STORAGE | Usage::COPY_SRC);
    let staging = buffer(size, Usage::MAP_READ | Usage::COPY_DST);
    let entries = [&zero, &counters].map(wgpu::Buffer::as_entire_binding);
    let entries = (0..).zip(entries).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource });
    let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("spectroll self-test"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries.collect::<Vec<_>>(),
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(CASES / WORKGROUP, 1, 1);
    }
    encoder.copy_buffer_to_buffer(&counters, 0, &staging, 0, None);
    queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |_| {});
    gpu.poll(wgpu::PollType::wait_indefinitely())?;
    let view = staging.get_mapped_range(..).map_err(|e| gpu.error(e.to_string()))?;
    Ok(bytemuck::cast_slice(&view).to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{BuiltinTable, Dataset, SpectrumKind};
    use crate::engine::{Engine, EngineChoice};
    use crate::grid::Extrapolation;
    use crate::model::Fit;
    use crate::quantity::{Dtype, Layout, Quantity};
    use crate::wgsl::{Dialect, ShaderVariant, Stores};

    #[test]
    fn the_lesser_verdict_counts() {
        let verdict = |arithmetic, is_exact| ArithmeticVerdict { arithmetic, is_exact };
        let (plain, exact) = (verdict(Arithmetic::Plain, true), verdict(Arithmetic::Exact, true));
        assert_eq!((plain.and(plain), plain.and(exact)), (plain, exact));
        assert_eq!(plain.and(verdict(Arithmetic::Plain, false)), verdict(Arithmetic::Plain, false));
        assert_eq!(plain.to_string(), "plain arithmetic, the CPU's bytes");
    }

    #[test]
    fn hard_recipes_have_short_trials() {
        let model = Model::builtin("munsell-vrhel").unwrap();
        let plain = Recipe::builder(&model).build().unwrap();
        assert_eq!([trial_draws(&plain, false), trial_draws(&plain, true)], [TRIAL_DRAWS, TRIAL_DRAWS / 8]);
        let hard = Recipe::builder(&model).covariance_scale(100.0).max_attempts(1 << 20);
        let hard = hard.proposal(crate::recipe::ProposalKind::Plain).build().unwrap();
        assert!((4..10_000).contains(&trial_draws(&hard, false)));
    }

    /// A pipeline whose text lacks one operation is found out, and the other form is taken.
    #[test]
    fn a_pipeline_that_is_off_fails_its_trial() {
        let engine = Engine::new(&EngineChoice::Gpu).expect("this test needs an adapter");
        let gpu = engine.gpu().expect("it is an adapter's");
        let model = Model::builtin("munsell-vrhel").unwrap();
        let recipe = Recipe::builder(&model).build().unwrap();
        let program = recipe.program().with_status();
        let (device, _) = gpu.device();
        let variant = ShaderVariant { arithmetic: Arithmetic::Exact, ..Sampler::variant(device) };
        let (text, tables) = crate::wgsl::shader_of(&program, variant);
        for (change, is_exact) in [("0.087404214f", true), ("0.087404215f", true), ("0.08740423f", false)] {
            let text = text.replace("0.087404214f", change);
            let shader = ComputeShader::with_text(&program, variant, text, &tables.values).unwrap();
            let sampler = Sampler::with_shader(device, shader, None).unwrap();
            assert_eq!(trial(gpu, &recipe, &sampler, Indexing::Range).unwrap(), is_exact, "{change}");
        }
    }

    /// Rows that a workgroup gathers, as hardware has them, on whatever adapter there is: in one tile and in several, with
    /// workgroups that are not full, beside quantities that are not gathered.
    #[test]
    fn gathered_rows_are_those_of_the_cpu() {
        let engine = Engine::new(&EngineChoice::Gpu).expect("this test needs an adapter");
        let gpu = engine.gpu().expect("it is an adapter's");
        let (device, _) = gpu.device();
        let own = Sampler::variant(device);
        let dialect = if own.dialect == Dialect::Baseline { own.dialect } else { Dialect::Int64 };
        let vrhel = |grid: &str, components| {
            let data =
                Dataset::new(&[BuiltinTable::Vrhel.table()], grid.parse().unwrap(), Extrapolation::Error);
            Fit::new(SpectrumKind::Reflectance).components(components).fit(&data.unwrap()).unwrap()
        };
        let all: Vec<_> = Quantity::ALL
            .iter()
            .copied()
            .filter(|q| !matches!(q, Quantity::Intensity | Quantity::Responses))
            .collect();
        let few = vec![Quantity::Spectra, Quantity::Xyz, Quantity::Attempts];
        let lists = [Indexing::Range, Indexing::List];
        let formats = [
            (Layout::Rows, Dtype::F32, &lists[..]),
            (Layout::PaddedRows, Dtype::F32, &lists[..1]),
            (Layout::Planes, Dtype::F32, &lists[..1]),
            (Layout::Rows, Dtype::F16, &lists[..1]),
        ];
        for (model, bands, formats, quantities) in [
            (Model::builtin("munsell-vrhel").unwrap(), 31, &formats[..], &all),
            (vrhel("400:5:715", 3), 64, &formats[1..2], &few),
            (vrhel("400:2:660", 2), 131, &formats[..1], &few),
        ] {
            assert_eq!(model.grid().len(), bands);
            for &(layout, dtype, indexings) in formats {
                let recipe = Recipe::builder(&model).quantities(quantities.iter().copied()).layout(layout);
                let recipe = recipe.spectra_dtype(dtype).lrv(0.6).build().unwrap();
                for &indexing in indexings {
                    let arithmetic = Arithmetic::Exact;
                    let variant = ShaderVariant { dialect, indexing, arithmetic, stores: Stores::Gathered };
                    let shader = Sampler::shader_of(&recipe.program().with_status(), variant).unwrap();
                    // Two halves are a word of two draws, which take more candidates than a dispatch tries.
                    let gathers = layout != Layout::Planes && dtype == Dtype::F32;
                    assert_eq!(shader.text().contains("workgroupBarrier"), gathers, "{layout:?}, {dtype:?}");
                    let sampler = Sampler::with_shader(device, shader, None).unwrap();
                    for count in [1, 63, 64, 1001] {
                        let agrees = agrees(gpu, &recipe, &sampler, indexing, count).unwrap();
                        assert!(agrees, "{bands} bands, {layout:?}, {dtype:?}, {variant:?}, {count} draws");
                    }
                }
            }
        }
    }
}

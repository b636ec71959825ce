//! Cost of each part of a draw on an adapter: the shader without the part, timed in turn with the whole.
//!
//! The model has so little covariance that the first candidate always passes, with or without the part, so that
//! only the part's work is missing. Shares need not sum to 1: parts overlap where a device does several things at once,
//! and what waits for memory has time for arithmetic.

use std::time::{Duration, Instant};

use serde::Serialize;
use wgpu::Device;

use crate::engine::{Engine, EngineError};
use crate::model::Model;
use crate::program::Program;
use crate::random::stream::Stream;
use crate::recipe::{Recipe, RecipeError};
use crate::sampler::{Prepared, Sampler};
pub use crate::wgsl::Part;
use crate::wgsl::{ComputeShader, shader_without};

/// Draws per dispatch. Their spectra stay below the least size of a buffer that a device may offer.
const COUNT: u64 = 1 << 19;

/// Share of a draw's cost that a part has.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Share {
    /// The part.
    pub part: Part,
    /// Time that a draw without the part saves, relative to the whole: the median of several runs.
    pub median: f64,
    /// Smallest of the runs.
    pub least: f64,
    /// Largest of the runs.
    pub most: f64,
}

/// Error returned where costs cannot be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum CostError {
    #[error(transparent)]
    Recipe(#[from] RecipeError),
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// Measurement on an adapter, run by run.
pub struct Costs<'a> {
    engine: &'a Engine,
    whole: Prepared,
    parts: Vec<Without>,
    /// Number of dispatches of a shader in a run.
    times: u32,
}

/// Shader without a part.
struct Without {
    part: Part,
    prepared: Prepared,
    /// Time saved in each run.
    saved: Vec<f64>,
}

impl<'a> Costs<'a> {
    /// Prepares to draw spectra of a model, whole and without each part, for this time each in a run. `None` on the
    /// CPU: there the parts are one loop, and a profiler tells them apart.
    pub fn new(engine: &'a Engine, model: &Model, time: Duration) -> Result<Option<Costs<'a>>, CostError> {
        let Some((device, _)) = engine.device() else { return Ok(None) };
        let program = never_rejected(model)?;
        let prepare = |part| -> Result<Prepared, EngineError> {
            Ok(sampler(device, &program, part)?.prepare(device, Stream::new(0).draws(0..COUNT))?)
        };
        let whole = prepare(None)?;
        let without = |part| Ok(Without { part, prepared: prepare(Some(part))?, saved: Vec::new() });
        let parts = Part::ALL.into_iter().map(without).collect::<Result<Vec<_>, EngineError>>()?;
        let mut costs = Costs { engine, whole, parts, times: 1 };
        // What is done once is not to be measured.
        for prepared in costs.parts.iter().map(|without| &without.prepared).chain([&costs.whole]) {
            costs.seconds(prepared)?;
        }
        costs.times = (time.as_secs_f64() / costs.seconds(&costs.whole)?).clamp(1.0, 1e4) as u32;
        Ok(Some(costs))
    }

    /// Measures the whole and each part once.
    pub fn run(&mut self) -> Result<(), CostError> {
        let all = self.seconds(&self.whole)?;
        for i in 0..self.parts.len() {
            let saved = 1.0 - self.seconds(&self.parts[i].prepared)? / all;
            self.parts[i].saved.push(saved);
        }
        Ok(())
    }

    /// Shares over all runs; empty where there was none.
    pub fn shares(&self) -> Vec<Share> {
        let share = |Without { part, saved, .. }: &Without| {
            let mut saved = saved.clone();
            saved.sort_by(f64::total_cmp);
            let (least, most) = (*saved.first()?, *saved.last()?);
            Some(Share { part: *part, median: saved[saved.len() / 2], least, most })
        };
        self.parts.iter().filter_map(share).collect()
    }

    /// Time that the dispatches of a run take, in one submission.
    fn seconds(&self, prepared: &Prepared) -> Result<f64, EngineError> {
        let (device, queue) = self.engine.device().expect("it is an adapter's");
        let start = Instant::now();
        let mut encoder = device.create_command_encoder(&Default::default());
        (0..self.times).for_each(|_| prepared.record(&mut encoder));
        queue.submit([encoder.finish()]);
        self.engine.wait()?;
        Ok(start.elapsed().as_secs_f64())
    }
}

/// Makes a program for spectra and statuses of a model that has next to no covariance.
fn never_rejected(model: &Model) -> Result<Program, RecipeError> {
    Ok(Recipe::builder(model).covariance_scale(1e-4).build()?.program().with_status())
}

/// Makes the sampler of a program without a part.
fn sampler(device: &Device, program: &Program, part: Option<Part>) -> Result<Sampler, EngineError> {
    let variant = Sampler::variant(device);
    let (text, tables) = shader_without(program, variant, part);
    let shader = ComputeShader::with_text(program, variant, text, &tables.values);
    Ok(Sampler::with_shader(device, shader.expect("it has the bands of a model"), None)?)
}

#[cfg(test)]
mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::*;
    use crate::engine::EngineChoice;
    use crate::wgsl::{Dialect, ShaderVariant};

    fn model() -> Model {
        Model::builtin("munsell-vrhel").unwrap()
    }

    /// The part that is left out is absent, and the rest is present: by words that only the part's code has.
    #[test]
    fn each_shader_is_valid_and_lacks_its_part_alone() {
        let program = never_rejected(&model()).unwrap();
        for dialect in [Dialect::Baseline, Dialect::Int64, Dialect::SoftwareInt64] {
            let target = ShaderVariant { dialect, ..ShaderVariant::default() };
            let whole = shader_without(&program, target, None).0;
            for part in Part::ALL {
                let text = shader_without(&program, target, Some(part)).0;
                let module = naga::front::wgsl::parse_str(&text).unwrap_or_else(|e| panic!("{part:?}: {e}"));
                let mut validator = Validator::new(ValidationFlags::all(), Capabilities::SHADER_INT64);
                validator.validate(&module).unwrap_or_else(|e| panic!("{part:?}: {e}"));
                for (of, mark) in [
                    (Part::Philox, "c = philox_round(c, key"),
                    (Part::Normals, "return vec2(r * c.x, r * c.y)"),
                    (Part::Reconstruction, " * z[0] + "),
                    (Part::Test, "return worst(z)"),
                    (Part::Store, "    spectra["),
                ] {
                    let (before, after) = (whole.matches(mark).count(), text.matches(mark).count());
                    let left = if of != part { before } else { usize::from(of == Part::Store) };
                    assert!(before > 0 && after == left, "{part:?} {target:?} {mark}: {before} {after}");
                }
            }
        }
    }

    /// The first candidate is taken; otherwise a part would be blamed for what its absence does to the number of
    /// attempts.
    #[test]
    fn every_shader_takes_the_first_candidate() {
        let engine = Engine::new(&EngineChoice::Gpu).expect("this test needs an adapter");
        let costs = Costs::new(&engine, &model(), Duration::ZERO).unwrap().expect("it is no CPU");
        let (device, queue) = engine.device().unwrap();
        for prepared in costs.parts.iter().map(|without| &without.prepared).chain([&costs.whole]) {
            let statuses = prepared.buffer(crate::Quantity::Attempts).expect("tallies come out");
            let staging = device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: statuses.size(),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            let mut encoder = device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(statuses, 0, &staging, 0, None);
            queue.submit([encoder.finish()]);
            staging.map_async(wgpu::MapMode::Read, .., |result| result.expect("it maps"));
            engine.wait().unwrap();
            let view = staging.get_mapped_range(..).expect("it is mapped");
            let words: &[u32] = bytemuck::cast_slice(&view);
            assert_eq!(words.len() as u64, COUNT);
            assert!(words.iter().all(|&word| word == 1));
        }
    }

    #[test]
    fn there_is_a_share_for_each_part_of_an_adapter() {
        let engine = Engine::new(&EngineChoice::Gpu).expect("this test needs an adapter");
        let mut costs = Costs::new(&engine, &model(), Duration::ZERO).unwrap().expect("it is no CPU");
        assert!(costs.shares().is_empty());
        (0..3).for_each(|_| costs.run().unwrap());
        let shares = costs.shares();
        assert_eq!(shares.iter().map(|share| share.part).collect::<Vec<_>>(), Part::ALL);
        assert!(shares.iter().all(|s| s.least <= s.median && s.median <= s.most && s.most < 1.0));
        let cpu = Engine::new(&EngineChoice::Cpu).unwrap();
        assert!(Costs::new(&cpu, &model(), Duration::ZERO).unwrap().is_none());
    }
}

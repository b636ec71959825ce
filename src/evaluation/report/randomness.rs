//! Randomness: known answers, the generator's p-values, and the battery of the tests on each engine.

use serde::Serialize;

use super::{Bench, ReportError};
use crate::evaluation::statistics::{
    self, FALSE_ALARMS, GAUSSIAN, RUNS, Sample, Scenario, Smallest, battery, of_all, smallest_errors,
    uniformity,
};
use crate::model::Model;
use crate::random::philox::{KNOWN_ANSWERS, philox};
use crate::random::stream::Stream;
use crate::recipe::Recipe;

/// Number of normals of a candidate that are tested.
const NORMALS: usize = 6;

/// Tests of the generator, and of the distribution of draws.
#[derive(Clone, Debug, Serialize)]
pub struct Randomness {
    /// Number of Random123's test vectors that the generator reproduces, and of all.
    pub known_answers: [usize; 2],
    /// For each engine on an adapter, its index, the number of draws with the same bits as the CPU's in f32, and the
    /// number of all compared.
    pub same_bits: Vec<(usize, u64, u64)>,
    /// Number of seeds of the generator that are tested.
    pub seeds: u64,
    /// Number of draws of each seed.
    pub draws: u64,
    /// Comparisons of each kind, over all seeds.
    pub groups: Vec<GroupRow>,
    /// p-value of all comparisons together: whether their p-values are uniform.
    pub p_of_all: f64,
    /// Checks of the tests' battery, on each engine and model.
    pub checks: Vec<CheckRow>,
    /// Number of draws of each check.
    pub check_draws: u64,
    /// Probability that sound draws fail a check.
    pub false_alarms: f64,
    /// Smallest errors that the checks see, for the first model.
    pub smallest: Option<Smallest>,
}

/// Comparisons of one kind.
#[derive(Clone, Debug, Serialize)]
pub struct GroupRow {
    /// Name of the comparison.
    pub name: &'static str,
    /// Their p-values.
    pub p_values: Vec<f64>,
}

/// A check of an engine's draws.
#[derive(Clone, Debug, Serialize)]
pub struct CheckRow {
    /// The engine, as an index into the report's.
    pub engine: usize,
    /// Model and recipe.
    pub scenario: String,
    /// Name of the check.
    pub check: &'static str,
    /// Values that it compares, in words.
    pub compares: &'static str,
    /// Number of comparisons.
    pub comparisons: usize,
    /// Probability that sound draws look as bad.
    pub p: f64,
    /// Description of a fault, if there is one.
    pub alarm: Option<String>,
}

pub(super) fn measure(bench: &Bench, models: &[(String, Model)]) -> Result<Randomness, ReportError> {
    let known = KNOWN_ANSWERS.iter().filter(|&&(counter, key, output)| philox(counter, key) == output);
    let (seeds, draws) = bench.effort.pick((6, 1 << 15), (20, 1 << 16), (100, 1 << 18));
    let mut groups: Vec<GroupRow> = Vec::new();
    for seed in 0..seeds {
        bench.agenda.say(&format!("the generator under seed {seed} of {seeds}"))?;
        for (i, group) in
            uniformity(bench.seed.wrapping_add(2 * seed), NORMALS, draws).into_iter().enumerate()
        {
            match groups.get_mut(i) {
                Some(row) => row.p_values.extend(group.p_values),
                None => groups.push(GroupRow { name: group.name, p_values: group.p_values }),
            }
        }
    }
    let all: Vec<f64> = groups.iter().flat_map(|g| g.p_values.iter().copied()).collect();
    let check_draws = bench.effort.pick(1 << 14, 1 << 16, 1 << 18);
    let (checks, smallest) = checks(bench, models, check_draws)?;
    Ok(Randomness {
        known_answers: [known.count(), KNOWN_ANSWERS.len()],
        same_bits: same_bits(bench, models)?,
        seeds,
        draws,
        p_of_all: of_all(&all),
        groups,
        checks,
        check_draws,
        false_alarms: FALSE_ALARMS / RUNS as f64,
        smallest,
    })
}

/// Scenarios: the plain draws of each model, and those with so little covariance that none is rejected and each
/// weight is normal.
fn scenarios(models: &[(String, Model)]) -> Vec<Scenario> {
    let scenario = |name: &str, what: &str, model: &Model, scale| Scenario {
        name: format!("{name}{what}"),
        model: model.clone(),
        target: None,
        scale,
    };
    let plain = models.iter().map(|(name, model)| scenario(name, "", model, 1.0));
    let narrow = models.iter().map(|(name, model)| scenario(name, ", covariance × 0.01", model, 0.01));
    plain.chain(narrow).collect()
}

fn checks(
    bench: &Bench,
    models: &[(String, Model)],
    draws: u64,
) -> Result<(Vec<CheckRow>, Option<Smallest>), ReportError> {
    let (mut rows, mut smallest) = (Vec::new(), None);
    for (number, scenario) in (1..).zip(scenarios(models)) {
        // An oracle would wait for centres that have no share.
        let recipe = Recipe::builder(&scenario.model).covariance_scale(scenario.scale).build();
        if !recipe.is_ok_and(|recipe| recipe.left_out() == 0) {
            continue;
        }
        bench.agenda.say(&format!("the distribution of {}", scenario.name))?;
        let oracle = statistics::oracle(&scenario, bench.seed.wrapping_add(number), draws);
        for (index, target) in bench.targets.iter().enumerate() {
            let Some(engine) = target.engine() else { continue };
            bench.agenda.say(&format!("the distribution of {} on {}", scenario.name, target.facts.name))?;
            let sampler = |stream, first, count| Sample::of_engine(&scenario, engine, stream, first, count);
            let findings = battery(&sampler, &oracle, bench.seed)?;
            smallest.get_or_insert_with(|| smallest_errors(&oracle));
            // A model may reject some candidates even so, and then its weights are not normal.
            let normal = oracle.attempts.iter().all(|&attempts| attempts == 1.0);
            rows.extend(findings.into_iter().filter(|(c, _)| normal || c.name != GAUSSIAN.name).map(
                |(check, finding)| CheckRow {
                    engine: index,
                    scenario: scenario.name.clone(),
                    check: check.name,
                    compares: check.compares,
                    comparisons: finding.p_values.len(),
                    p: finding.p(),
                    alarm: finding.alarm(),
                },
            ));
        }
    }
    Ok((rows, smallest))
}

/// Compares draws of the first model by each engine, bit for bit, with the CPU's.
fn same_bits(bench: &Bench, models: &[(String, Model)]) -> Result<Vec<(usize, u64, u64)>, ReportError> {
    const DRAWS: u64 = 100_000;
    let recipe = Recipe::builder(&models[0].1).build()?;
    let draws = Stream::named(bench.seed, "bits").draws(0..DRAWS);
    let bands = recipe.model().bands();
    let cpu = crate::engine::Engine::new(&crate::engine::EngineChoice::Cpu)?.collect(&recipe, draws)?;
    let mut all = Vec::new();
    for (index, target) in bench.targets.iter().enumerate() {
        let Some(engine) = target.engine().filter(|e| e.adapter().is_some()) else { continue };
        let ours = engine.collect(&recipe, draws)?;
        let same = ours.chunks_exact(bands).zip(cpu.chunks_exact(bands)).filter(|(a, b)| a == b).count();
        all.push((index, same as u64, DRAWS));
    }
    Ok(all)
}

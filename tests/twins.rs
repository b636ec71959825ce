//! Twins: the CPU engine in f32 and the shader make the same draws.
//!
//! Software adapters have the CPU's bytes in both forms of arithmetic, so there every bit is demanded of both. A real GPU may
//! fuse products into sums, which the plain form leaves open: there a draw may take another candidate once in 10^6, and
//! values may differ by 16 units in the last place of the largest term that made them. Of the exact form every bit is
//! demanded wherever its trial succeeds. `WGPU_ADAPTER_NAME` picks the adapter; without one these tests fail.

mod engines;

use engines::{cpu, forms, gpu, gpu_is_software, surfaces};
use nalgebra::{DMatrix, DVector};
use rand::Rng;
use spectroll::evaluation::statistics::tinted;
use spectroll::{
    Bounds, BuiltinTable, Dataset, DrawRange, DrawStatus, Engine, EngineError, Extrapolation, Fit, Grid, Lrv,
    Model, ModelParts, ProposalKind, Real, Recipe, SpectrumKind, Stream, colorimetry,
};

/// How far an adapter that fuses may be off, in units in the last place of the largest term.
const ULPS: f64 = 16.0;

/// A recipe, and what it was made of.
struct Case {
    recipe: Recipe,
    target: Option<(Lrv, Bounds)>,
    /// The weights of the bands in an LRV.
    lrv_weights: Vec<f64>,
    /// The spectrum at z = 0, and what each normal adds.
    offset: DVector<f64>,
    gain: DMatrix<f64>,
}

impl Case {
    fn new(model: &Model, target: Option<(f64, Bounds)>, scale: f64) -> Case {
        Case::with(model, target.map(|(lrv, bounds)| (Lrv::Fixed(lrv), bounds)), scale)
    }

    /// Of draws that each have a target between the two.
    fn in_range(model: &Model, low: f64, high: f64, bounds: Bounds) -> Case {
        Case::with(model, Some((Lrv::Uniform(low, high), bounds)), 1.0)
    }

    fn with(model: &Model, target: Option<(Lrv, Bounds)>, scale: f64) -> Case {
        let recipe = Recipe::builder(model).covariance_scale(scale);
        let recipe = match target {
            Some((lrv, bounds)) => recipe.lrv(lrv).bounds(bounds),
            None => recipe,
        };
        let parts = model.parts();
        Case {
            recipe: recipe.build().expect("the recipe can be drawn"),
            target,
            lrv_weights: colorimetry::lrv_weights(model.grid()).expect("the grid is visible"),
            offset: model.reconstruct(parts.weight_mean.as_slice()),
            gain: parts.basis.transpose() * model.weight_factor() * scale.sqrt(),
        }
    }

    fn plain(model: &Model) -> Case {
        Case::new(model, None, 1.0)
    }

    /// The unit in the last place of the largest term in candidate `attempts` of a draw.
    fn ulp(&self, stream: Stream, index: u64, attempts: u32) -> f64 {
        let blocks = (0..self.gain.ncols().div_ceil(4) as u32).map(|b| stream.block(index, attempts - 1, b));
        let normals =
            blocks.flat_map(|[a, b, c, d]| [f64::normal_pair(a, b), f64::normal_pair(c, d)].concat());
        let z = DVector::from_iterator(self.gain.ncols(), normals.take(self.gain.ncols()));
        let largest = (self.offset.abs() + self.gain.abs() * z.abs()).max();
        let factor = self
            .target_of(stream, index)
            .map_or(1.0, |lrv| lrv / self.lrv((&self.offset + &self.gain * z).as_slice()));
        f64::from(f32::EPSILON) * largest * factor
    }

    /// The target of a draw: the first word of its own block is all that one in a range depends on.
    fn target_of(&self, stream: Stream, index: u64) -> Option<f64> {
        match self.target?.0 {
            Lrv::Fixed(lrv) => Some(lrv),
            Lrv::Uniform(low, high) => {
                let word = stream.block(index, 0, 255)[0];
                Some(low + (high - low) * (f64::from(word) + 0.5) / 2f64.powi(32))
            }
        }
    }

    fn lrv(&self, spectrum: &[f64]) -> f64 {
        self.lrv_weights.iter().zip(spectrum).map(|(w, s)| w * s).sum()
    }
}

#[derive(Clone, PartialEq)]
struct Rows {
    spectra: Vec<f32>,
    statuses: Vec<DrawStatus>,
}

fn rows(engine: &Engine, recipe: &Recipe, draws: DrawRange) -> Rows {
    let mut rows = Rows { spectra: Vec::new(), statuses: Vec::new() };
    let made = engine.draw(recipe, draws, |batch| {
        rows.spectra.extend_from_slice(batch.spectra());
        rows.statuses.extend_from_slice(batch.statuses());
        Ok::<_, EngineError>(())
    });
    let summary = made.unwrap_or_else(|e| panic!("{engine}: {e}"));
    assert_eq!((summary.draws, rows.statuses.len() as u64), (draws.count, draws.count));
    rows
}

/// Whether two engines agree as they should: to the bit, or as arithmetic that fuses may.
fn compare(case: &Case, draws: DrawRange, a: &Rows, b: &Rows, to_the_bit: bool) -> Result<(), String> {
    let bands = case.recipe.model().bands();
    let mut flips = 0;
    for (i, (ta, tb)) in a.statuses.iter().zip(&b.statuses).enumerate() {
        let index = draws.first.wrapping_add(i as u64);
        if to_the_bit && ta != tb {
            return Err(format!("draw {index}: {ta:?} against {tb:?}"));
        }
        if ta.attempts() != tb.attempts() {
            flips += 1;
            continue;
        }
        let row = |rows: &Rows| rows.spectra[i * bands..(i + 1) * bands].to_vec();
        let tolerance = if to_the_bit { 0.0 } else { ULPS * case.ulp(draws.stream, index, ta.attempts()) };
        for (band, (x, y)) in row(a).into_iter().zip(row(b)).enumerate() {
            let close = x.to_bits() == y.to_bits() || f64::from(x - y).abs() <= tolerance;
            if !close {
                return Err(format!("draw {index}, band {band}: {x:e} against {y:e}"));
            }
        }
    }
    let allowed = if to_the_bit { 0 } else { 1 + draws.count / 1_000_000 };
    if flips > allowed {
        return Err(format!("{flips} of {} draws took another candidate", draws.count));
    }
    Ok(())
}

/// What holds of the draws of every engine: they are physical, and have the LRV that they should.
fn assert_valid(case: &Case, draws: DrawRange, rows: &Rows) {
    let model = case.recipe.model();
    let below_one =
        model.kind() == SpectrumKind::Reflectance && !matches!(case.target, Some((_, Bounds::Base)));
    for (i, (row, status)) in rows.spectra.chunks_exact(model.bands()).zip(&rows.statuses).enumerate() {
        assert!(row.iter().all(|&s| s > 0.0 && s.is_finite() && !(below_one && s >= 1.0)), "{row:?}");
        let above_one = model.kind() == SpectrumKind::Reflectance && row.iter().any(|&s| s >= 1.0);
        assert_eq!(status.above_one(), above_one, "{row:?}");
        if let Some(lrv) = case.target_of(draws.stream, draws.first.wrapping_add(i as u64)) {
            let found = case.lrv(&row.iter().map(|&s| f64::from(s)).collect::<Vec<_>>());
            assert!((found - lrv).abs() < 2e-6, "an LRV of {found} where {lrv} was asked for");
        }
    }
}

/// Makes `draws` on both engines, holds them against each other and against `Recipe::draw`, and returns the CPU's.
fn assert_twins(case: &Case, draws: DrawRange) -> Rows {
    let ours = rows(cpu(), &case.recipe, draws);
    assert_valid(case, draws, &ours);
    for engine in forms() {
        let theirs = rows(engine, &case.recipe, draws);
        let to_the_bit = gpu_is_software() || engine.is_exact();
        if let Err(difference) = compare(case, draws, &ours, &theirs, to_the_bit) {
            panic!("CPU against {engine}, {:?}: {difference}", engine.verdict());
        }
        assert_valid(case, draws, &theirs);
    }
    let bands = case.recipe.model().bands();
    for i in (0..ours.statuses.len()).step_by(draws.count.div_ceil(5000).max(1) as usize) {
        let drawn = case.recipe.draw::<f32>(draws.stream, draws.first.wrapping_add(i as u64));
        let row = &ours.spectra[i * bands..(i + 1) * bands];
        assert_eq!((drawn.spectrum(), drawn.status()), (row, ours.statuses[i]));
    }
    ours
}

fn builtin(name: &str) -> Model {
    Model::builtin(name).expect("it is built in")
}

fn reflectances(tables: &[BuiltinTable], grid: &str, components: usize) -> Model {
    let tables: Vec<_> = tables.iter().map(|t| t.table()).collect();
    let grid = grid.parse::<Grid>().expect("a grid");
    let data = Dataset::new(&tables, grid, Extrapolation::Error).expect("the tables cover the grid");
    Fit::new(SpectrumKind::Reflectance).components(components).fit(&data).expect("the data have that rank")
}

const ALL_BOUNDS: [Bounds; 3] = [Bounds::Base, Bounds::Scaled, Bounds::Both];

#[test]
fn several_windows_of_both_kinds() {
    for name in ["munsell-vrhel", "granada"] {
        assert_twins(&Case::plain(&builtin(name)), Stream::new(1).draws(0..200_003));
    }
}

#[test]
fn every_rule_at_a_target_lrv() {
    for (lrv, bounds) in [0.2, 0.6].into_iter().flat_map(|lrv| ALL_BOUNDS.map(|bounds| (lrv, bounds))) {
        let case = Case::new(&builtin("munsell-vrhel"), Some((lrv, bounds)), 1.0);
        let rows = assert_twins(&case, Stream::new(2).draws(0..20_001));
        let above_one = rows.statuses.iter().filter(|t| t.above_one()).count();
        println!("LRV {lrv} {bounds:?}: {above_one} of 20,001 reach 1 somewhere");
        assert_eq!(above_one > 0, bounds == Bounds::Base);
    }
}

/// The hardest targets of the last take some 15 candidates, which lanes and threads must not mix up with their draws.
#[test]
fn a_target_for_each_draw() {
    let model = builtin("munsell-vrhel");
    for bounds in ALL_BOUNDS {
        assert_twins(&Case::in_range(&model, 0.2, 0.6, bounds), Stream::new(13).draws(0..20_001));
    }
    let wide = Case::in_range(&model, 0.01, 0.9, Bounds::Scaled);
    assert_twins(&wide, Stream::named(13, "wide").draws(u64::MAX - 10_006..));
    let range = Stream::new(13).in_rows(7).draws(0..4097);
    assert_twins(&Case::in_range(&tinted(), 0.3, 0.4, Bounds::Both), range);
}

#[test]
fn covariances_scaled_and_full() {
    for scale in [4.0, 0.01] {
        assert_twins(&Case::new(&builtin("munsell-vrhel"), None, scale), Stream::new(3).draws(0..20_001));
    }
    assert_twins(&Case::plain(&tinted()), Stream::new(3).draws(0..20_001));
    assert_twins(&Case::new(&tinted(), Some((0.4, Bounds::Both)), 2.0), Stream::new(3).draws(0..20_001));
}

/// Greys, and surfaces of two levels: what a driver may factor out of a sum over bands.
#[test]
fn bands_that_are_alike() {
    let parts = builtin("munsell-vrhel").parts().clone();
    for edge in [31, 12] {
        let level = |band: usize| if band < edge { 1.0 } else { 0.5 };
        let basis = DMatrix::from_fn(1, 31, |_, band| level(band)).normalize();
        let model = Model::new(ModelParts {
            mean: DVector::from_fn(31, |band, _| 0.4 * level(band)),
            basis,
            weight_mean: DVector::zeros(1),
            weight_covariance: DMatrix::from_element(1, 1, 0.25),
            explained_variance: vec![1.0],
            ..parts.clone()
        });
        let model = model.expect("it is a model");
        for bounds in ALL_BOUNDS {
            assert_twins(&Case::new(&model, Some((0.3, bounds)), 1.0), Stream::new(12).draws(0..20_001));
        }
    }
}

#[test]
fn any_number_of_components() {
    for components in [1, 2, 3, 5, 12, 31] {
        let model = reflectances(&[BuiltinTable::Munsell, BuiltinTable::Vrhel], "400:10:700", components);
        assert_twins(&Case::plain(&model), Stream::new(4).draws(0..4097));
    }
}

/// 341 bands: up to 6 components are written out in straight lines, 7 and more run in loops.
#[test]
fn models_too_large_for_straight_lines() {
    let of = |components| reflectances(&[BuiltinTable::Vrhel], "390:1:730", components);
    let draws = Stream::named(5, "wall").draws(77..77 + 4097);
    assert_twins(&Case::plain(&of(6)), draws);
    assert_twins(&Case::plain(&of(7)), draws);
    let twelve = of(12);
    assert_twins(&Case::plain(&twelve), draws);
    for bounds in ALL_BOUNDS {
        assert_twins(&Case::new(&twelve, Some((0.6, bounds)), 1.0), draws);
        assert_twins(&Case::in_range(&twelve, 0.2, 0.6, bounds), draws);
    }
}

/// llvmpipe ends loops after 65,535 iterations of an invocation, nested ones counted: what a draw does is bounded in one
/// dispatch, and goes on in the next.
#[test]
fn models_whose_loops_are_long() {
    for components in [33, 40, 64] {
        let model = reflectances(&[BuiltinTable::Munsell, BuiltinTable::Vrhel], "400:1:700", components);
        assert_twins(&Case::plain(&model), Stream::new(14).draws(0..2000));
        assert_twins(&Case::new(&model, Some((0.6, Bounds::Both)), 1.0), Stream::new(14).draws(0..1000));
    }
    // As many components as bands: the cosines of a grid are orthonormal.
    for size in [65, 200] {
        let n = size as f64;
        let basis = DMatrix::from_fn(size, size, |row, band| {
            let scale = if row == 0 { (1.0 / n).sqrt() } else { (2.0 / n).sqrt() };
            scale * (std::f64::consts::PI * row as f64 * (band as f64 + 0.5) / n).cos()
        });
        let model = Model::new(ModelParts {
            grid: Grid::new(400.0, 0.5, size).expect("a grid"),
            mean: DVector::from_element(size, 0.5),
            basis,
            weight_mean: DVector::zeros(size),
            weight_covariance: DMatrix::identity(size, size) * 0.02,
            explained_variance: vec![1.0 / n; size],
            ..builtin("munsell-vrhel").parts().clone()
        });
        let case = Case::plain(&model.expect("it is a model"));
        let rows = assert_twins(&case, Stream::new(15).draws(0..300));
        assert!(rows.statuses.iter().any(|status| status.attempts() > 1));
    }
}

/// A draw may take more candidates than one dispatch tries, on its own or beside others that take one.
#[test]
fn draws_of_very_many_attempts() {
    let recipe = |attempts| {
        let recipe = surfaces().lrv(0.98).bounds(Bounds::Scaled).proposal(ProposalKind::Plain);
        recipe.max_attempts(attempts).build().expect("it can be drawn")
    };
    let mut most = 0;
    for draws in [Stream::new(16).draws(0..2001), Stream::new(16).draws(0..1)] {
        let recipe = recipe(300_000);
        let (ours, theirs) = (rows(cpu(), &recipe, draws), rows(gpu(), &recipe, draws));
        assert!(!gpu_is_software() || ours == theirs);
        most = ours.statuses.iter().map(|status| status.attempts()).max().expect("there are draws").max(most);
    }
    println!("up to {most} attempts");
    assert!(most > 65_535);
}

#[test]
fn any_count() {
    let (base, illuminant) = (
        Case::new(&builtin("munsell-vrhel"), Some((0.6, Bounds::Base)), 1.0),
        Case::plain(&builtin("granada")),
    );
    for count in [0, 1, 63, 64, 65, 4097] {
        for case in [&base, &illuminant] {
            assert_twins(case, Stream::new(6).draws(3..3 + count));
        }
    }
}

/// The second half of these indices needs the counter's high word; the last ones go round to 0.
#[test]
fn any_index_seed_and_stream() {
    let case = Case::plain(&builtin("munsell-vrhel"));
    for seed in [0, u64::MAX, 0x0123_4567_89AB_CDEF] {
        for stream in [Stream::new(seed), Stream::named(seed, "table lamp")] {
            assert_twins(&case, stream.draws((1 << 32) - 33..(1 << 32) + 32));
            assert_twins(&case, stream.draws(u64::MAX - 70..=u64::MAX));
        }
    }
    let stream = Stream::new(7);
    let around = assert_twins(&case, DrawRange { stream, first: u64::MAX - 4, count: 11 });
    let from_zero = rows(cpu(), &case.recipe, stream.draws(0..6));
    assert_eq!(around.spectra[5 * case.recipe.model().bands()..], from_zero.spectra);
}

/// Rows of any length, in windows that start anywhere in one.
#[test]
fn draws_in_rows() {
    let case = Case::plain(&builtin("munsell-vrhel"));
    let stream = Stream::named(11, "background");
    for length in [1, 3, 999] {
        let first = 4 * u64::from(length) + u64::from(length) / 2;
        let rows = assert_twins(&case, stream.in_rows(length).draws(first..first + 4099));
        let (row, place) = ((first + 4000) / u64::from(length), (first + 4000) % u64::from(length));
        let alone = case.recipe.draw::<f32>(stream, row << 32 | place);
        assert_eq!(rows.spectra[4000 * 31..4001 * 31], *alone.spectrum());
    }
}

#[test]
fn any_split_gives_the_same_bytes() {
    let case = Case::new(&builtin("munsell-vrhel"), Some((0.6, Bounds::Both)), 1.0);
    let stream = Stream::named(8, "floor");
    let (first, count) = ((1u64 << 32) - 5000, 10_007);
    let whole = stream.draws(first..first + count);
    let mut rng = Stream::new(9).rng();
    for engine in [cpu(), gpu()] {
        let mut pieces = Rows { spectra: Vec::new(), statuses: Vec::new() };
        let mut next = 0;
        while next < count {
            let piece = (1 + u64::from(rng.next_u32() % 3000)).min(count - next);
            let rows = rows(engine, &case.recipe, stream.draws(first + next..first + next + piece));
            pieces.spectra.extend(rows.spectra);
            pieces.statuses.extend(rows.statuses);
            next += piece;
        }
        assert!(rows(engine, &case.recipe, whole) == pieces, "{engine}: the pieces differ from the whole");
    }
}

/// The tolerance for adapters that fuse, tried where none is at hand: the f64 oracle rounds elsewhere too, and
/// must pass; a value that is off by a little more must not, nor must one draw in 1,000 that took another candidate.
#[test]
fn the_tolerance_for_hardware_is_neither_tight_nor_loose() {
    let targets = [None, Some((0.6, Bounds::Base)), Some((0.2, Bounds::Scaled))];
    for case in targets.map(|target| Case::new(&builtin("munsell-vrhel"), target, 1.0)) {
        let draws = Stream::new(10).draws(0..20_000);
        let ours = rows(cpu(), &case.recipe, draws);
        let (spectra, statuses): (Vec<_>, Vec<_>) = (0..draws.count)
            .map(|i| case.recipe.draw::<f64>(draws.stream, i))
            .map(|drawn| (drawn.spectrum().to_vec(), drawn.status()))
            .unzip();
        let oracle = Rows { spectra: spectra.concat().iter().map(|&s| s as f32).collect(), statuses };
        assert_eq!(compare(&case, draws, &ours, &oracle, false), Ok(()));
        let mut off = oracle.clone();
        off.spectra[31] += (2.0 * ULPS * case.ulp(draws.stream, 1, off.statuses[1].attempts())) as f32;
        assert!(compare(&case, draws, &ours, &off, false).is_err());
        let mut flipped = oracle;
        flipped.statuses.rotate_left(1);
        assert!(compare(&case, draws, &ours, &flipped, false).is_err());
    }
}

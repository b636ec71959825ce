//! Metamers: random spectra that all have the responses that a sensor saw.
//!
//! Where rejection finds a spectrum within the recipe's attempts, that is the draw. For the others, hard colours, the most
//! probable valid spectrum stands in, from a small quadratic program in f64: the same on every engine. Colours that no
//! spectrum of the model has are told from them, and answered with the nearest that one has only on request.

mod answer;
mod colour;

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex};

use half::f16;
use rayon::ThreadPool;
use rayon::prelude::*;

pub use answer::{Answer, AnswerCounts, HardColours, MetamerError, UnreachableColours};
pub use colour::{ColourConversion, ColourSpace};

use crate::affine::Affine;
use crate::draw_status::DrawStatus;
use crate::engine::{Engine, EngineError, Session};
use crate::program::mode::mode;
use crate::program::{Output, Program, Source, Unit, feasibility};
use crate::quantity::{ArrayFormat, Dtype, Layout};
use crate::random::stream::{DrawRange, Draws};
use crate::recipe::Recipe;

/// Largest number of modes that are computed at once where nothing is drawn.
const WINDOW: usize = 1 << 14;

/// Numbers of draws, at first and at most, after which it is seen anew which colours are far.
const PARTS: [u64; 2] = [1 << 14, 1 << 17];

/// Distance, in units of the largest response to the model's mean, at which a colour is far from all that a spectrum has:
/// hundreds of times what single precision rounds.
const FAR: f64 = 1e-3;

/// Draws of a recipe that gives each of them responses, on an engine, with an answer for every colour.
///
/// ```
/// use spectroll::{Answer, Engine, EngineChoice, MetamerError, Metamers, Model, Recipe, Sensors, Stream};
///
/// let model = Model::builtin("munsell-vrhel")?;
/// let recipe = Recipe::builder(&model).given(Sensors::builtin("cie1931").expect("it is built in")).build()?;
/// let engine = Engine::new(&EngineChoice::Cpu)?;
/// let colours = [0.35, 0.30, 0.20, 0.35, 0.30, 0.20]; // of two draws, relative to white
/// Metamers::new(&engine, &recipe)?.draw(Stream::new(1).draws(0..2), &colours, |window| {
///     assert!(window.answers.iter().all(|answer| matches!(answer, Answer::Sampled { .. })));
///     Ok::<_, MetamerError>(())
/// })?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Metamers<'a> {
    session: Session<'a>,
    pool: Arc<ThreadPool>,
    answering: Answering<'a>,
}

/// Some draws, with all quantities of the recipe.
pub struct MetamerWindow<'a> {
    /// Range of the draws; of those of a list, their places in the list.
    pub draws: DrawRange,
    /// Answer to each draw's colour.
    pub answers: &'a [Answer],
    formats: &'a [ArrayFormat],
    arrays: Vec<Cow<'a, [u8]>>,
}

impl MetamerWindow<'_> {
    /// The formats of the arrays: the recipe's.
    pub fn formats(&self) -> &[ArrayFormat] {
        self.formats
    }

    /// The bytes of each array, in the order of the formats and in this machine's.
    pub fn arrays(&self) -> impl Iterator<Item = &[u8]> {
        self.arrays.iter().map(|bytes| &**bytes)
    }
}

/// Best spectrum that a colour has where none is drawn.
#[derive(Clone, Debug)]
struct Best {
    answer: Answer,
    /// The colour and the normals; none where there is no spectrum.
    inputs: Option<Vec<f64>>,
}

/// Colours that came up before, by their bits.
#[derive(Default)]
struct Known {
    best: HashMap<Vec<u32>, Best>,
    /// Those that are so far from all that a spectrum has that no rounding brings them near.
    far: HashSet<Vec<u32>>,
}

impl<'a> Metamers<'a> {
    /// Prepares to draw from a recipe that [gives](crate::RecipeBuilder::given) each draw responses.
    ///
    /// # Panics
    /// Where the recipe gives draws none, or has a layout other than rows.
    pub fn new(engine: &'a Engine, recipe: &'a Recipe) -> Result<Metamers<'a>, EngineError> {
        assert!(recipe.program().given > 0, "the recipe gives draws no responses");
        let rows = recipe.formats().iter().all(|format| format.layout == Layout::Rows);
        assert!(rows, "metamers come in rows");
        let answering = Answering {
            recipe,
            hard: HardColours::default(),
            unreachable: UnreachableColours::default(),
            free: recipe.free(),
            known: Mutex::default(),
        };
        Ok(Metamers { session: engine.session(recipe)?, pool: engine.pool()?, answering })
    }

    /// The responses to the mean of the model's spectra: one for each of the given sensors.
    pub fn mean(&self) -> Vec<f32> {
        self.answering.free.1.offset.iter().map(|&response| response as f32).collect()
    }

    /// Sets the answer to colours for which no candidate is accepted within the recipe's attempts
    /// ([`HardColours::Mode`]).
    pub fn hard(self, hard: HardColours) -> Self {
        Metamers { answering: Answering { hard, ..self.answering }, ..self }
    }

    /// Sets the answer to colours that no spectrum of the model has ([`UnreachableColours::Leave`]).
    pub fn unreachable(self, unreachable: UnreachableColours) -> Self {
        Metamers { answering: Answering { unreachable, ..self.answering }, ..self }
    }

    /// Draws spectra of these colours, n responses for each draw, and hands them to `sink` in order, window by window.
    /// Draw i depends on its index and its colour, and on no other draw.
    ///
    /// # Panics
    /// Where there are not n responses for each draw.
    pub fn draw<'d, E: From<EngineError> + From<MetamerError>>(
        &mut self,
        draws: impl Into<Draws<'d>>,
        colours: &'d [f32],
        mut sink: impl FnMut(MetamerWindow) -> Result<(), E>,
    ) -> Result<AnswerCounts, E> {
        let draws = draws.into();
        let (count, width) = (draws.count(), self.answering.recipe.program().given);
        assert_eq!(colours.len() as u64, width as u64 * count, "{width} responses for each of {count} draws");
        let mut counts = AnswerCounts::default();
        let mut start = 0;
        while start < count {
            let part = draws.part(start, start.clamp(PARTS[0], PARTS[1]).min(count - start));
            let colours = &colours[start as usize * width..][..part.count() as usize * width];
            counts += match self.answering.near(colours) {
                None => self.draw_all(part, colours, &mut sink)?,
                Some(near) => self.draw_some(part, &near, colours, &mut sink)?,
            };
            start += part.count();
        }
        Ok(counts)
    }

    fn draw_all<E: From<EngineError> + From<MetamerError>>(
        &mut self,
        draws: Draws,
        colours: &[f32],
        sink: &mut impl FnMut(MetamerWindow) -> Result<(), E>,
    ) -> Result<AnswerCounts, E> {
        let Metamers { session, pool, answering } = self;
        let (first, width) = (draws.range.first, answering.recipe.program().given);
        let mut counts = AnswerCounts::default();
        let formats = answering.recipe.formats();
        session.draw_given(draws, colours, |batch| -> Result<(), E> {
            let start = batch.draws.first.wrapping_sub(first) as usize;
            let colours = &colours[start * width..][..batch.draws.count as usize * width];
            let arrays = formats.iter().map(|format| Cow::Borrowed(batch.bytes(format.quantity))).collect();
            let (answers, arrays) =
                pool.install(|| answering.window(batch.statuses(), arrays, colours, &formats));
            counts.add(&answers);
            answering.check(&answers, colours, |number| draws.index((start + number) as u64))?;
            sink(MetamerWindow { draws: batch.draws, answers: &answers, formats: &formats, arrays })
        })?;
        Ok(counts)
    }

    /// Draws those of these numbers alone.
    fn draw_some<E: From<EngineError> + From<MetamerError>>(
        &mut self,
        draws: Draws,
        numbers: &[usize],
        colours: &[f32],
        sink: &mut impl FnMut(MetamerWindow) -> Result<(), E>,
    ) -> Result<AnswerCounts, E> {
        let Metamers { session, pool, answering } = self;
        let (count, width) = (draws.count(), answering.recipe.program().given);
        let formats = answering.recipe.formats();
        let mut arrays: Vec<Vec<u8>> =
            formats.iter().map(|format| vec![0; format.bytes(count) as usize]).collect();
        let mut statuses = vec![DrawStatus::FAILED; count as usize];
        let indices: Vec<u64> = numbers.iter().map(|&number| draws.index(number as u64)).collect();
        let given: Vec<f32> =
            numbers.iter().flat_map(|number| &colours[number * width..][..width]).copied().collect();
        if !numbers.is_empty() {
            session.draw_given(draws.range.stream.at(&indices), &given, |batch| -> Result<(), E> {
                let numbers = &numbers[batch.draws.first as usize..][..batch.draws.count as usize];
                for (&number, status) in numbers.iter().zip(batch.statuses()) {
                    statuses[number] = *status;
                }
                for (format, array) in formats.iter().zip(&mut arrays) {
                    let size = format.stride() * format.dtype.size();
                    let rows = batch.bytes(format.quantity).chunks_exact(size);
                    for (number, row) in numbers.iter().zip(rows) {
                        array[number * size..][..size].copy_from_slice(row);
                    }
                }
                Ok(())
            })?;
        }
        let arrays = arrays.into_iter().map(Cow::Owned).collect();
        let (answers, arrays) = pool.install(|| answering.window(&statuses, arrays, colours, &formats));
        answering.check(&answers, colours, |number| draws.index(number as u64))?;
        sink(MetamerWindow { draws: draws.range, answers: &answers, formats: &formats, arrays })?;
        let mut counts = AnswerCounts::default();
        counts.add(&answers);
        Ok(counts)
    }

    /// Computes the most probable valid spectrum of each colour, which takes no random numbers, and hands them to `sink` in
    /// order, window by window.
    ///
    /// # Panics
    /// Where there are not n responses for each colour.
    pub fn modes<E: From<EngineError> + From<MetamerError>>(
        &mut self,
        colours: &[f32],
        mut sink: impl FnMut(MetamerWindow) -> Result<(), E>,
    ) -> Result<AnswerCounts, E> {
        let Metamers { pool, answering, .. } = self;
        let width = answering.recipe.program().given;
        assert!(colours.len().is_multiple_of(width), "{width} responses for each colour");
        let formats = answering.recipe.formats();
        let mut counts = AnswerCounts::default();
        for (number, window) in colours.chunks(WINDOW * width).enumerate() {
            let count = window.len() / width;
            let mut arrays: Vec<Cow<[u8]>> =
                formats.iter().map(|format| vec![0; format.bytes(count as u64) as usize].into()).collect();
            let wanted: Vec<usize> = (0..count).collect();
            let mut answers = vec![Answer::Skipped; count];
            let hard = HardColours::Mode;
            pool.install(|| answering.fill(hard, &wanted, window, &formats, &mut arrays, &mut answers));
            counts.add(&answers);
            let draws = DrawRange {
                stream: crate::random::stream::Stream::new(0),
                first: (number * WINDOW) as u64,
                count: count as u64,
            };
            sink(MetamerWindow { draws, answers: &answers, formats: &formats, arrays })?;
        }
        Ok(counts)
    }
}

/// Answers to colours, apart from the session that draws.
struct Answering<'a> {
    recipe: &'a Recipe,
    hard: HardColours,
    unreachable: UnreachableColours,
    /// The model's own Gaussian, without responses given, and the map of the responses.
    free: (Program, Affine),
    known: Mutex<Known>,
}

impl Answering<'_> {
    /// Numbers of the colours that are not known to be far from all that a spectrum has; `None` where none is. No candidate
    /// of those that are is ever accepted, so that looking for one takes all attempts; pictures are full of one such
    /// colour, as white paper is.
    fn near(&self, colours: &[f32]) -> Option<Vec<usize>> {
        let known = self.known.lock().expect("no holder panics");
        if known.far.is_empty() {
            return None;
        }
        let all = colours.chunks_exact(self.recipe.program().given).enumerate();
        let near = all.filter(|(_, colour)| !known.far.contains(bits(colour)));
        let near: Vec<usize> = near.map(|(number, _)| number).collect();
        Some(near).filter(|near| near.len() * self.recipe.program().given < colours.len())
    }

    /// Answers and arrays of some draws: those that were drawn, and what stands in for the others.
    fn window<'b>(
        &self,
        statuses: &[DrawStatus],
        mut arrays: Vec<Cow<'b, [u8]>>,
        colours: &[f32],
        formats: &[ArrayFormat],
    ) -> (Vec<Answer>, Vec<Cow<'b, [u8]>>) {
        let mut answers: Vec<Answer> = statuses
            .iter()
            .map(|status| match status.attempts() {
                0 => Answer::Skipped,
                attempts => Answer::Sampled { attempts },
            })
            .collect();
        let hard: Vec<usize> = (0..answers.len()).filter(|&i| answers[i] == Answer::Skipped).collect();
        if !hard.is_empty() {
            self.fill(self.hard, &hard, colours, formats, &mut arrays, &mut answers);
        }
        (answers, arrays)
    }

    /// Answers the colours of some draws with their best spectra.
    fn fill(
        &self,
        hard: HardColours,
        wanted: &[usize],
        colours: &[f32],
        formats: &[ArrayFormat],
        arrays: &mut [Cow<[u8]>],
        answers: &mut [Answer],
    ) {
        let program = self.recipe.program();
        let width = program.given;
        let best: Vec<Best> =
            wanted.par_iter().map(|&number| self.best(hard, &colours[number * width..][..width])).collect();
        for (&number, best) in wanted.iter().zip(&best) {
            answers[number] = best.answer;
        }
        for (format, array) in formats.iter().zip(arrays) {
            let output = program.outputs.iter().find(|output| output.format.quantity == format.quantity);
            // Statuses stay what they are: the engine adds them, where the recipe does not.
            let Some(output) = output.filter(|output| output.source != Source::Status) else { continue };
            let size = format.stride() * format.dtype.size();
            let array = array.to_mut();
            for (&number, best) in wanted.iter().zip(&best) {
                let Some(inputs) = &best.inputs else { continue };
                let row = &mut array[number * size..][..size];
                put(row, format.dtype, &values(program, output, inputs), program);
            }
        }
    }

    /// The best spectrum of a colour, where hard colours have one.
    fn best(&self, hard: HardColours, colour: &[f32]) -> Best {
        let best = self.known(colour);
        match (best.answer, hard) {
            (Answer::Mode, HardColours::Skip | HardColours::Error) => {
                Best { answer: Answer::Skipped, inputs: None }
            }
            _ => best,
        }
    }

    /// The best spectrum of a colour, which is found once.
    fn known(&self, colour: &[f32]) -> Best {
        let bits = bits(colour);
        if let Some(best) = self.known.lock().expect("no holder panics").best.get(bits) {
            return best.clone();
        }
        let colour: Vec<f64> = colour.iter().map(|&value| value.into()).collect();
        let (best, is_far) = self.found(&colour);
        let mut known = self.known.lock().expect("no holder panics");
        if known.best.len() >= 1 << 20 {
            *known = Known::default();
        }
        known.best.insert(bits.to_vec(), best.clone());
        if is_far {
            known.far.insert(bits.to_vec());
        }
        best
    }

    /// The best spectrum of a colour, and whether the colour is far from all that a spectrum has.
    fn found(&self, colour: &[f64]) -> (Best, bool) {
        let program = self.recipe.program();
        let inputs = |colour: &[f64], normals: Vec<f64>| Some([colour.to_vec(), normals].concat());
        if let Some(normals) = mode(&program.at(colour)) {
            return (Best { answer: Answer::Mode, inputs: inputs(colour, normals) }, false);
        }
        let nearest = feasibility::nearest(&self.free.0, &self.free.1, colour);
        let mean = self.free.1.offset.iter().fold(0.0, |largest: f64, response| largest.max(response.abs()));
        let is_far = nearest.as_ref().is_some_and(|nearest| distance(nearest, colour) > FAR * mean);
        let nothing = (Best { answer: Answer::Unreachable, inputs: None }, is_far);
        if self.unreachable == UnreachableColours::Leave {
            return nothing;
        }
        let Some((near, normals)) = nearest.and_then(|nearest| self.within(&nearest)) else { return nothing };
        let answer = Answer::Nearest { distance: distance(&near, colour) as f32 };
        (Best { answer, inputs: inputs(&near, normals) }, is_far)
    }

    /// The colour that a spectrum has next to the nearest, and the normals of its most probable one. The very nearest leave
    /// no room for a spectrum, so this is as little of the way from there to the mean's as it takes.
    fn within(&self, nearest: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let mean = &self.free.1.offset;
        let steps = std::iter::once(0.0).chain((0..24).map(|doublings| 1e-6 * f64::from(1 << doublings)));
        steps.take_while(|&part| part < 1.0).find_map(|part| {
            let inwards: Vec<f64> =
                nearest.iter().zip(mean).map(|(near, mean)| near + part * (mean - near)).collect();
            let normals = mode(&self.recipe.program().at(&inwards))?;
            Some((inwards, normals))
        })
    }

    /// The error of the first colour that is to be one.
    fn check(
        &self,
        answers: &[Answer],
        colours: &[f32],
        index: impl Fn(usize) -> u64,
    ) -> Result<(), MetamerError> {
        if self.hard != HardColours::Error {
            return Ok(());
        }
        let is_wrong = |answer: &Answer| matches!(answer, Answer::Skipped | Answer::Unreachable);
        let Some(number) = answers.iter().position(is_wrong) else { return Ok(()) };
        let width = self.recipe.program().given;
        let colour = colours[number * width..][..width].to_vec();
        let (index, attempts) = (index(number), self.recipe.program().max_attempts);
        Err(match answers[number] {
            Answer::Unreachable => MetamerError::Unreachable { index, colour },
            _ => MetamerError::Hard { index, colour, attempts },
        })
    }
}

fn bits(colour: &[f32]) -> &[u32] {
    bytemuck::cast_slice(colour)
}

/// Largest difference of two colours in a response.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The values of an output, of the colour and the normals.
fn values(program: &Program, output: &Output, inputs: &[f64]) -> Vec<f64> {
    let of = |map: &Affine| map.at(inputs).offset;
    match &output.source {
        Source::Spectrum => of(&program.spectrum),
        Source::Map(map, Unit::Over(over)) => {
            let unit = of(over)[0];
            of(map).into_iter().map(|value| value / unit).collect()
        }
        Source::Map(map, Unit::One | Unit::Scale) => of(map),
        Source::Intensity | Source::TargetLrv | Source::Status => {
            unreachable!("draws that are given responses have none")
        }
    }
}

/// Puts the values of a row into an array.
fn put(row: &mut [u8], dtype: Dtype, values: &[f64], program: &Program) {
    match dtype {
        Dtype::F16 => {
            let [least, largest] = program.value_range().halves();
            for (to, value) in row.chunks_exact_mut(2).zip(values) {
                let half = f16::from_f32((*value as f32).clamp(least, largest));
                to.copy_from_slice(&half.to_ne_bytes());
            }
        }
        _ => {
            for (to, value) in row.chunks_exact_mut(4).zip(values) {
                to.copy_from_slice(&(*value as f32).to_ne_bytes());
            }
        }
    }
}

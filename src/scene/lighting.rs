//! Surfaces under the lights of their own scene: responses of sensors, and color signals.
//!
//! A light is linear in its weights, and a reflectance in its own, so a response to the light that a surface reflects is
//! bilinear in the two: (1, a) T (1, w), with a small table T for each sensor that is folded once, in f64. For each light of
//! a scene (1, a) T is one vector, and each surface costs a product with it, whatever the number of bands.

use rayon::prelude::*;

use crate::affine::Affine;
use crate::dataset::SpectrumKind;
use crate::grid::Grid;
use crate::model::Model;
use crate::quantity::Quantity;
use crate::sensors::ResponseScale;

use super::error::{Fault, SceneErrorKind};
use super::group::Group;
use super::plan::{GroupPlan, Shapes};
use super::session::{Columns, SharedSpectra};

/// Number of f64 that are summed side by side.
const LANES: usize = 4;

/// Light of a group on the surfaces of another.
pub(super) struct Lighting {
    /// Name of the group of lights.
    pub(super) lights: String,
    /// Factor of all its lights.
    factor: f64,
    /// Mean of the lights, and their components: rows of a value for each band.
    light: Vec<Vec<f64>>,
    /// Each sensor's function times the widths of the bands; none where no responses are asked for.
    sensors: Vec<Vec<f64>>,
    /// Responses to a perfect white under the mean of the lights and under each component, for each sensor, where responses
    /// are relative to it.
    whites: Option<Vec<Vec<f64>>>,
    /// T of each sensor, a row for each row of `light`, of surfaces that are drawn from a model.
    tables: Vec<Vec<Vec<f64>>>,
}

/// Lights of some scenes.
struct Lights<'a> {
    weights: &'a [f32],
    is_shared: bool,
    /// Intensities that vary; none where they do not.
    levels: &'a [f32],
    count: usize,
}

/// Values of some scenes' elements, that responses are linear in: weights or bands.
struct Elements<'a> {
    values: &'a [f32],
    is_shared: bool,
    count: usize,
}

/// Plans what is seen under lights, once every group has its plan.
pub(super) fn plan(plans: &mut [GroupPlan], groups: &[Group], grid: &Grid) -> Result<(), Fault> {
    for (number, group) in groups.iter().enumerate() {
        let Some(under) = &group.base().viewing.under else { continue };
        let lights = plans.iter().find(|plan| plan.name == *under).expect("the lights were looked for");
        let model = lights.model.as_ref().expect("lights are drawn from a model");
        let is_drawn = !matches!(plans[number].shapes, Shapes::Target(_));
        let surfaces = plans[number].model.clone().filter(|_| is_drawn);
        let factor = lights.fixed_intensity.map_or(1.0, f64::from);
        let lighting = Lighting::new(group, (model, factor), surfaces.as_ref(), grid);
        let fault = |problem| Fault::of_group(number, "sensors", problem);
        plans[number].lighting = Some(lighting.map_err(fault)?);
    }
    Ok(())
}

/// The mean of a model's spectra and its components, a row each.
fn rows(model: &Model) -> Vec<Vec<f64>> {
    let parts = model.parts();
    let basis = parts.basis.row_iter().map(|row| row.iter().copied().collect());
    std::iter::once(parts.mean.iter().copied().collect()).chain(basis).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Lighting {
    fn new(
        group: &Group,
        (lights, factor): (&Model, f64),
        surfaces: Option<&Model>,
        grid: &Grid,
    ) -> Result<Lighting, SceneErrorKind> {
        debug_assert_eq!(lights.kind(), SpectrumKind::Illuminant);
        let base = group.base();
        let viewing = &base.viewing;
        let wanted = viewing.sensors.as_ref().filter(|_| base.wants(Quantity::Responses));
        let sensors = wanted.map(|sensors| sensors.emitted_weights(grid)).transpose()?.unwrap_or_default();
        let light = rows(lights);
        let seen = |row: &[f64]| -> Vec<Vec<f64>> {
            sensors.iter().map(|sensor| row.iter().zip(sensor).map(|(e, s)| e * s).collect()).collect()
        };
        // Of each row of the light, for each sensor, what falls on each band counts.
        let falls: Vec<Vec<Vec<f64>>> = light.iter().map(|row| seen(row)).collect();
        let whites = (viewing.response_scale == Some(ResponseScale::White)).then(|| {
            let of = |sensor: usize| falls.iter().map(|row| row[sensor].iter().sum()).collect();
            (0..sensors.len()).map(of).collect()
        });
        let surfaces = surfaces.map(rows).unwrap_or_default();
        let row = |falls: &[f64]| surfaces.iter().map(|surface| dot(falls, surface)).collect();
        let table = |sensor: usize| falls.iter().map(|of| row(&of[sensor])).collect();
        let tables = if surfaces.is_empty() { Vec::new() } else { (0..sensors.len()).map(table).collect() };
        let name = viewing.under.clone().expect("there are lights");
        Ok(Lighting { lights: name, factor, light, sensors, whites, tables })
    }

    /// Adds to the columns of a group what is seen of it under the columns of its lights, in a number of scenes. Works in
    /// the rayon pool that it is called in.
    pub(super) fn add<'a>(
        &self,
        (plan, columns, once): (&GroupPlan, &mut Columns<'a>, Option<&SharedSpectra>),
        (lights, light_columns, light_once): (&GroupPlan, &Columns, Option<&SharedSpectra>),
        scenes: usize,
    ) {
        let (count, light_count) = (plan.count as usize, lights.count as usize);
        let is_drawn = !matches!(plan.shapes, Shapes::Target(_));
        if plan.gives(Quantity::Responses) {
            let (weights, is_shared) = light_columns.or_shared(light_once, Quantity::Weights);
            let levels = if lights.intensity.is_some() { light_columns.of(Quantity::Intensity) } else { &[] };
            let all = Lights { weights, is_shared, levels, count: light_count };
            let quantity = if is_drawn { Quantity::Weights } else { Quantity::Spectra };
            let (values, is_shared) = columns.or_shared(once, quantity);
            let responses = self.responses(&all, &Elements { values, is_shared, count }, scenes);
            columns.push(Quantity::Responses, responses);
        }
        if plan.gives(Quantity::ColorSignal) {
            let (values, is_shared) = light_columns.or_shared(light_once, Quantity::Spectra);
            let lights = Elements { values, is_shared, count: light_count };
            let (values, is_shared) = columns.or_shared(once, Quantity::Spectra);
            let signals = self.color_signals(&lights, &Elements { values, is_shared, count }, scenes);
            columns.push(Quantity::ColorSignal, signals);
        }
    }

    /// Responses, by scene, light, element and sensor.
    fn responses(&self, lights: &Lights, elements: &Elements, scenes: usize) -> Vec<f32> {
        let (each, sensors) = (lights.count * elements.count * self.sensors.len(), self.sensors.len());
        let mut responses = vec![0.0; scenes * each];
        responses.par_chunks_exact_mut(each).enumerate().for_each(|(scene, responses)| {
            let map = self.map(lights, scene, scenes);
            let all = elements.of(scene, scenes).enumerate();
            let mut take = |number: usize, sums: &[f64]| {
                for (light, sums) in sums.chunks_exact(sensors).take(lights.count).enumerate() {
                    let at = (light * elements.count + number) * sensors;
                    responses[at..at + sensors].iter_mut().zip(sums).for_each(|(to, sum)| *to = *sum as f32);
                }
            };
            match map.offset.len() {
                4 => in_registers::<4>(&map, all, &mut take),
                8 => in_registers::<8>(&map, all, &mut take),
                12 => in_registers::<12>(&map, all, &mut take),
                16 => in_registers::<16>(&map, all, &mut take),
                _ => in_memory(&map, all, &mut take),
            }
        });
        responses
    }

    /// Map from an element's values to its responses under each light of a scene, sensor by sensor; with zeros up to whole
    /// lanes.
    fn map(&self, lights: &Lights, scene: usize, scenes: usize) -> Affine {
        let sensors = self.sensors.len();
        let inputs = match self.tables.first() {
            Some(table) => table[0].len() - 1,
            None => self.light[0].len(),
        };
        let wide = (lights.count * sensors).next_multiple_of(LANES);
        let mut map = Affine { offset: vec![0.0; wide], gain: vec![vec![0.0; wide]; inputs] };
        for number in 0..lights.count {
            let weights = lights.weights_of(scene, number, scenes, self.factor);
            let power: Vec<f64> = match self.tables.is_empty() {
                true => (0..inputs)
                    .map(|band| weights.iter().zip(&self.light).map(|(weight, row)| weight * row[band]).sum())
                    .collect(),
                false => Vec::new(),
            };
            for sensor in 0..sensors {
                let at = number * sensors + sensor;
                let white = self.whites.as_ref().map_or(1.0, |whites| dot(&weights, &whites[sensor]));
                match self.tables.get(sensor) {
                    Some(table) => {
                        let value = |column: usize| {
                            weights.iter().zip(table).map(|(weight, row)| weight * row[column]).sum::<f64>()
                                / white
                        };
                        map.offset[at] = value(0);
                        map.gain.iter_mut().enumerate().for_each(|(i, gain)| gain[at] = value(1 + i));
                    }
                    None => {
                        let values = power.iter().zip(&self.sensors[sensor]);
                        let gains = map.gain.iter_mut().zip(values);
                        gains.for_each(|(gain, (power, sensor))| gain[at] = power * sensor / white);
                    }
                }
            }
        }
        map
    }

    /// Products of each light and each element, by scene, light, element and band.
    fn color_signals(&self, lights: &Elements, elements: &Elements, scenes: usize) -> Vec<f32> {
        let bands = self.light[0].len();
        let mut signals = vec![0.0; scenes * lights.count * elements.count * bands];
        let each = lights.count * elements.count * bands;
        signals.par_chunks_exact_mut(each).enumerate().for_each(|(scene, signals)| {
            let all = lights.of(scene, scenes).zip(signals.chunks_exact_mut(elements.count * bands));
            for (light, signals) in all {
                for (element, signal) in elements.of(scene, scenes).zip(signals.chunks_exact_mut(bands)) {
                    let products = light.iter().zip(element).map(|(light, value)| light * value);
                    signal.iter_mut().zip(products).for_each(|(to, product)| *to = product);
                }
            }
        });
        signals
    }
}

/// Applies a map of so few values that their sums stay in registers, in the order of its inputs.
fn in_registers<'a, const W: usize>(
    map: &Affine,
    elements: impl Iterator<Item = (usize, &'a [f32])>,
    take: &mut impl FnMut(usize, &[f64]),
) {
    let row = |values: &[f64]| -> [f64; W] { values.try_into().expect("the map is as wide") };
    let offset = row(&map.offset);
    let gains: Vec<[f64; W]> = map.gain.iter().map(|gain| row(gain)).collect();
    for (number, element) in elements {
        let mut sums = offset;
        for (value, gain) in element.iter().zip(&gains) {
            let value = f64::from(*value);
            for lane in 0..W {
                sums[lane] += value * gain[lane];
            }
        }
        take(number, &sums);
    }
}

/// Applies a map of any number of values in the same order.
fn in_memory<'a>(
    map: &Affine,
    elements: impl Iterator<Item = (usize, &'a [f32])>,
    take: &mut impl FnMut(usize, &[f64]),
) {
    let mut sums = map.offset.clone();
    for (number, element) in elements {
        sums.copy_from_slice(&map.offset);
        for (value, gain) in element.iter().zip(&map.gain) {
            let value = f64::from(*value);
            sums.iter_mut().zip(gain).for_each(|(sum, gain)| *sum += value * gain);
        }
        take(number, &sums);
    }
}

impl Lights<'_> {
    /// (1, a) of a light, times its intensity.
    fn weights_of(&self, scene: usize, number: usize, scenes: usize, factor: f64) -> Vec<f64> {
        let sets = if self.is_shared { 1 } else { scenes };
        let width = self.weights.len() / (sets * self.count);
        let row = if self.is_shared { number } else { scene * self.count + number };
        let weights = &self.weights[row * width..][..width];
        let level = match self.levels.len() {
            0 => factor,
            all => {
                f64::from(self.levels[(scene * self.count + number) * all / (scenes * self.count)]) * factor
            }
        };
        std::iter::once(level).chain(weights.iter().map(|weight| level * f64::from(*weight))).collect()
    }
}

impl<'a> Elements<'a> {
    /// The elements of a scene.
    fn of(&self, scene: usize, scenes: usize) -> impl Iterator<Item = &'a [f32]> + use<'a> {
        let sets = if self.is_shared { 1 } else { scenes };
        let width = self.values.len() / (sets * self.count);
        let row = if self.is_shared { 0 } else { scene * self.count };
        self.values[row * width..][..self.count * width].chunks_exact(width)
    }
}

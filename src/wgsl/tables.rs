//! The numbers that a shader reads from a buffer, and where each lies in it: the model, for programs that run in
//! loops, and the levels that an intensity is one of.

use super::Form;
use crate::affine::Affine;
use crate::program::{IntensityLaw, Program, Source, Unit};

#[derive(Default)]
pub(crate) struct Tables {
    pub(crate) values: Vec<f32>,
    /// The row (of an offset and k gains) that each output's map starts at.
    pub(super) maps: Vec<usize>,
    /// The row that each output's unit is over.
    pub(super) units: Vec<usize>,
    /// Offset of the bands' LRV weights.
    pub(super) lrv_weights: usize,
    /// Offset of the levels.
    pub(super) levels: usize,
}

impl Tables {
    pub(crate) fn new(program: &Program) -> Tables {
        let mut tables = Tables::default();
        if Form::of(program) == Form::Looped {
            tables.push_rows(&program.spectrum);
            for output in &program.outputs {
                let (map, unit) = match &output.source {
                    Source::Map(map, unit) => (Some(map), Some(unit)),
                    _ => (None, None),
                };
                let start = map.map_or(0, |map| tables.push_rows(map));
                tables.maps.push(start);
                let over = match unit {
                    Some(Unit::Over(map)) => tables.push_rows(map),
                    _ => 0,
                };
                tables.units.push(over);
            }
            tables.lrv_weights = tables.values.len();
            tables.values.extend(program.target.iter().flat_map(|t| &t.weights).map(|&w| w as f32));
        }
        tables.levels = tables.values.len();
        if let Some(IntensityLaw::OneOf(levels)) = &program.intensity {
            tables.values.extend(levels.iter().map(|&level| level as f32));
        }
        tables
    }

    /// Appends a row for each value of a map. Returns the number of the first.
    fn push_rows(&mut self, map: &Affine) -> usize {
        let start = self.values.len() / (map.gain.len() + 1);
        for (row, offset) in map.offset.iter().enumerate() {
            self.values.push(*offset as f32);
            self.values.extend(map.gain.iter().map(|gain| gain[row] as f32));
        }
        start
    }
}

//! Metamers of colours as a data set: a row for each colour of a table, or for each row of an image's pixels.

use std::io;
use std::ops::{ControlFlow, Range};

use serde_json::{Map, Value, json};

use super::provenance::{Sum, model_sum, shader_sum};
use super::{Companions, ExportError, Output, Rows, Window, Writing};
use crate::engine::{Engine, EngineError};
use crate::metamers::{AnswerCounts, HardColours, MetamerError, Metamers, UnreachableColours};
use crate::output::{Field, LrvLabel, Schema, SharedArray};
use crate::quantity::{Dtype, Quantity};
use crate::random::stream::Stream;
use crate::recipe::Recipe;

/// Approximate number of spectra that are drawn at once.
const BLOCK: u64 = 1 << 16;

/// The most colours without a spectrum of their own that are remembered to be listed.
const LISTED: usize = 1000;

/// Colours to be answered, as responses of the recipe's given sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Colours {
    /// Responses, colour by colour, and row by row of an image.
    pub responses: Vec<f32>,
    /// Shape of the colours.
    pub shape: ColourShape,
}

/// Shape of colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourShape {
    /// A list of them.
    List,
    /// A part of the pixels of an image.
    Image {
        /// Number of columns of the whole image, on which draws depend.
        full_width: u64,
        /// First column of the part.
        left: u64,
        /// First row of the part.
        top: u64,
        /// Number of columns of the part.
        width: u64,
    },
}

/// Metamers of colours that are to be written.
///
/// Draw m of a colour j of a list, or of the pixel (x, y) of a whole image, has an index of its own, which does not depend
/// on the other colours, on how many draws each has in a list, or on which part of the image is drawn.
#[derive(Clone, Debug)]
pub struct MetamerExport<'a> {
    recipe: &'a Recipe,
    colours: &'a Colours,
    /// Number of draws of each colour, which have an axis of their own where there are several; 0 for the most probable
    /// spectrum alone.
    each: u64,
    seed: u64,
    hard: HardColours,
    unreachable: UnreachableColours,
    model: String,
    source: String,
}

impl<'a> MetamerExport<'a> {
    /// An export of metamers of colours: `each` of every one, or where that is 0 the most probable spectrum.
    ///
    /// # Panics
    /// Where the recipe gives draws no responses, or there are not as many colours as their shape says.
    pub fn new(recipe: &'a Recipe, colours: &'a Colours, each: u64) -> MetamerExport<'a> {
        let given = recipe.program().given;
        assert!(given > 0 && colours.responses.len().is_multiple_of(given), "whole colours");
        if let ColourShape::Image { width, .. } = colours.shape {
            assert!((colours.responses.len() / given).is_multiple_of(width as usize), "whole rows of pixels");
        }
        MetamerExport {
            recipe,
            colours,
            each,
            seed: 0,
            hard: HardColours::default(),
            unreachable: UnreachableColours::default(),
            model: String::new(),
            source: String::new(),
        }
    }

    /// Sets the seed (0).
    pub fn seed(self, seed: u64) -> Self {
        MetamerExport { seed, ..self }
    }

    /// Sets the answers to hard and to unreachable colours.
    pub fn answers(self, hard: HardColours, unreachable: UnreachableColours) -> Self {
        MetamerExport { hard, unreachable, ..self }
    }

    /// Sets the names of the model and of the colours' source, which the data set records.
    pub fn names(self, model: &str, source: &str) -> Self {
        MetamerExport { model: model.to_owned(), source: source.to_owned(), ..self }
    }

    /// Number of responses of each colour.
    pub fn given(&self) -> usize {
        self.recipe.program().given
    }

    /// Number of colours in a row of the data set.
    fn row(&self) -> u64 {
        match self.colours.shape {
            ColourShape::List => 1,
            ColourShape::Image { width, .. } => width,
        }
    }

    /// Number of rows of the data set.
    fn count(&self) -> u64 {
        (self.colours.responses.len() / self.recipe.program().given) as u64 / self.row()
    }

    /// Schema of the data set: spectra and whatever else the recipe asks for, the kind of answer to each colour, the
    /// distance of answers that are not exact, and the responses themselves.
    pub fn schema(&self, output: &Output) -> Schema {
        let each = (self.each > 1).then_some(("metamer", self.each as usize));
        let columns = match self.colours.shape {
            ColourShape::Image { width, .. } => Some(("column", width as usize)),
            ColourShape::List => None,
        };
        let repeated = |field: Field, axes: &[Option<(&str, usize)>]| {
            axes.iter().flatten().fold(field, |field, (name, count)| field.repeated(name, *count))
        };
        let formats = self.recipe.formats().into_iter().filter(|f| f.quantity != Quantity::Attempts);
        let mut fields: Vec<Field> = formats
            .map(|format| {
                let field = match format.quantity.axis() {
                    Some(axis) => Field::vector(format.quantity.name(), axis, format.width, format.dtype)
                        .with_channels(&self.recipe.channels(format.quantity)),
                    None => Field::scalar(format.quantity.name(), format.dtype),
                };
                let field = match format.quantity {
                    Quantity::Spectra => field.within(self.recipe.value_range()),
                    _ => field,
                };
                repeated(field, &[each, columns]).stored_as(output.stored(format.quantity))
            })
            .collect();
        fields.push(repeated(Field::scalar("status", Dtype::U32), &[each, columns]));
        if self.unreachable == UnreachableColours::Nearest {
            fields.push(repeated(Field::scalar("distance", Dtype::F32), &[each, columns]));
        }
        let given = self.recipe.settings().given.as_ref().expect("the recipe gives draws responses");
        let colours = Field::vector("colours", "given", given.len(), Dtype::F32);
        fields.push(repeated(colours.with_channels(given.channels()), &[columns]));
        Schema {
            fields,
            row: match self.colours.shape {
                ColourShape::List => "colour".to_owned(),
                ColourShape::Image { .. } => "row".to_owned(),
            },
            shared: Vec::new(),
            count: self.count(),
            wavelengths: self.recipe.model().grid().wavelengths().collect(),
            attributes: self.attributes(),
        }
    }

    /// Files beside the rows.
    pub fn companions(&self) -> Companions {
        Companions::of_recipe(self.recipe, LrvLabel::None, 0)
    }

    /// Prepares the rows, to be drawn by an engine.
    pub fn rows(&self, engine: &'a Engine) -> Result<MetamerRows<'a>, EngineError> {
        let metamers = Metamers::new(engine, self.recipe)?.hard(self.hard).unreachable(self.unreachable);
        let export = self.clone();
        Ok(MetamerRows { export, metamers, counts: AnswerCounts::default(), unanswered: Vec::new() })
    }

    /// Draws and writes the whole data set.
    pub fn write(&self, engine: &'a Engine, output: &Output) -> Result<AnswerCounts, ExportError> {
        let (schema, companions) = (self.schema(output), self.companions());
        output.check(&schema, &companions)?;
        output.check_space(&schema, &companions)?;
        let mut rows = self.rows(engine)?;
        let writing = Writing::open(output, schema, &companions, engine, &mut rows)?;
        writing.run(&mut rows, &mut |_| ControlFlow::Continue(()))?;
        Ok(rows.counts)
    }

    fn attributes(&self) -> Map<String, Value> {
        let (shape, part) = match self.colours.shape {
            ColourShape::List => ("list", Value::Null),
            ColourShape::Image { full_width, left, top, width } => {
                ("image", json!({ "full_width": full_width, "left": left, "top": top, "width": width }))
            }
        };
        let attributes = json!({
            "metamers_of": self.source,
            "shape": shape,
            "part": part,
            "each": self.each,
            "model": self.model,
            "model_blake3": model_sum(self.recipe.model()),
            "kind": self.recipe.model().kind(),
            "recipe": self.recipe.settings(),
            "seed": self.seed,
            "hard": self.hard,
            "unreachable": self.unreachable,
            "status": "0 skipped, 1 sampled, 2 mode, 3 nearest, 4 unreachable",
            "program": concat!("spectroll ", env!("CARGO_PKG_VERSION")),
            "shader_blake3": shader_sum(self.recipe),
        });
        let Value::Object(attributes) = attributes else { unreachable!("it is written as one") };
        attributes
    }
}

/// Metamers as rows of a data set.
pub struct MetamerRows<'a> {
    export: MetamerExport<'a>,
    metamers: Metamers<'a>,
    /// Numbers of answers.
    pub counts: AnswerCounts,
    /// Numbers of the first colours, in their order, that were answered with no spectrum or with another colour's.
    pub unanswered: Vec<u64>,
}

impl MetamerRows<'_> {
    /// Indices of the draws of some colours: `each` of them for a colour.
    fn indices(&self, colours: Range<u64>, each: u64) -> (Stream, Vec<u64>) {
        let stream = Stream::new(self.export.seed);
        match self.export.colours.shape {
            ColourShape::List => {
                (stream.in_rows(each as u32), (colours.start * each..colours.end * each).collect())
            }
            ColourShape::Image { full_width, left, top, width } => {
                let row = full_width * each;
                let first = |colour: u64| (top + colour / width) * row + (left + colour % width) * each;
                let indices = colours.flat_map(|colour| first(colour)..first(colour) + each);
                (stream.in_rows(row as u32), indices.collect())
            }
        }
    }
}

impl Rows for MetamerRows<'_> {
    /// Sum of draws that no data set holds.
    fn rounding(&mut self) -> Result<String, EngineError> {
        let mut sum = Sum::default();
        let mean = self.metamers.mean();
        let colours = mean.repeat(4096);
        let drawn = self.metamers.draw(Stream::named(0, "rounding").draws(0..4096), &colours, |window| {
            window.arrays().for_each(|bytes| sum.update(bytes));
            Ok::<_, MetamerError>(())
        });
        match drawn {
            Ok(_) | Err(MetamerError::Hard { .. } | MetamerError::Unreachable { .. }) => Ok(sum.finish()),
            Err(MetamerError::Engine(error)) => Err(error),
        }
    }

    fn draw(&mut self, rows: Range<u64>, window: &mut Window) -> Result<(), ExportError> {
        let given = self.export.recipe.program().given;
        let (row, each) = (self.export.row(), self.export.each);
        let rows_at_once = (BLOCK / (row * each.max(1))).max(1);
        let mut start = rows.start;
        while start < rows.end {
            let end = rows.end.min(start + rows_at_once);
            let colours = start * row..end * row;
            let values =
                &self.export.colours.responses[colours.start as usize * given..colours.end as usize * given];
            let mut columns: Vec<Vec<u8>> = Vec::new();
            let (mut statuses, mut distances) = (Vec::new(), Vec::new());
            let mut unanswered = Vec::new();
            let mut take = |taken: &crate::metamers::MetamerWindow| {
                let arrays = taken.formats().iter().zip(taken.arrays());
                let arrays: Vec<&[u8]> = arrays
                    .filter(|(f, _)| f.quantity != Quantity::Attempts)
                    .map(|(_, bytes)| bytes)
                    .collect();
                columns.resize_with(arrays.len(), Vec::new);
                columns.iter_mut().zip(arrays).for_each(|(column, bytes)| column.extend_from_slice(bytes));
                for (number, answer) in taken.answers.iter().enumerate() {
                    if !matches!(answer.code(), 1 | 2) && unanswered.len() < LISTED {
                        unanswered.push(colours.start + (statuses.len() + number) as u64 / each.max(1));
                    }
                }
                statuses.extend(taken.answers.iter().map(|answer| answer.code()));
                distances.extend(taken.answers.iter().map(|answer| answer.distance()));
                Ok::<_, ExportError>(())
            };
            let counts = match each {
                0 => self.metamers.modes(values, |taken| take(&taken))?,
                _ => {
                    let (stream, indices) = self.indices(colours.clone(), each);
                    let repeated: Vec<f32> =
                        values.chunks_exact(given).flat_map(|colour| colour.repeat(each as usize)).collect();
                    self.metamers.draw(stream.at(&indices), &repeated, |taken| take(&taken))?
                }
            };
            self.counts += counts;
            unanswered.dedup();
            self.unanswered.extend(unanswered);
            self.unanswered.truncate(LISTED);
            let mut all: Vec<&[u8]> = columns.iter().map(Vec::as_slice).collect();
            all.push(bytemuck::cast_slice(&statuses));
            if self.export.unreachable == UnreachableColours::Nearest {
                all.push(bytemuck::cast_slice(&distances));
            }
            all.push(bytemuck::cast_slice(values));
            window(&all, end - start)?;
            start = end;
        }
        Ok(())
    }

    fn shared(&self, _: &[SharedArray]) -> io::Result<Vec<SharedArray>> {
        Ok(Vec::new())
    }
}

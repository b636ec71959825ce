//! Draws of a recipe as a data set: a row per draw, its quantities as columns.

use std::borrow::Cow;
use std::io;
use std::ops::{ControlFlow, Range};

use serde_json::{Map, Value, json};

use super::provenance::{Sum, model_sum, shader_sum};
use super::{Companions, ExportError, Output, Rows, Window, Writing};
use crate::engine::{Batch, DrawSummary, Engine, EngineError, Session};
use crate::output::{Field, LrvLabel, Schema, SharedArray};
use crate::quantity::{ArrayFormat, Quantity};
use crate::random::stream::{DrawRange, Stream};
use crate::recipe::{Lrv, Recipe};

/// Draws of a recipe that are to be written.
#[derive(Clone, Debug)]
pub struct DrawExport<'a> {
    recipe: &'a Recipe,
    draws: DrawRange,
    model: String,
    stream: Option<String>,
}

impl<'a> DrawExport<'a> {
    /// An export of `draws` of a recipe.
    pub fn new(recipe: &'a Recipe, draws: DrawRange) -> DrawExport<'a> {
        DrawExport { recipe, draws, model: String::new(), stream: None }
    }

    /// The name of the model, which the data set records.
    pub fn model_name(self, name: &str) -> Self {
        DrawExport { model: name.to_owned(), ..self }
    }

    /// The name that the draws' stream was made from, which the data set records so that it can be verified.
    pub fn stream_name(self, name: Option<&str>) -> Self {
        DrawExport { stream: name.map(str::to_owned), ..self }
    }

    /// Schema of the data set: its columns, and the model, recipe and seed of the draws.
    pub fn schema(&self, output: &Output) -> Schema {
        let fields = self.recipe.formats().into_iter();
        Schema {
            fields: fields
                .map(|format| field(self.recipe, format).stored_as(output.stored(format.quantity)))
                .collect(),
            row: "draw".to_owned(),
            shared: Vec::new(),
            count: self.draws.count,
            wavelengths: self.recipe.model().grid().wavelengths().collect(),
            attributes: self.attributes(),
        }
    }

    /// Files beside the rows.
    pub fn companions(&self) -> Companions {
        let lrv = match self.recipe.settings().lrv {
            Some(Lrv::Fixed(lrv)) => LrvLabel::Same(lrv),
            Some(Lrv::Uniform(..)) => LrvLabel::Field(Quantity::Lrv.name().to_owned()),
            None => LrvLabel::None,
        };
        Companions::of_recipe(self.recipe, lrv, self.draws.first)
    }

    /// Prepares the rows, to be drawn by an engine.
    pub fn rows(&self, engine: &'a Engine) -> Result<DrawRows<'a>, EngineError> {
        DrawRows::new(self.recipe, engine, self.draws)
    }

    /// Draws and writes the whole data set.
    pub fn write(&self, engine: &'a Engine, output: &Output) -> Result<DrawSummary, ExportError> {
        let (schema, companions) = (self.schema(output), self.companions());
        output.check(&schema, &companions)?;
        output.check_space(&schema, &companions)?;
        let mut rows = self.rows(engine)?;
        let writing = Writing::open(output, schema, &companions, engine, &mut rows)?;
        writing.run(&mut rows, &mut |_| ControlFlow::Continue(()))?;
        Ok(rows.summary)
    }

    fn attributes(&self) -> Map<String, Value> {
        let attributes = json!({
            "model": self.model,
            "model_blake3": model_sum(self.recipe.model()),
            "kind": self.recipe.model().kind(),
            "recipe": self.recipe.settings(),
            "seed": self.draws.stream.seed(),
            "stream": self.stream,
            "start": self.draws.first,
            "program": concat!("spectroll ", env!("CARGO_PKG_VERSION")),
            "shader_blake3": shader_sum(self.recipe),
        });
        let Value::Object(attributes) = attributes else { unreachable!("it is written as one") };
        attributes
    }
}

fn field(recipe: &Recipe, format: ArrayFormat) -> Field {
    let field = match format.quantity.axis() {
        Some(axis) => Field::vector(format.quantity.name(), axis, format.width, format.dtype)
            .with_channels(&recipe.channels(format.quantity)),
        None => Field::scalar(format.quantity.name(), format.dtype),
    };
    if format.quantity == Quantity::Spectra { field.within(recipe.value_range()) } else { field }
}

/// Draws of a recipe as rows of a data set.
pub struct DrawRows<'a> {
    recipe: &'a Recipe,
    session: Session<'a>,
    draws: DrawRange,
    /// Summary of the draws made.
    pub summary: DrawSummary,
}

impl<'a> DrawRows<'a> {
    /// Prepares the rows of a range of draws.
    pub fn new(
        recipe: &'a Recipe,
        engine: &'a Engine,
        draws: DrawRange,
    ) -> Result<DrawRows<'a>, EngineError> {
        Ok(DrawRows { recipe, session: engine.session(recipe)?, draws, summary: DrawSummary::default() })
    }
}

impl Rows for DrawRows<'_> {
    /// Sum of draws that no data set holds.
    fn rounding(&mut self) -> Result<String, EngineError> {
        let mut sum = Sum::default();
        self.session.draw(Stream::named(0, "rounding").draws(0..4096), |batch| {
            columns(self.recipe, &batch).iter().for_each(|column| sum.update(column));
            Ok::<_, EngineError>(())
        })?;
        Ok(sum.finish())
    }

    fn draw(&mut self, rows: Range<u64>, window: &mut Window) -> Result<(), ExportError> {
        let first = self.draws.first.wrapping_add(rows.start);
        let draws = DrawRange { first, count: rows.end - rows.start, ..self.draws };
        self.summary += self.session.draw(draws, |batch| {
            let columns = columns(self.recipe, &batch);
            window(&columns.iter().map(|column| &**column).collect::<Vec<_>>(), batch.draws.count)
        })?;
        Ok(())
    }

    fn shared(&self, _: &[SharedArray]) -> io::Result<Vec<SharedArray>> {
        Ok(Vec::new())
    }
}

/// Columns of a window: of statuses, the attempts.
fn columns<'a>(recipe: &Recipe, batch: &Batch<'a>) -> Vec<Cow<'a, [u8]>> {
    let column = |quantity| match quantity {
        Quantity::Attempts => batch
            .statuses()
            .iter()
            .flat_map(|status| status.attempts().to_ne_bytes())
            .collect::<Vec<_>>()
            .into(),
        _ => Cow::Borrowed(batch.bytes(quantity)),
    };
    recipe.formats().iter().map(|format| column(format.quantity)).collect()
}

//! Refusals, as the page shows them: the library's message, and the control that mends it.

use std::fmt;

use serde::Serialize;
use spectroll::{DatasetError, FitError, RecipeError, Remedy};
use wasm_bindgen::JsValue;

use crate::metamers::nearest;

/// A message of the library, and the control of the page that may mend what it says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Refusal {
    /// The message.
    pub message: String,
    /// Name of the control, as in its `id`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub control: Option<&'static str>,
    /// The nearest colour that can be drawn, as `#rrggbb`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nearest: Option<String>,
}

impl Refusal {
    /// A refusal without a control that mends it.
    pub(crate) fn new(error: impl fmt::Display) -> Refusal {
        Refusal { message: error.to_string(), control: None, nearest: None }
    }
}

impl Refusal {
    /// The refusal of a colour.
    pub(crate) fn of_colour(self) -> Refusal {
        Refusal { control: Some("colour"), ..self }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<Refusal> for JsValue {
    fn from(refusal: Refusal) -> JsValue {
        let text = serde_json::to_string(&refusal).expect("text is JSON");
        JsValue::from_str(&text)
    }
}

impl From<DatasetError> for Refusal {
    fn from(error: DatasetError) -> Refusal {
        let control = match &error {
            DatasetError::Ambiguous { .. } | DatasetError::NoVariable { .. } => Some("array"),
            _ => control(error.remedy()),
        };
        Refusal { control, ..Refusal::new(error) }
    }
}

impl From<RecipeError> for Refusal {
    fn from(error: RecipeError) -> Refusal {
        Refusal { nearest: nearest(&error), ..Refusal::new(error) }
    }
}

impl From<FitError> for Refusal {
    fn from(error: FitError) -> Refusal {
        let control = match &error {
            FitError::Unphysical(unphysical) => control(unphysical.remedy),
            FitError::NotReflectances { .. } => Some("percent"),
            FitError::TooFewSpectra { .. } | FitError::Rank { .. } => Some("components"),
            _ => None,
        };
        Refusal { control, ..Refusal::new(error) }
    }
}

/// The control of a setting that an error advises.
fn control(remedy: Remedy) -> Option<&'static str> {
    match remedy {
        Remedy::Scale(_) => Some("percent"),
        Remedy::Layout => Some("layout"),
        Remedy::MeasuredAt => Some("measured-at"),
        Remedy::Missing => Some("missing"),
        Remedy::MissingValue(_) => Some("missing-value"),
        Remedy::Unit(_) => Some("unit"),
        Remedy::Wavelengths => Some("wavelengths"),
        _ => None,
    }
}

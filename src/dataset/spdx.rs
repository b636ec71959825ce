//! IES TM-27 files (`.spdx`): the spectral distribution of one lamp, in XML.

use std::path::Path;

use nalgebra::DMatrix;

use super::reading::Reading;
use super::{DatasetError, SpectrumKind, Table};

/// Whether a text is one of these.
pub(super) fn begins(text: &str) -> bool {
    let head: String = text.chars().take(4096).collect();
    head.trim_start().starts_with('<') && head.contains("IESTM2714") || head.contains("<SpectralDistribution")
}

/// Reads the values of all elements `SpectralData`.
pub(super) fn read(path: &Path, text: &str) -> Result<Reading, DatasetError> {
    let failed = |reason: String| DatasetError::Format { path: path.to_owned(), format: "IES TM-27", reason };
    let (mut wavelengths, mut values) = (Vec::new(), Vec::new());
    for element in text.split("<SpectralData").skip(1) {
        let number = wavelengths.len() + 1;
        let wrong = || failed(format!("SpectralData number {number} has no wavelength and value"));
        let (attributes, rest) = element.split_once('>').ok_or_else(wrong)?;
        let (value, _) = rest.split_once('<').ok_or_else(wrong)?;
        let wavelength = attributes.split_once("wavelength").and_then(|(_, after)| {
            let after = after.trim_start().strip_prefix('=')?.trim_start();
            let quote = after.chars().next().filter(|c| ['"', '\''].contains(c))?;
            after[1..].split_once(quote)
        });
        let (wavelength, _) = wavelength.ok_or_else(wrong)?;
        wavelengths.push(wavelength.trim().parse().map_err(|_| wrong())?);
        values.push(value.trim().parse().map_err(|_| wrong())?);
    }
    if values.is_empty() {
        return Err(failed("it has no SpectralData".to_owned()));
    }
    let mut notes = Vec::new();
    if let Some((_, rest)) = text.split_once("<SpectralQuantity>")
        && let Some((quantity, _)) = rest.split_once('<')
    {
        notes.push(format!("the quantity is {:?}", quantity.trim()));
    }
    let is_reflectance = notes.iter().any(|note| note.to_lowercase().contains("reflectance"));
    let spectra = DMatrix::from_vec(values.len(), 1, values);
    let mut table = Table::from_measured(&format!("{path:?}"), wavelengths, spectra, &mut notes)?;
    table.kind = Some(if is_reflectance { SpectrumKind::Reflectance } else { SpectrumKind::Illuminant });
    Ok(Reading {
        table,
        format: "IES TM-27 (.spdx)".to_owned(),
        dialect: None,
        layout: "one spectrum".to_owned(),
        wavelengths: "the attribute wavelength of SpectralData, in nm".to_owned(),
        notes,
        others: Vec::new(),
    })
}

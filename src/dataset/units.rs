//! Units of wavelengths, and the words by which files name them.
//!
//! A unit that a file states, or that a user gives, is converted. One that only the values suggest is never applied: it
//! names the remedy of a refusal.

use std::fmt;

/// Unit of wavelengths, or of what stands for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[non_exhaustive]
pub enum WavelengthUnit {
    /// Nanometres.
    Nm,
    /// Micrometres.
    Um,
    /// Ångströms: 0.1 nm.
    Angstrom,
    /// Wavenumbers: waves per centimetre.
    #[cfg_attr(feature = "cli", value(name = "cm-1"))]
    PerCm,
}

impl WavelengthUnit {
    /// Name in messages and commands.
    pub fn name(self) -> &'static str {
        match self {
            WavelengthUnit::Nm => "nm",
            WavelengthUnit::Um => "um",
            WavelengthUnit::Angstrom => "angstrom",
            WavelengthUnit::PerCm => "cm-1",
        }
    }

    /// A value of this unit in nm.
    pub fn in_nm(self, value: f64) -> f64 {
        match self {
            WavelengthUnit::Nm => value,
            // A product with 1000 of 0.41 is 410 exactly where a quotient of a thousandth is not.
            WavelengthUnit::Um => tidy(value * 1000.0),
            WavelengthUnit::Angstrom => value / 10.0,
            WavelengthUnit::PerCm => 1e7 / value,
        }
    }

    /// The unit that a text names, as in "Wavelength (nm)", "Micrometers" or "cm^-1".
    pub(super) fn named_in(text: &str) -> Option<WavelengthUnit> {
        let lower = text.to_lowercase().replace('μ', "µ");
        if ["cm-1", "cm^-1", "cm⁻¹", "1/cm", "wavenumber", "cm**-1", "wellenzahl"]
            .iter()
            .any(|w| lower.contains(w))
        {
            return Some(WavelengthUnit::PerCm);
        }
        let is_word = |word: &str| words(&lower).any(|found| found == word);
        if ["nm", "nanometer", "nanometers", "nanometre", "nanometres", "nanomètres"]
            .iter()
            .any(|w| is_word(w))
        {
            return Some(WavelengthUnit::Nm);
        }
        let micro =
            ["um", "µm", "micrometer", "micrometers", "micrometre", "micrometres", "micron", "microns"];
        if micro.iter().any(|w| is_word(w)) {
            return Some(WavelengthUnit::Um);
        }
        let angstrom = ["angstrom", "angstroms", "ångström", "ångströms", "ångstrom", "å", "a.u. angstrom"];
        angstrom.iter().any(|w| is_word(w)).then_some(WavelengthUnit::Angstrom)
    }

    /// The unit in which values that are no wavelengths in nm may be: a guess, for messages.
    pub(super) fn guess(low: f64, high: f64) -> Option<WavelengthUnit> {
        let lies_in = |a: f64, b: f64| low >= a && high <= b;
        if lies_in(0.15, 60.0) && high > low {
            Some(WavelengthUnit::Um)
        } else if lies_in(1500.0, 12_000.0) {
            Some(WavelengthUnit::Angstrom)
        } else if lies_in(9_000.0, 60_000.0) {
            Some(WavelengthUnit::PerCm)
        } else {
            None
        }
    }
}

impl fmt::Display for WavelengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The value without the last bits that a product with a power of ten leaves: 0.41 um are 410 nm.
fn tidy(value: f64) -> f64 {
    let round = (value * 1e6).round() / 1e6;
    if (round - value).abs() <= 4.0 * f64::EPSILON * value.abs() { round } else { value }
}

/// Words of a text: letters and signs such as µ, without digits and punctuation.
pub(super) fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty())
}

/// Whether a heading is one of wavelengths.
pub(super) fn is_wavelength_word(text: &str) -> bool {
    const WORDS: [&str; 30] = [
        "wavelength",
        "wavelengths",
        "wavelen",
        "wl",
        "wls",
        "wvl",
        "wvls",
        "wave",
        "waves",
        "lambda",
        "lambdas",
        "λ",
        "lam",
        "nm",
        "nanometer",
        "nanometers",
        "nanometre",
        "nanometres",
        "wavenumber",
        "wavenumbers",
        "wellenlänge",
        "wellenlaenge",
        "wellenzahl",
        "onda",
        "onde",
        "golflengte",
        "um",
        "µm",
        "micrometers",
        "angstrom",
    ];
    let lower = text.to_lowercase().replace('μ', "µ");
    words(&lower).any(|word| WORDS.contains(&word))
}

/// Whether a heading is one of names or numbers of samples.
pub(super) fn is_id_word(text: &str) -> bool {
    const WORDS: [&str; 26] = [
        "id", "ids", "sample", "samples", "sampleid", "name", "names", "spectrum", "spectra", "no", "nr",
        "num", "number", "index", "idx", "label", "labels", "specimen", "scan", "file", "filename", "title",
        "material", "class", "patch", "probe",
    ];
    let lower = text.to_lowercase();
    lower.trim() == "#" || words(&lower).any(|word| WORDS.contains(&word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_found_in_headings() {
        use WavelengthUnit::{Angstrom, Nm, PerCm, Um};
        for (text, unit) in [
            ("Wavelength (nm)", Some(Nm)),
            ("wavelength_um", Some(Um)),
            ("Wavelength [µm]", Some(Um)),
            ("Wavelength [μm]", Some(Um)),
            ("Micrometers", Some(Um)),
            ("lambda/Å", Some(Angstrom)),
            ("wavenumber", Some(PerCm)),
            ("1/CM", Some(PerCm)),
            ("number", None),
            ("drum", None),
        ] {
            assert_eq!(WavelengthUnit::named_in(text), unit, "{text}");
        }
        assert!(
            is_wavelength_word("Wavelength [nm]") && is_wavelength_word("λ") && !is_wavelength_word("sample")
        );
        assert!(is_id_word("Sample_ID") && is_id_word("#") && !is_id_word("wavelength"));
    }

    #[test]
    fn thousandths_become_round_nanometres() {
        for nm in 300..2600 {
            let text = format!("{}", f64::from(nm) / 1000.0);
            assert_eq!(WavelengthUnit::Um.in_nm(text.parse().unwrap()), f64::from(nm));
        }
        assert_eq!(WavelengthUnit::PerCm.in_nm(25_000.0), 400.0);
    }
}

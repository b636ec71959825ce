//! The tables that are compiled in: unmodified files of the Psychophysics Toolbox, see `data/README.md`.

use std::path::Path;

use nalgebra::DMatrix;

use super::matrix::Matrix;
use super::{SpectrumKind, Table, mat};

/// A table that is compiled in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BuiltinTable {
    /// 462 Munsell papers measured by Nickerson: reflectance, 400 to 700 nm by 5 nm.
    Munsell,
    /// 170 natural and man-made surfaces measured by Vrhel, Gershon & Iwan (1994): reflectance, 390 to 730 nm by 2
    /// nm.
    Vrhel,
    /// CIE standard illuminant D65: relative power, 380 to 780 nm by 5 nm.
    D65,
    /// CIE 1931 colour matching functions x, y, z: 360 to 830 nm by 1 nm.
    Xyz1931,
    /// CIE daylight basis: the mean and two components of Judd, MacAdam & Wyszecki (1964), 380 to 780 nm by 5 nm.
    CieDaylight,
}

impl BuiltinTable {
    /// Every table.
    pub const ALL: [BuiltinTable; 5] = [
        BuiltinTable::Munsell,
        BuiltinTable::Vrhel,
        BuiltinTable::D65,
        BuiltinTable::Xyz1931,
        BuiltinTable::CieDaylight,
    ];

    /// The table of that [name](Self::name).
    pub fn named(name: &str) -> Option<BuiltinTable> {
        BuiltinTable::ALL.into_iter().find(|builtin| builtin.name() == name)
    }

    /// What the table is called here.
    pub fn name(self) -> &'static str {
        match self {
            BuiltinTable::Munsell => "munsell",
            BuiltinTable::Vrhel => "vrhel",
            BuiltinTable::D65 => "d65",
            BuiltinTable::Xyz1931 => "xyz1931",
            BuiltinTable::CieDaylight => "cie-daylight",
        }
    }

    /// The table itself, at its native sampling.
    pub fn table(self) -> Table {
        let (variable, bytes): (_, &[u8]) = match self {
            BuiltinTable::Munsell => ("sur_nickerson", include_bytes!("../../data/sur_nickerson.mat")),
            BuiltinTable::Vrhel => ("sur_vrhel", include_bytes!("../../data/sur_vrhel.mat")),
            BuiltinTable::D65 => ("spd_D65", include_bytes!("../../data/spd_D65.mat")),
            BuiltinTable::Xyz1931 => ("T_xyz1931", include_bytes!("../../data/T_xyz1931.mat")),
            BuiltinTable::CieDaylight => ("B_cieday", include_bytes!("../../data/B_cieday.mat")),
        };
        let mut table = mat::read(Path::new(self.name()), bytes, Some(variable))
            .expect("compiled-in tables are readable");
        table.name = self.name().to_owned();
        table.source = table.name.clone();
        if self == BuiltinTable::Munsell {
            // The file runs from 380 to 780 nm, but was padded with zeros where nothing was measured.
            table.crop(400.0, 700.0);
        }
        table
    }
}

/// The daylights measured at Granada, 2,600 at 300 to 1100 nm by 5 nm, as far as 56 principal components tell them; see
/// `data/README.md`.
pub(crate) fn daylights() -> Table {
    const NAME: &str = "granada-shapes.mat";
    let bytes = include_bytes!("../../data/granada-shapes.mat");
    let matrices = mat::matrices(Path::new(NAME), bytes).expect("compiled-in tables are readable");
    let matrix = |name: &str| {
        let Matrix { rows, columns, values, .. } =
            matrices.iter().find(|m| m.name == name).expect("the file holds every part");
        DMatrix::from_column_slice(*rows, *columns, values)
    };
    let (mut weights, scale) = (matrix("weights"), matrix("scale"));
    weights.row_iter_mut().zip(scale.iter()).for_each(|(mut row, scale)| row *= *scale);
    let mut spectra = matrix("basis") * weights;
    let (mean, powers) = (matrix("mean"), matrix("powers"));
    for (mut spectrum, power) in spectra.column_iter_mut().zip(powers.iter()) {
        spectrum += mean.column(0);
        spectrum *= *power;
    }
    let sampling = matrix("S_granada");
    let wavelengths = (0..spectra.nrows()).map(|band| sampling[0] + band as f64 * sampling[1]).collect();
    let name = "daylightGranadaLong.mat:daylightGranada, 56 of its principal components";
    let mut table = Table::from_columns(name, wavelengths, spectra).expect("the daylights are finite");
    table.kind = Some(SpectrumKind::Illuminant);
    table
}

impl Table {
    fn crop(&mut self, first: f64, last: f64) {
        let start = self.wavelengths.partition_point(|&w| w < first);
        let end = self.wavelengths.partition_point(|&w| w <= last);
        self.wavelengths = self.wavelengths[start..end].to_vec();
        self.spectra = self.spectra.rows(start, end - start).into_owned();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::SpectrumKind;

    #[test]
    fn every_table_has_its_shape_range_and_kind() {
        for (name, count, first, last, bands, kind) in [
            ("munsell", 462, 400.0, 700.0, 61, Some(SpectrumKind::Reflectance)),
            ("vrhel", 170, 390.0, 730.0, 171, Some(SpectrumKind::Reflectance)),
            ("d65", 1, 380.0, 780.0, 81, Some(SpectrumKind::Illuminant)),
            ("xyz1931", 3, 360.0, 830.0, 471, None),
            ("cie-daylight", 3, 380.0, 780.0, 81, None),
        ] {
            let table = BuiltinTable::named(name).unwrap().table();
            let wavelengths = table.wavelengths();
            assert_eq!((table.len(), wavelengths.len(), table.kind()), (count, bands, kind), "{name}");
            assert_eq!((wavelengths[0], wavelengths[bands - 1]), (first, last), "{name}");
        }
    }

    #[test]
    fn daylights_have_their_shape_range_and_kind() {
        let table = daylights();
        let wavelengths = table.wavelengths();
        assert_eq!((table.len(), wavelengths.len(), table.kind()), (2600, 161, Some(SpectrumKind::Illuminant)));
        assert_eq!((wavelengths[0], wavelengths[160]), (300.0, 1100.0));
        let mean = |i| table.spectrum(i).iter().sum::<f64>() / 161.0;
        assert!((0..2600).all(|i| mean(i) > 0.0));
    }

    /// Values that stand in the published tables.
    #[test]
    fn known_values() {
        let at = |b: BuiltinTable, spectrum: usize, nm: f64| {
            let table = b.table();
            let band = table.wavelengths().iter().position(|&w| w == nm).unwrap();
            table.spectrum(spectrum)[band]
        };
        assert_eq!(at(BuiltinTable::D65, 0, 560.0), 100.0);
        assert_eq!(at(BuiltinTable::Xyz1931, 1, 555.0), 1.0);
        assert_eq!(at(BuiltinTable::CieDaylight, 0, 560.0), 100.0);
    }
}

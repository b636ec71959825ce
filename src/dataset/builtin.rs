//! Compiled-in tables: unmodified files of the Psychophysics Toolbox, and a compact form of measured daylights; see
//! `data/README.md`.

use std::path::Path;

use nalgebra::DMatrix;

use super::arrays::{self, Array};
use super::reading::ReadOptions;
use super::{SpectrumKind, Table, mat};
use crate::grid::Grid;

/// Name of a table that is compiled in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BuiltinTable {
    /// 462 Munsell papers measured by Nickerson: reflectance, 400 to 700 nm by 5 nm.
    Munsell,
    /// 170 natural and man-made surfaces measured by Vrhel, Gershon & Iwan (1994): reflectance, 390 to 730 nm by 2
    /// nm.
    Vrhel,
    /// 2,600 daylights measured at Granada by Hernández-Andrés et al. (2001): spectral irradiance in W m^-2 nm^-1, 300
    /// to 1100 nm by 5 nm. Each is a combination of 80 principal components, which differs from what was
    /// measured by 10^-3 of its mean power (root mean square); `data/README.md` says what that does to fits.
    Granada,
    /// 24 patches of a Macbeth ColorChecker: reflectance, 385 to 730 nm by 5 nm.
    Macbeth,
    /// 219 leaves and flowers measured at Kuopio (the natural colours of the University of Eastern Finland): reflectance,
    /// 400 to 700 nm by 5 nm, in steps of 1/4096.
    Koivisto,
    /// 191 natural surfaces of landscapes, roads and roofs measured by Krinov (1947): reflectance, 400 to 650 nm by 10 nm.
    Krinov,
    /// 401 lamps and models of lamps collected by Houser et al. (2013): relative power, 1 at its largest, 380 to 780 nm by
    /// 5 nm.
    Houser,
    /// CIE standard illuminant D65: relative power, 380 to 780 nm by 5 nm.
    D65,
    /// CIE 1931 colour matching functions x, y, z: 360 to 830 nm by 1 nm.
    Xyz1931,
    /// CIE daylight basis: the mean and two components of Judd, MacAdam & Wyszecki (1964), 380 to 780 nm by 5 nm.
    CieDaylight,
}

impl BuiltinTable {
    /// Every table.
    pub const ALL: &[BuiltinTable] = &[
        BuiltinTable::Munsell,
        BuiltinTable::Vrhel,
        BuiltinTable::Granada,
        BuiltinTable::Macbeth,
        BuiltinTable::Koivisto,
        BuiltinTable::Krinov,
        BuiltinTable::Houser,
        BuiltinTable::D65,
        BuiltinTable::Xyz1931,
        BuiltinTable::CieDaylight,
    ];

    /// Returns the table of this [name](Self::name), if there is one.
    pub fn named(name: &str) -> Option<BuiltinTable> {
        BuiltinTable::ALL.iter().copied().find(|table| table.name() == name)
    }

    /// Name of the table in commands and messages.
    pub fn name(self) -> &'static str {
        match self {
            BuiltinTable::Munsell => "munsell",
            BuiltinTable::Vrhel => "vrhel",
            BuiltinTable::Granada => "granada",
            BuiltinTable::Macbeth => "macbeth",
            BuiltinTable::Koivisto => "koivisto",
            BuiltinTable::Krinov => "krinov",
            BuiltinTable::Houser => "houser",
            BuiltinTable::D65 => "d65",
            BuiltinTable::Xyz1931 => "xyz1931",
            BuiltinTable::CieDaylight => "cie-daylight",
        }
    }

    /// Reads the table, at its native sampling.
    pub fn table(self) -> Table {
        let (variable, bytes): (_, &[u8]) = match self {
            BuiltinTable::Munsell => ("sur_nickerson", include_bytes!("../../data/sur_nickerson.mat")),
            BuiltinTable::Vrhel => ("sur_vrhel", include_bytes!("../../data/sur_vrhel.mat")),
            BuiltinTable::Granada => return granada(self.name()),
            BuiltinTable::Macbeth => ("sur_macbeth", include_bytes!("../../data/sur_macbeth.mat")),
            BuiltinTable::Koivisto => ("sur_koivisto", include_bytes!("../../data/sur_koivisto.mat")),
            BuiltinTable::Krinov => ("sur_krinov", include_bytes!("../../data/sur_krinov.mat")),
            BuiltinTable::Houser => ("spd_houser", include_bytes!("../../data/spd_houser.mat")),
            BuiltinTable::D65 => ("spd_D65", include_bytes!("../../data/spd_D65.mat")),
            BuiltinTable::Xyz1931 => ("T_xyz1931", include_bytes!("../../data/T_xyz1931.mat")),
            BuiltinTable::CieDaylight => ("B_cieday", include_bytes!("../../data/B_cieday.mat")),
        };
        let options = ReadOptions { array: Some(variable.to_owned()), ..ReadOptions::default() };
        let path = Path::new(self.name());
        let reading = mat::arrays(path, bytes).and_then(|arrays| arrays::choose(path, arrays, &options));
        let mut table = reading.expect("compiled-in tables are readable").table;
        table.name = self.name().to_owned();
        table.source = table.name.clone();
        match self {
            // These files run from 380 to 780 nm, but were padded with zeros where nothing was measured.
            BuiltinTable::Munsell => table.crop(400.0, 700.0),
            BuiltinTable::Macbeth => table.crop(385.0, 730.0),
            // Whole numbers of 12 bits.
            BuiltinTable::Koivisto => return table.scaled(1.0 / 4096.0),
            _ => {}
        }
        table
    }
}

/// The daylights, from the file that `scripts/granada.py` makes:
/// spectrum = power * (mean + components . (step * weights)).
fn granada(name: &str) -> Table {
    let bytes = include_bytes!("../../data/granada_compact.mat");
    let matrices = mat::arrays(Path::new(name), bytes).expect("compiled-in tables are readable").all;
    let matrix = |name: &str| {
        let Array { sides, values, .. } =
            matrices.iter().find(|m| m.name == name).expect("the file has every variable");
        DMatrix::from_column_slice(sides[0], sides[1], values)
    };
    let mut spectra =
        matrix("granada_components") * (matrix("granada_weights") * matrix("granada_weight_step")[0]);
    let (mean, power) = (matrix("granada_mean"), matrix("granada_power"));
    for (mut spectrum, &power) in spectra.column_iter_mut().zip(&power) {
        spectrum += mean.column(0);
        spectrum *= power;
    }
    let sampling = matrix("S_granada");
    let grid = Grid::new(sampling[0], sampling[1], sampling[2] as usize).expect("the sampling is a grid");
    let mut table = Table::from_columns(name, grid.wavelengths().collect(), spectra)
        .expect("compiled-in tables are finite");
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
            ("granada", 2600, 300.0, 1100.0, 161, Some(SpectrumKind::Illuminant)),
            ("macbeth", 24, 385.0, 730.0, 70, Some(SpectrumKind::Reflectance)),
            ("koivisto", 219, 400.0, 700.0, 61, Some(SpectrumKind::Reflectance)),
            ("krinov", 191, 400.0, 650.0, 26, Some(SpectrumKind::Reflectance)),
            ("houser", 401, 380.0, 780.0, 81, Some(SpectrumKind::Illuminant)),
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

    /// Reflectances are fractions, and no table has a band in which nothing was measured.
    #[test]
    fn values_are_physical_and_no_band_is_padding() {
        for table in BuiltinTable::ALL.iter().map(|builtin| builtin.table()) {
            let values = || (0..table.len()).map(|spectrum| table.spectrum(spectrum));
            if table.kind().is_some() {
                let is_fraction = |&value: &f64| (0.0..=1.0).contains(&value);
                let is_right =
                    |value: &f64| table.kind() == Some(SpectrumKind::Illuminant) || is_fraction(value);
                assert!(values().flatten().all(is_right), "{}", table.name());
                assert!((0..table.wavelengths().len()).all(|band| values().any(|s| s[band] > 0.0)));
            }
        }
    }
}

//! Compiled-in tables: unmodified files of the Psychophysics Toolbox, and a compact form of measured daylights; see
//! `data/README.md`.

use std::path::Path;

use nalgebra::DMatrix;

use super::arrays::{self, Array};
use super::reading::ReadOptions;
use super::{SpectrumKind, Table, mat, text};
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
    /// CIE 1964 colour matching functions x, y, z of the 10 degree observer: 360 to 830 nm by 1 nm.
    Xyz1964,
    /// Cone fundamentals L, M, S of Stockman & Sharpe (2000) for fields of 2 degrees: 390 to 830 nm by 1 nm.
    ConesSs2,
    /// Cone fundamentals L, M, S of Stockman & Sharpe (2000) for fields of 10 degrees: 390 to 830 nm by 1 nm.
    ConesSs10,
    /// Cone fundamentals L, M, S of Smith & Pokorny (1975): 380 to 780 nm by 5 nm.
    ConesSmithPokorny,
    /// CIE scotopic luminous efficiency, that of the rods: 380 to 780 nm by 5 nm.
    Rods,
    /// Melanopsin at the human cornea, of Lucas et al. (2014): 390 to 660 nm by 1 nm.
    Melanopsin,
    /// CIE illuminant C: relative power, 380 to 780 nm by 5 nm.
    IlluminantC,
    /// CIE illuminants F2, F7 and F11, fluorescent lamps: relative power, 380 to 780 nm by 5 nm.
    IlluminantsF,
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
        BuiltinTable::Xyz1964,
        BuiltinTable::ConesSs2,
        BuiltinTable::ConesSs10,
        BuiltinTable::ConesSmithPokorny,
        BuiltinTable::Rods,
        BuiltinTable::Melanopsin,
        BuiltinTable::IlluminantC,
        BuiltinTable::IlluminantsF,
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
            BuiltinTable::Xyz1964 => "xyz1964",
            BuiltinTable::ConesSs2 => "cones-ss2",
            BuiltinTable::ConesSs10 => "cones-ss10",
            BuiltinTable::ConesSmithPokorny => "cones-smith-pokorny",
            BuiltinTable::Rods => "rods",
            BuiltinTable::Melanopsin => "melanopsin",
            BuiltinTable::IlluminantC => "illuminant-c",
            BuiltinTable::IlluminantsF => "illuminants-f",
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
            BuiltinTable::Xyz1964 => ("T_xyz1964", include_bytes!("../../data/T_xyz1964.mat")),
            BuiltinTable::ConesSs2 => ("T_cones_ss2", include_bytes!("../../data/T_cones_ss2.mat")),
            BuiltinTable::ConesSs10 => ("T_cones_ss10", include_bytes!("../../data/T_cones_ss10.mat")),
            BuiltinTable::ConesSmithPokorny => ("T_cones_sp", include_bytes!("../../data/T_cones_sp.mat")),
            BuiltinTable::Rods => ("T_rods", include_bytes!("../../data/T_rods.mat")),
            BuiltinTable::Melanopsin => ("T_melanopsin", include_bytes!("../../data/T_melanopsin.mat")),
            BuiltinTable::IlluminantC => ("spd_CIEC", include_bytes!("../../data/spd_CIEC.mat")),
            BuiltinTable::IlluminantsF => return illuminants_f(self.name()),
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

/// The fluorescent lamps.
fn illuminants_f(name: &str) -> Table {
    let bytes = include_bytes!("../../data/illuminants_f.csv");
    let reading = text::read(Path::new(name), bytes, &ReadOptions::default());
    let mut table = reading.expect("compiled-in tables are readable").table;
    table.name = name.to_owned();
    table.source = table.name.clone();
    table.kind = Some(SpectrumKind::Illuminant);
    table
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
            ("xyz1964", 3, 360.0, 830.0, 471, None),
            ("cones-ss2", 3, 390.0, 830.0, 441, None),
            ("cones-ss10", 3, 390.0, 830.0, 441, None),
            ("cones-smith-pokorny", 3, 380.0, 780.0, 81, None),
            ("rods", 1, 380.0, 780.0, 81, None),
            ("melanopsin", 1, 390.0, 660.0, 271, None),
            ("illuminant-c", 1, 380.0, 780.0, 81, Some(SpectrumKind::Illuminant)),
            ("illuminants-f", 3, 380.0, 780.0, 81, Some(SpectrumKind::Illuminant)),
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
        assert_eq!(at(BuiltinTable::Xyz1964, 0, 600.0), 1.12399);
        assert_eq!(at(BuiltinTable::Rods, 0, 510.0), 0.997);
        assert_eq!(at(BuiltinTable::IlluminantC, 0, 560.0), 105.3);
        assert_eq!([0, 1, 2].map(|lamp| at(BuiltinTable::IlluminantsF, lamp, 545.0)), [24.88, 29.52, 72.84]);
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

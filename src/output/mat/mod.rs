//! MATLAB files: of v5, which MATLAB, Octave and SciPy read, and of v7.3 where a variable would have 2 GB or more, which
//! v5 cannot hold.
//!
//! By the names that two toolboxes look for. Psychtoolbox: spectra in the columns of `X`, and `S_X` = [start step
//! count] beside it; of scenes, those of each group in `sur_NAME` or, of lights, `spd_NAME`, with `S_NAME`. ISET:
//! `wavelength`, `comment`, and in v7.3 `data` (which is `X` under a second name, and takes no room). Other arrays have
//! their own names, with _ for -, which MATLAB's have not. Draws and scenes come last in every size: MATLAB counts down
//! the first one first, so that is the order in which they come. Spectra of scenes are (band, element, scene).

mod v5;
#[cfg(feature = "hdf5")]
mod v73;

use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::path::Path;

use super::Encoder;
use super::schema::{Schema, SharedArray, SpectraArray};
use crate::dataset::SpectrumKind;
use crate::grid::Grid;

/// The bytes that a variable of v5 stays below.
pub(super) const V5_BYTES: u64 = 1 << 31;

/// The most letters that MATLAB's names have.
const NAME: usize = 63;

/// A data set under MATLAB's names. Every array has two dimensions or more.
pub(super) struct Contents {
    schema: Schema,
    /// The names of the samplings: [start step count] of the wavelengths.
    samplings: Vec<String>,
}

impl Contents {
    /// The wavelengths as the Psychophysics Toolbox has them: the row [start step count] where they are even, else a
    /// column of them all. With the rows and columns of it; `None` where there are no wavelengths.
    fn sampling(&self) -> Option<(Vec<f64>, [u64; 2])> {
        let wavelengths = &self.schema.wavelengths;
        let first = *wavelengths.first()?;
        let step = wavelengths.get(1).map_or(1.0, |second| second - first);
        let count = wavelengths.len();
        Some(match Grid::from_wavelengths(wavelengths).is_ok_and(|grid| grid.step().is_none()) {
            true => (wavelengths.clone(), [count as u64, 1]),
            false => (vec![first, step, count as f64], [1, 3]),
        })
    }
}

/// The data set of a schema, in which these are the arrays of spectra.
pub(super) fn named(schema: &Schema, spectra: &[SpectraArray]) -> Contents {
    let name = |name: &str| {
        let array = spectra.iter().find(|array| array.name == name);
        match array.map(|array| (&array.group, array.kind)) {
            Some((None, _)) => "X".to_owned(),
            Some((Some(group), SpectrumKind::Reflectance)) => plain(&format!("sur_{group}")),
            Some((Some(group), SpectrumKind::Illuminant)) => plain(&format!("spd_{group}")),
            None => plain(name),
        }
    };
    let has = |name: &str| {
        schema.fields.iter().any(|field| field.name == name)
            || schema.shared.iter().any(|shared| shared.name == name)
    };
    let groups = spectra.iter().filter(|array| has(&array.name)).filter_map(|array| array.group.as_ref());
    let mut samplings: Vec<_> = groups.map(|group| plain(&format!("S_{group}"))).collect();
    if spectra.iter().any(|array| array.group.is_none()) {
        samplings.push("S_X".to_owned());
    }
    let mut schema = schema.clone();
    for field in &mut schema.fields {
        field.name = name(&field.name);
        if !field.is_list() {
            field.axis = Some("value".to_owned());
        }
    }
    for shared in &mut schema.shared {
        shared.name = name(&shared.name);
        if shared.axes.len() == 1 {
            shared.axes.push(("value".to_owned(), 1));
        }
    }
    Contents { schema, samplings }
}

/// A name without what MATLAB's names have not.
fn plain(name: &str) -> String {
    name.replace('-', "_")
}

/// Whether MATLAB has names for all arrays, each its own.
pub(super) fn has_names(schema: &Schema, spectra: &[SpectraArray]) -> bool {
    let contents = named(schema, spectra);
    let fields = contents.schema.fields.iter().map(|field| field.name.as_str());
    let shared = contents.schema.shared.iter().map(|shared| shared.name.as_str());
    let samplings = contents.samplings.iter().map(String::as_str);
    let mut known = BTreeSet::from(["wavelength", "comment", "data"]);
    fields.chain(shared).chain(samplings).all(|name| name.len() <= NAME && known.insert(name))
}

/// Whether every array has fewer bytes than `limit`.
pub(super) fn fits_v5(schema: &Schema, limit: u64) -> bool {
    let fields = schema.fields.iter().map(|field| schema.count.saturating_mul(field.stored_bytes() as u64));
    let shared = schema.shared.iter().map(shared_bytes);
    let text = schema.attributes_text().len() as u64;
    fields.chain(shared).chain([text]).all(|bytes| bytes.saturating_add(v5::HEAD_BYTES) < limit)
}

fn shared_bytes(shared: &SharedArray) -> u64 {
    shared.shape().iter().product::<u64>() * shared.dtype.size() as u64
}

/// Begins a file, whose temporary name is `path`. It is of v7.3 unless every variable has fewer bytes than `limit`.
pub(super) fn begin(
    file: File,
    path: &Path,
    contents: &Contents,
    limit: u64,
) -> io::Result<Box<dyn Encoder>> {
    if fits_v5(&contents.schema, limit) {
        return Ok(Box::new(v5::Mat::begin(file, contents)?));
    }
    #[cfg(feature = "hdf5")]
    return Ok(Box::new(v73::Mat::begin(path, contents)?));
    #[cfg(not(feature = "hdf5"))]
    unreachable!("{path:?} was refused by FileFormat::check");
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::dataset::Table;
    use crate::output::LrvLabel;
    use crate::output::schema::Field;
    use crate::quantity::Dtype;

    const BANDS: usize = 5;

    fn schema(fields: Vec<Field>, shared: Vec<SharedArray>, row: &str, count: u64) -> Schema {
        let attributes = json!({ "kind": "illuminant", "name": "Tageslicht über \u{1f30d}" });
        Schema {
            fields,
            row: row.to_owned(),
            shared,
            count,
            wavelengths: (0..BANDS).map(|i| 400.0 + 20.0 * i as f64).collect(),
            attributes: attributes.as_object().unwrap().clone(),
        }
    }

    fn array(name: &str, group: Option<&str>, kind: SpectrumKind) -> SpectraArray {
        let (name, group) = (name.to_owned(), group.map(str::to_owned));
        SpectraArray { name, group, kind, lrv: LrvLabel::None }
    }

    fn write(path: &Path, contents: &Contents, limit: u64, windows: &[&[&[u8]]]) {
        let mut encoder = begin(File::create(path).unwrap(), path, contents, limit).unwrap();
        windows.iter().for_each(|columns| encoder.write(columns).unwrap());
        encoder.finish().unwrap();
    }

    /// The limit alone decides, and what is read is the same.
    #[test]
    fn both_versions_hold_the_same_draws() {
        let folder = tempfile::tempdir().unwrap();
        let spectra: Vec<f32> = (0..7 * BANDS).map(|i| i as f32 / 8.0).collect();
        let lrv: Vec<f32> = (0..7).map(|i| i as f32).collect();
        let fields =
            vec![Field::vector("spectra", "wavelength", BANDS, Dtype::F32), Field::scalar("lrv", Dtype::F32)];
        let schema = schema(fields, Vec::new(), "draw", 7);
        let contents = named(&schema, &[array("spectra", None, SpectrumKind::Illuminant)]);
        let (a, b) =
            (bytemuck::cast_slice(&spectra[..3 * BANDS]), bytemuck::cast_slice(&spectra[3 * BANDS..]));
        let (c, d) = (bytemuck::cast_slice(&lrv[..3]), bytemuck::cast_slice(&lrv[3..]));
        let mut versions = vec![("MATLAB 5.0 MAT-file", V5_BYTES)];
        if cfg!(feature = "hdf5") {
            versions.push(("MATLAB 7.3 MAT-file", 7 * BANDS as u64 * 4));
        }
        for (head, limit) in versions {
            let path = folder.path().join("x.mat");
            write(&path, &contents, limit, &[&[a, c], &[b, d]]);
            assert!(std::fs::read(&path).unwrap().starts_with(head.as_bytes()));
            let table = Table::open(&path, None).unwrap();
            // The kind is that of the comment.
            assert_eq!((table.len(), table.kind()), (7, Some(SpectrumKind::Illuminant)), "{head}");
            assert_eq!(table.wavelengths(), schema.wavelengths);
            let read: Vec<f64> = (0..7).flat_map(|i| table.spectrum(i).to_vec()).collect();
            assert!(read.iter().zip(&spectra).all(|(a, &b)| *a == f64::from(b)), "{head}");
        }
    }

    /// Elements of all scenes in columns, in their order; the kind is that of the name, whatever the comment says.
    #[test]
    fn groups_of_scenes_have_names_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        let values: Vec<f32> = (0..2 * 3 * BANDS).map(|i| i as f32 / 64.0).collect();
        let field =
            Field::vector("back-wall", "wavelength", BANDS, Dtype::F32).repeated("back-wall_number", 3);
        let lights: Vec<f32> = (0..2 * BANDS).map(|i| 1.0 + i as f32).collect();
        let shared = SharedArray {
            name: "lights".to_owned(),
            axes: vec![("lights_number".to_owned(), 2), ("wavelength".to_owned(), BANDS as u64)],
            dtype: Dtype::F32,
            bytes: bytemuck::cast_slice(&lights).to_vec(),
        };
        let schema = schema(vec![field], vec![shared], "scene", 2);
        let spectra = [
            array("back-wall", Some("back-wall"), SpectrumKind::Reflectance),
            array("lights", Some("lights"), SpectrumKind::Illuminant),
        ];
        assert!(has_names(&schema, &spectra));
        let contents = named(&schema, &spectra);
        for limit in if cfg!(feature = "hdf5") { vec![V5_BYTES, 1] } else { vec![V5_BYTES] } {
            let path = folder.path().join("x.mat");
            write(&path, &contents, limit, &[&[bytemuck::cast_slice(&values)]]);
            for (name, count, kind, expected) in [
                ("sur_back_wall", 6, SpectrumKind::Reflectance, &values),
                ("spd_lights", 2, SpectrumKind::Illuminant, &lights),
            ] {
                let table = Table::open(&path, Some(name)).unwrap();
                assert_eq!((table.len(), table.kind()), (count, Some(kind)));
                let read: Vec<f64> = (0..count).flat_map(|i| table.spectrum(i).to_vec()).collect();
                assert!(read.iter().zip(expected).all(|(a, &b)| *a == f64::from(b)), "{name}, limit {limit}");
            }
        }
    }

    #[test]
    fn names_are_matlabs() {
        let field = |name: &str| Field::vector(name, "wavelength", BANDS, Dtype::F32);
        let fits = |names: &[&str]| {
            let schema = schema(names.iter().map(|name| field(name)).collect(), Vec::new(), "scene", 1);
            let spectra = names.iter().map(|name| array(name, Some(name), SpectrumKind::Reflectance));
            has_names(&schema, &spectra.collect::<Vec<_>>())
        };
        assert!(fits(&["a-b", "c"]));
        assert!(!fits(&["a-b", "a_b"]));
        assert!(fits(&[&"n".repeat(59)]) && !fits(&[&"n".repeat(60)]));
    }
}

//! A folder of text files, one per spectrum, as renderers read them: wavelength in nm and value on each line.
//!
//! Named as the method's authors named theirs, and numbered from 1: `illuminance_001.spd`, `reflectance_001.spd`, and
//! `luminance-0.4000-reflectance-001.spd` where there is a target luminous reflectance. Scenes have a folder for each
//! group, in which those names begin with the number of the scene, as `--scenes` counts it, where scenes differ: the
//! second target of scene 12 is `target/scene-0012-luminance-0.4000-reflectance-002.spd`. What all scenes share is there
//! once, without a number of a scene.
//!
//! Only the folders are synced to disk, and not each file, which takes far longer than writing it: after
//! a power cut within seconds of the end, files may be empty.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use super::pending::{FolderMark, PendingFolder, sync_folder};
use super::schema::{Field, LrvLabel, Schema, SharedArray, SpectraArray};
use super::{IfExists, OutputError};
use crate::dataset::SpectrumKind;

/// Largest number of files written without confirmation: folders of more are slow to open, and to delete.
pub const MOST_FILES: u64 = 10_000;

/// Mark that tells our folders from others: nothing is in them but files of our names.
const FOLDER: FolderMark = FolderMark { name: "a folder of .spd files of this program alone", is_ours };

/// Writer of a folder that appears under its name only when it is complete.
pub struct SpdFolder {
    pending: PendingFolder,
    schema: Schema,
    columns: Vec<Column>,
    /// The folders in it.
    groups: Vec<String>,
    /// The number of the next row.
    row: u64,
}

/// Spectra that come with each row.
struct Column {
    array: SpectraArray,
    /// The number of the field.
    field: usize,
    /// Number of the field of their luminous reflectances, where they have one.
    lrv: Option<usize>,
}

impl SpdFolder {
    /// Begins a folder that will appear as `path`, of the arrays of spectra in a schema, whose first row has the number
    /// `first`.
    pub fn create(
        path: &Path,
        schema: &Schema,
        spectra: &[SpectraArray],
        first: u64,
        existing: IfExists,
    ) -> Result<SpdFolder, OutputError> {
        let count = files(schema, spectra);
        if count > MOST_FILES && existing == IfExists::Refuse {
            return Err(OutputError::ManyFiles { path: path.to_owned(), count });
        }
        let pending = PendingFolder::create(path, existing, FOLDER)?;
        let number = |name: &str| schema.fields.iter().position(|field| field.name == name);
        let columns = spectra.iter().filter_map(|array| {
            let lrv = if let LrvLabel::Field(name) = &array.lrv { number(name) } else { None };
            Some(Column { array: array.clone(), field: number(&array.name)?, lrv })
        });
        let columns = columns.collect();
        let mut folder =
            SpdFolder { columns, pending, schema: schema.clone(), groups: Vec::new(), row: first };
        for array in spectra {
            let shared = schema.shared.iter().find(|shared| shared.name == array.name);
            if let Some(group) = &array.group
                && (shared.is_some() || number(&array.name).is_some())
            {
                folder.pending.add_folder(group)?;
                folder.groups.push(group.clone());
            }
            if let Some(shared) = shared {
                folder.write_shared(array, shared)?;
            }
        }
        Ok(folder)
    }

    fn write_shared(&self, array: &SpectraArray, shared: &SharedArray) -> Result<(), OutputError> {
        let field = Field::scalar(&shared.name, shared.dtype);
        let spectra = shared.bytes.chunks_exact(self.schema.wavelengths.len() * shared.dtype.size());
        for (spectrum, number) in spectra.zip(1..) {
            self.write_file(array, &name(array, None, None, number), field.values(spectrum))?;
        }
        Ok(())
    }

    /// Writes the spectra of the next rows.
    pub fn write(&mut self, columns: &[&[u8]]) -> Result<(), OutputError> {
        let rows = self.schema.rows(columns) as u64;
        for column in &self.columns {
            let field = &self.schema.fields[column.field];
            let spectra =
                columns[column.field].chunks_exact(self.schema.wavelengths.len() * field.dtype.size());
            let each = per_row(field) as u64;
            let mut lrvs = column.lrv.map(|lrv| self.schema.fields[lrv].values(columns[lrv]));
            for (spectrum, i) in spectra.zip(0..) {
                let (row, element) = (self.row + i / each, i % each);
                let lrv = lrvs.as_mut().and_then(Iterator::next);
                let name = match column.array.group {
                    Some(_) => name(&column.array, Some(row), lrv, element + 1),
                    None => name(&column.array, None, lrv, row + 1),
                };
                self.write_file(&column.array, &name, field.values(spectrum))?;
            }
        }
        self.row += rows;
        Ok(())
    }

    fn write_file(
        &self,
        array: &SpectraArray,
        name: &str,
        values: impl Iterator<Item = f64>,
    ) -> Result<(), OutputError> {
        let mut text = String::new();
        for (wavelength, value) in self.schema.wavelengths.iter().zip(values) {
            writeln!(text, "{wavelength} {}", decimal(value)).expect("a string takes it all");
        }
        let folder = array.group.as_ref().map_or_else(PathBuf::new, PathBuf::from);
        self.pending.write(folder.join(name), text.as_bytes())
    }

    /// Makes the folder appear under its name.
    pub fn finish(self) -> Result<(), OutputError> {
        self.groups.iter().for_each(|group| sync_folder(&self.pending.temporary_path().join(group)));
        self.pending.finish()
    }
}

/// The number of files that a schema with these arrays of spectra makes.
pub fn files(schema: &Schema, spectra: &[SpectraArray]) -> u64 {
    let is_spectra = |name: &str| spectra.iter().any(|array| array.name == name);
    let fields = schema.fields.iter().filter(|field| is_spectra(&field.name));
    let shared = schema.shared.iter().filter(|shared| is_spectra(&shared.name));
    let each: u64 = fields.map(|field| per_row(field) as u64).sum();
    // The last axis is that of wavelengths.
    let once = shared.map(|shared| shared.axes.iter().rev().skip(1).map(|(_, n)| n).product::<u64>());
    schema.count.saturating_mul(each).saturating_add(once.sum())
}

/// Whether a schema has these arrays of spectra, or one of them, and nothing else but what labels them.
pub(super) fn holds(schema: &Schema, spectra: &[SpectraArray]) -> bool {
    let names = schema.fields.iter().map(|field| &field.name);
    let mut names = names.chain(schema.shared.iter().map(|shared| &shared.name));
    let is_spectra = |name: &String| spectra.iter().any(|array| array.name == *name);
    let is_label = |name: &String| spectra.iter().any(|array| array.lrv == LrvLabel::Field(name.clone()));
    names.clone().any(is_spectra) && names.all(|name| is_spectra(name) || is_label(name))
}

/// Number of spectra per row.
fn per_row(field: &Field) -> usize {
    field.outer.as_ref().map_or(1, |(_, count)| *count)
}

/// The name of a file. `number` counts from 1, within the scene where there is one.
fn name(array: &SpectraArray, scene: Option<u64>, lrv: Option<f64>, number: u64) -> String {
    let lrv = if let LrvLabel::Same(lrv) = array.lrv { Some(lrv) } else { lrv };
    let scene = scene.map_or_else(String::new, |scene| format!("{SCENE}{scene:04}-"));
    match (array.kind, lrv) {
        (SpectrumKind::Illuminant, _) => format!("{scene}illuminance_{number:03}.spd"),
        (SpectrumKind::Reflectance, None) => format!("{scene}reflectance_{number:03}.spd"),
        (SpectrumKind::Reflectance, Some(lrv)) => {
            format!("{scene}luminance-{lrv:.4}-reflectance-{number:03}.spd")
        }
    }
}

const SCENE: &str = "scene-";

/// Whether a file could have been named by [`name`].
fn is_a_name(name: &str) -> bool {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let Some(name) = name.strip_suffix(".spd") else { return false };
    let name = match name.strip_prefix(SCENE).and_then(|rest| rest.split_once('-')) {
        Some((scene, rest)) if is_number(scene) => rest,
        Some(_) => return false,
        None => name,
    };
    let plain = name.strip_prefix("illuminance_").or_else(|| name.strip_prefix("reflectance_"));
    let labelled = || {
        let (lrv, number) = name.strip_prefix("luminance-")?.split_once("-reflectance-")?;
        lrv.parse::<f64>().ok().map(|_| number)
    };
    plain.or_else(labelled).is_some_and(is_number)
}

/// Whether a folder holds nothing but what this program puts there, be it in folders of groups.
fn is_ours(folder: &Path) -> bool {
    let all = |folder: &Path, is_ours: &dyn Fn(&fs::DirEntry) -> bool| {
        fs::read_dir(folder).is_ok_and(|mut entries| entries.all(|entry| entry.is_ok_and(|e| is_ours(&e))))
    };
    let is_file = |entry: &fs::DirEntry| {
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        is_file && entry.file_name().to_str().is_some_and(is_a_name)
    };
    all(folder, &|entry| match entry.file_type() {
        Ok(kind) if kind.is_dir() => all(&entry.path(), &is_file),
        _ => is_file(entry),
    })
}

/// Nine significant digits, which tell every f32 from every other, without an exponent: not all readers know those.
fn decimal(value: f64) -> String {
    let magnitude = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    format!("{value:.*}", (8 - magnitude).max(0) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_nine_digits_and_no_exponent() {
        for (value, text) in
            [(0.5, "0.500000000"), (1.0, "1.00000000"), (1.25e-7, "0.000000125000000"), (0.0, "0.00000000")]
        {
            assert_eq!(decimal(value), text);
        }
        let close = [0.1f32, f32::from_bits(0.1f32.to_bits() + 1)];
        assert_ne!(decimal(close[0].into()), decimal(close[1].into()));
        assert_eq!(decimal(close[0].into()).parse::<f32>().unwrap(), close[0]);
    }

    fn array(group: Option<&str>, kind: SpectrumKind, lrv: LrvLabel) -> SpectraArray {
        SpectraArray { name: "spectra".to_owned(), group: group.map(str::to_owned), kind, lrv }
    }

    #[test]
    fn names_are_those_of_the_authors() {
        let lights = array(None, SpectrumKind::Illuminant, LrvLabel::None);
        let surfaces = array(Some("walls"), SpectrumKind::Reflectance, LrvLabel::None);
        let targets = array(None, SpectrumKind::Reflectance, LrvLabel::Same(0.4));
        let names = [
            (name(&lights, None, None, 7), "illuminance_007.spd"),
            (name(&surfaces, None, None, 1234), "reflectance_1234.spd"),
            (name(&targets, None, None, 1), "luminance-0.4000-reflectance-001.spd"),
            (name(&surfaces, Some(12), None, 3), "scene-0012-reflectance_003.spd"),
            (name(&surfaces, Some(12345), Some(0.2), 3), "scene-12345-luminance-0.2000-reflectance-003.spd"),
        ];
        for (found, expected) in names {
            assert_eq!(found, expected);
            assert!(is_a_name(&found), "{found}");
        }
        for other in [
            "reflectance_.spd",
            "reflectance_001.txt",
            "reflectance_001.spd.bak",
            "scene-x-reflectance_001.spd",
            "luminance-high-reflectance-001.spd",
            "notes.spd",
            "",
        ] {
            assert!(!is_a_name(other), "{other}");
        }
    }

    #[test]
    fn our_folders_hold_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        fs::create_dir(path.join("walls")).unwrap();
        fs::write(path.join("walls/reflectance_001.spd"), "").unwrap();
        fs::write(path.join("illuminance_001.spd"), "").unwrap();
        assert!(is_ours(path));
        fs::write(path.join("walls/notes.txt"), "").unwrap();
        assert!(!is_ours(path));
        fs::remove_file(path.join("walls/notes.txt")).unwrap();
        fs::create_dir_all(path.join("walls/deeper")).unwrap();
        assert!(!is_ours(path));
    }
}

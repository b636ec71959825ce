//! Folders: Zarr stores, sets of parts as this program writes them, and folders of one spectrum a file.

use std::path::{Path, PathBuf};

use nalgebra::DMatrix;

use super::arrays::{self, Arrays, Order};
use super::reading::{ReadOptions, Reading};
use super::{DatasetError, MAX_VALUES, Table, files, npy, text, zarr};

/// Reads a folder.
pub(super) fn read(folder: &Path, options: &ReadOptions) -> Result<Reading, DatasetError> {
    if zarr::is_store(folder) {
        return arrays::choose(folder, zarr::arrays(folder)?, options);
    }
    let parts = files::files(folder, "npy")?;
    if !parts.is_empty() {
        return npy_parts(folder, &parts, options);
    }
    let parts = files::files(folder, "parquet")?;
    if !parts.is_empty() {
        return parquet_parts(folder, &parts, options);
    }
    let spectra = files::files(folder, "spd")?;
    if !spectra.is_empty() {
        return spd_files(folder, &spectra, options);
    }
    Err(DatasetError::UnknownType {
        path: folder.to_owned(),
        found: "a folder".to_owned(),
        advice: "expected a Zarr store, or a folder of .npy, .parquet or .spd files; name its files one by one",
    })
}

/// Reads the `.npy` files of a folder: those of one array, `NAME-000000.npy` and on, joined by their first side.
fn npy_parts(folder: &Path, parts: &[PathBuf], options: &ReadOptions) -> Result<Reading, DatasetError> {
    let format = "folder of NumPy arrays".to_owned();
    let mut found = Arrays { format, order: Order::LastFirst, ..Arrays::default() };
    let mut count = 0;
    for path in parts {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let (name, is_part) = match stem.rsplit_once('-') {
            Some((name, number)) if number.len() == 6 && number.bytes().all(|b| b.is_ascii_digit()) => {
                (name.to_owned(), true)
            }
            _ => (stem, false),
        };
        let failed = |reason| DatasetError::Format { path: path.clone(), format: "a NumPy array", reason };
        let array = npy::of_file(path, &name, files::Source::open(path)?)?;
        count += array.values.len();
        if count > MAX_VALUES {
            return Err(DatasetError::TooLarge { path: folder.to_owned() });
        }
        match found.all.last_mut().filter(|last| is_part && last.name == name) {
            Some(last) => {
                let end = last.sides.len() - 1;
                if array.sides.len() != last.sides.len() || array.sides[..end] != last.sides[..end] {
                    return Err(failed(format!(
                        "its sides differ from those of the part before it: {:?}",
                        array.sides
                    )));
                }
                last.sides[end] += array.sides[end];
                last.values.extend(array.values);
            }
            None => found.all.push(array),
        }
    }
    found.kind = manifest_kind(folder);
    arrays::choose(folder, found, options)
}

/// Kind of the draws of a set of this program, from its manifest.
fn manifest_kind(folder: &Path) -> Option<super::SpectrumKind> {
    let bytes = files::read_capped(&folder.join("_manifest.json"), 64 << 20).ok()?;
    let manifest: serde_json::Value = serde_json::from_slice(&bytes).ok()?;
    arrays::kind(&manifest["plan"]["attributes"].to_string())
}

#[cfg(feature = "parquet")]
fn parquet_parts(folder: &Path, parts: &[PathBuf], options: &ReadOptions) -> Result<Reading, DatasetError> {
    let mut columns = super::parquet::Columns::default();
    for path in parts {
        columns.add(path, files::Source::open(path)?)?;
    }
    columns.table(folder, options)
}

#[cfg(not(feature = "parquet"))]
fn parquet_parts(folder: &Path, _: &[PathBuf], _: &ReadOptions) -> Result<Reading, DatasetError> {
    Err(super::format::not_built(
        folder,
        "Parquet",
        "this build leaves out Parquet: build it with the feature parquet",
    ))
}

/// Reads the `.spd` files of a folder, each of spectra at the same wavelengths.
fn spd_files(folder: &Path, spectra: &[PathBuf], options: &ReadOptions) -> Result<Reading, DatasetError> {
    let mut wavelengths: Vec<f64> = Vec::new();
    let mut values = Vec::new();
    for path in spectra {
        let reading = text::read(path, &files::read(path)?, options)?;
        let table = reading.table;
        if values.is_empty() {
            wavelengths = table.wavelengths.clone();
        }
        if table.wavelengths != wavelengths {
            return Err(DatasetError::Layout {
                path: path.clone(),
                reason: "its wavelengths differ from those of the first file of the folder: name the files one by one".to_owned(),
                remedy: super::Remedy::None,
            });
        }
        values.extend_from_slice(table.spectra.as_slice());
        if values.len() > MAX_VALUES {
            return Err(DatasetError::TooLarge { path: folder.to_owned() });
        }
    }
    let count = values.len() / wavelengths.len();
    let mut table = Table::from_columns(
        &format!("{folder:?}"),
        wavelengths,
        DMatrix::from_vec(values.len() / count, count, values),
    )?;
    table.kind = kind_of_names(spectra);
    Ok(Reading {
        table,
        format: format!("folder of {} .spd files", spectra.len()),
        dialect: None,
        layout: "a file for each spectrum".to_owned(),
        wavelengths: "the first column of each file, in nm".to_owned(),
        notes: Vec::new(),
        others: Vec::new(),
    })
}

/// Kind by the names that this program gives such files.
fn kind_of_names(files: &[PathBuf]) -> Option<super::SpectrumKind> {
    let all = |word: &str| {
        files.iter().all(|path| path.file_name().is_some_and(|name| name.to_string_lossy().contains(word)))
    };
    if all("reflectance") {
        Some(super::SpectrumKind::Reflectance)
    } else if all("illuminance") {
        Some(super::SpectrumKind::Illuminant)
    } else {
        None
    }
}

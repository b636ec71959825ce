//! Formats of files, told by their content: the ending of a name decides nothing.

use std::path::Path;

use super::arrays::choose;
use super::files::Source;
use super::reading::{ReadOptions, Reading};
use super::{DatasetError, envi, files, folder, hdf5_arrays, mat, npy, npz, spdx, text};

/// Endings of the names of tables, for those who ask without opening one.
const ENDINGS: [&str; 30] = [
    "mat", "h5", "hdf5", "he5", "nc", "nc4", "npy", "npz", "parquet", "pq", "zarr", "csv", "tsv", "txt",
    "dat", "asc", "dpt", "spd", "prn", "xlsx", "xls", "xlsb", "ods", "sli", "spdx", "cgats", "it8", "ti3",
    "sp", "tab",
];

/// Kinds of files that are told by their first bytes, and are none of spectra that are read.
const OTHERS: [(&[u8], &str, &str); 12] = [
    (b"CDF\x01", "netCDF 3", "convert it to netCDF 4, which is HDF5: nccopy -k nc4 IN OUT"),
    (b"CDF\x02", "netCDF 3", "convert it to netCDF 4, which is HDF5: nccopy -k nc4 IN OUT"),
    (b"\x0e\x03\x13\x01", "HDF4", "convert it to HDF5: h4toh5 IN OUT"),
    (b"\x89PNG", "a picture", "export the spectra as text, with wavelengths in the first column"),
    (b"\xff\xd8\xff", "a picture", "export the spectra as text, with wavelengths in the first column"),
    (b"II*\0", "a TIFF picture", "export the spectra as text or as a NumPy array"),
    (b"MM\0*", "a TIFF picture", "export the spectra as text or as a NumPy array"),
    (b"%PDF", "a PDF document", "export the spectra as text, with wavelengths in the first column"),
    (b"\x1f\x8b", "packed by gzip", "unpack it first: gunzip FILE"),
    (b"\x28\xb5\x2f\xfd", "packed by Zstandard", "unpack it first: zstd -d FILE"),
    (b"ASD", "an ASD spectrometer's own file", "export it as text in ViewSpec Pro"),
    (b"as7", "an ASD spectrometer's own file", "export it as text in ViewSpec Pro"),
];

pub(super) fn may_open(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    ENDINGS.contains(&extension.as_str())
}

/// Reads a file or a folder.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Reading, DatasetError> {
    if path.is_dir() {
        return folder::read(path, options);
    }
    read_source(path, Source::open(path)?, options)
}

/// Reads the contents of a file; `path` is what messages call it, and where files are looked for that belong to it.
pub(super) fn read_source(
    path: &Path,
    mut source: Source,
    options: &ReadOptions,
) -> Result<Reading, DatasetError> {
    let failed = |error| files::failed(path, error);
    let head = source.head().map_err(failed)?;
    let bytes = |source: Source| source.into_bytes().map_err(failed);
    if is_hdf5(&head) {
        return choose(path, hdf5_arrays(path, source)?, options);
    }
    if npy::begins(&head) {
        return choose(path, npy::arrays(path, source)?, options);
    }
    if head.starts_with(b"PAR1") {
        return parquet(path, source, options);
    }
    if head.starts_with(b"PK") {
        return match npz::kind(&mut source) {
            npz::Archive::Npz => choose(path, npz::arrays(path, source)?, options),
            npz::Archive::Spreadsheet => spreadsheet(path, &bytes(source)?, options),
            npz::Archive::Other => Err(unknown(path, "an archive", "unpack it first")),
        };
    }
    // A workbook of before 2007.
    if head.starts_with(b"\xd0\xcf\x11\xe0") {
        return spreadsheet(path, &bytes(source)?, options);
    }
    if let Some((_, found, advice)) = OTHERS.iter().find(|(start, ..)| head.starts_with(start)) {
        return Err(unknown(path, found, advice));
    }
    if let Some(header) = envi::header(path, &head)? {
        return choose(path, envi::arrays(path, &header)?, options);
    }
    let bytes = bytes(source)?;
    if mat::begins(&bytes) || bytes.starts_with(b"MATLAB") {
        return choose(path, mat::arrays(path, &bytes)?, options);
    }
    if is_binary(&bytes) {
        let advice = "expected text, MATLAB, HDF5, NumPy, Parquet, a spreadsheet or an ENVI library; export the spectra as \
                      text, with wavelengths in the first column";
        return Err(unknown(path, "of a type that is unknown, and no text", advice));
    }
    let (decoded, encoding) = text::decode(&bytes);
    if decoded.trim_start().starts_with('{') {
        let is_model = decoded.contains("\"weight_covariance\"");
        let found = if is_model { "a model, fitted already" } else { "JSON" };
        return Err(unknown(
            path,
            found,
            "expected measured spectra; write them as text, with wavelengths in the first column",
        ));
    }
    if spdx::begins(&decoded) {
        return spdx::read(path, &decoded);
    }
    if decoded.trim_start().starts_with("##") && decoded.contains("##JCAMP") {
        return super::jcamp::read(path, &decoded, options);
    }
    text::read_text(path, &decoded, encoding, "text", options)
}

fn unknown(path: &Path, found: &str, advice: &'static str) -> DatasetError {
    DatasetError::UnknownType { path: path.to_owned(), found: found.to_owned(), advice }
}

/// Whether a file is HDF5: MATLAB's of version 7.3, netCDF 4, or of anybody else.
fn is_hdf5(bytes: &[u8]) -> bool {
    const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";
    let at = [0, 512, 1024, 2048].into_iter().any(|at| bytes.get(at..at + 8) == Some(HDF5));
    at || bytes.starts_with(b"MATLAB 7.3")
}

/// Whether bytes are no text of any encoding: text in UTF-16 has zeros, but no other signs of control.
fn is_binary(bytes: &[u8]) -> bool {
    let sample = &bytes[..bytes.len().min(8192)];
    let controls = sample.iter().filter(|b| matches!(b, 1..=8 | 14..=26 | 28..=31)).count();
    let zeros = sample.iter().filter(|b| **b == 0).count();
    controls * 50 > sample.len() || zeros * 5 > sample.len() * 3
}

#[cfg(feature = "spreadsheets")]
fn spreadsheet(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Reading, DatasetError> {
    super::spreadsheet::read(path, bytes, options)
}

#[cfg(not(feature = "spreadsheets"))]
fn spreadsheet(path: &Path, _: &[u8], _: &ReadOptions) -> Result<Reading, DatasetError> {
    Err(not_built(path, "a spreadsheet", "this build leaves out spreadsheets: save the sheet as .csv"))
}

#[cfg(feature = "parquet")]
fn parquet(path: &Path, source: Source, options: &ReadOptions) -> Result<Reading, DatasetError> {
    super::parquet::read(path, source, options)
}

#[cfg(not(feature = "parquet"))]
fn parquet(path: &Path, _: Source, _: &ReadOptions) -> Result<Reading, DatasetError> {
    Err(not_built(path, "Parquet", "this build leaves out Parquet: build it with the feature parquet"))
}

/// The error of a format that this build leaves out.
#[cfg_attr(all(feature = "parquet", feature = "hdf5", feature = "spreadsheets"), allow(dead_code))]
pub(super) fn not_built(path: &Path, format: &'static str, reason: &str) -> DatasetError {
    DatasetError::Format { path: path.to_owned(), format, reason: reason.to_owned() }
}

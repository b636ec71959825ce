//! Sets as folders of small files: each chunk of draws has its own, in `.npy` (one per quantity) or `.parquet`.

use std::io;

use super::super::npy;
use super::super::schema::{Field, Schema, SharedArray};
use super::layout::Part;

/// Name of the `.npy` file of a field in a chunk.
pub(super) fn npy_name(field: &Field, index: u64) -> String {
    format!("{}-{index:06}.npy", field.name)
}

/// Name of the `.parquet` file of a chunk.
pub(super) fn parquet_name(index: u64) -> String {
    format!("part-{index:06}.parquet")
}

/// Encodes the `.npy` files of one chunk.
pub(super) fn npy(schema: &Schema, index: u64, columns: &[Vec<u8>]) -> io::Result<Vec<Part<'static>>> {
    schema
        .fields
        .iter()
        .zip(columns)
        .map(|(field, column)| {
            let shape = field.shape((column.len() / field.delivered_bytes()) as u64);
            let bytes = npy::file(npy::type_string(field.stored), &shape, &field.store(column)?);
            Ok(Part { name: npy_name(field, index), bytes: bytes.into() })
        })
        .collect()
}

/// Encodes the wavelengths, which the `.npy` files of the chunks do not hold.
pub(super) fn npy_metadata(schema: &Schema) -> io::Result<Vec<Part<'static>>> {
    let bytes: Vec<u8> = schema.wavelengths.iter().flat_map(|w| w.to_le_bytes()).collect();
    let bytes = npy::file("<f8", &[schema.wavelengths.len() as u64], &bytes);
    Ok(vec![Part { name: "wavelength.npy".to_owned(), bytes: bytes.into() }])
}

/// Encodes the `.npy` files of the arrays that all draws share.
pub(super) fn npy_constants(schema: &Schema) -> io::Result<Vec<Part<'static>>> {
    let part = |constant: &SharedArray| {
        let bytes = npy::file(npy::type_string(constant.dtype), &constant.shape(), &constant.bytes);
        Ok(Part { name: format!("{}.npy", constant.name), bytes: bytes.into() })
    };
    schema.shared.iter().map(part).collect()
}

/// Encodes the `.parquet` file of one chunk.
#[cfg(feature = "parquet")]
pub(super) fn parquet(schema: &Schema, index: u64, columns: &[Vec<u8>]) -> io::Result<Vec<Part<'static>>> {
    use crate::output::Encoder;

    let mut bytes = Vec::new();
    let mut encoder = Box::new(super::super::parquet::Parquet::begin(&mut bytes, schema)?);
    encoder.write(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>())?;
    encoder.finish()?;
    Ok(vec![Part { name: parquet_name(index), bytes: bytes.into() }])
}

#[cfg(not(feature = "parquet"))]
pub(super) fn parquet(_: &Schema, _: u64, _: &[Vec<u8>]) -> io::Result<Vec<Part<'static>>> {
    Err(io::Error::other("this build leaves out Parquet: build it with the feature parquet"))
}

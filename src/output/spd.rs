//! A folder of text files, one per spectrum, as renderers read them: wavelength in nm and value on each line.
//!
//! Named as the method's authors named theirs, and numbered from 1: `illuminance_001.spd`, `reflectance_001.spd`,
//! and `luminance-0.4000-reflectance-001.spd` where there is a target luminous reflectance.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::pending::{self, existing_folder};
use super::schema::Schema;
use super::{IfExists, OutputError};

/// Largest number of files written without confirmation: folders of more are slow to open, and to delete.
pub const MOST_FILES: u64 = 10_000;

/// Kind of the spectra, for the names of their files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpdName {
    /// Illuminants.
    Illuminant,
    /// Reflectances.
    Reflectance,
    /// Reflectances with this luminous reflectance (CIE Y of the 1931 2 degree observer under D65, perfect white =
    /// 1).
    ReflectanceAt(f64),
}

impl SpdName {
    fn file(self, number: u64) -> String {
        match self {
            SpdName::Illuminant => format!("illuminance_{number:03}.spd"),
            SpdName::Reflectance => format!("reflectance_{number:03}.spd"),
            SpdName::ReflectanceAt(lrv) => format!("luminance-{lrv:.4}-reflectance-{number:03}.spd"),
        }
    }
}

/// Writer of a folder that appears under its name only when it is complete.
pub struct SpdFolder {
    folder: TempDir,
    path: PathBuf,
    name: SpdName,
    schema: Schema,
    next: u64,
}

impl SpdFolder {
    /// Begins a folder that will appear as `path`; its first spectrum is that of row `first`.
    pub fn create(
        path: &Path,
        schema: &Schema,
        name: SpdName,
        first: u64,
        existing: IfExists,
    ) -> Result<SpdFolder, OutputError> {
        let path = path.to_owned();
        if path.symlink_metadata().is_ok() {
            return Err(if path.is_dir() {
                OutputError::FolderExists { path }
            } else {
                OutputError::Exists { path }
            });
        }
        let each = schema.fields.iter().find_map(|field| field.outer.as_ref()).map_or(1, |(_, n)| *n as u64);
        let count = schema.count.saturating_mul(each);
        if count > MOST_FILES && existing == IfExists::Refuse {
            return Err(OutputError::ManyFiles { path, count });
        }
        let parent = existing_folder(&path)?;
        match tempfile::Builder::new().prefix(".spectroll-").suffix(".partial").tempdir_in(parent) {
            Ok(folder) => {
                Ok(SpdFolder { folder, path, name, schema: schema.clone(), next: first * each + 1 })
            }
            Err(source) => Err(OutputError::Write { path, source }),
        }
    }

    /// Writes the next spectra.
    pub fn write(&mut self, columns: &[&[u8]]) -> Result<(), OutputError> {
        let ([field], [column]) = (self.schema.fields.as_slice(), columns) else {
            unreachable!("the schema has one field: see Format::check")
        };
        // A scene has several spectra of a group: each has a file of its own.
        for spectrum in column.chunks_exact(self.schema.wavelengths.len() * field.dtype.size()) {
            let mut text = String::new();
            for (wavelength, value) in self.schema.wavelengths.iter().zip(field.values(spectrum)) {
                writeln!(text, "{wavelength} {}", decimal(value)).expect("a string takes it all");
            }
            let file = self.folder.path().join(self.name.file(self.next));
            fs::write(file, text).map_err(|source| self.failed(source))?;
            self.next += 1;
        }
        Ok(())
    }

    /// Makes the folder appear under its name.
    pub fn finish(self) -> Result<(), OutputError> {
        for file in fs::read_dir(self.folder.path()).map_err(|e| self.failed(e))? {
            let synced = file.and_then(|file| fs::File::open(file.path())).and_then(|file| file.sync_all());
            synced.map_err(|e| self.failed(e))?;
        }
        #[cfg(unix)] // as any new folder; by default only its owner could open it
        {
            let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
            fs::set_permissions(self.folder.path(), mode).map_err(|e| self.failed(e))?;
        }
        pending::sync_folder(self.folder.path());
        fs::rename(self.folder.path(), &self.path).map_err(|e| self.failed(e))?;
        pending::sync_folder(pending::folder(&self.path));
        let _ = self.folder.keep(); // it is not there any more
        Ok(())
    }

    fn failed(&self, source: std::io::Error) -> OutputError {
        OutputError::Write { path: self.path.clone(), source }
    }
}

/// Formats nine significant digits, which tell every f32 from every other, without an exponent: not all readers know
/// those.
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

    #[test]
    fn names_are_those_of_the_authors() {
        assert_eq!(SpdName::Illuminant.file(7), "illuminance_007.spd");
        assert_eq!(SpdName::Reflectance.file(1234), "reflectance_1234.spd");
        assert_eq!(SpdName::ReflectanceAt(0.4).file(1), "luminance-0.4000-reflectance-001.spd");
    }
}

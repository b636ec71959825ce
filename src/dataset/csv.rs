//! Delimited text: the wavelength in the first column, a spectrum in each other one; `#` starts a comment line, and a
//! first row that is not numbers is a header.

use std::path::Path;

use nalgebra::DMatrix;

use super::{DatasetError, Table};

pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Table, DatasetError> {
    let failed = |line, reason| DatasetError::Csv { path: path.to_owned(), line, reason };
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes); // the mark that Excel puts first
    let mut reader = ::csv::ReaderBuilder::new()
        .delimiter(delimiter(bytes))
        .comment(Some(b'#'))
        .has_headers(false)
        .flexible(true) // ragged rows get our own message
        .trim(::csv::Trim::All)
        .from_reader(bytes);

    let mut wavelengths = Vec::new();
    let mut rows: Vec<f64> = Vec::new();
    let mut columns = None;
    for (i, record) in reader.records().enumerate() {
        let record = record.map_err(|e| failed(e.position().map_or(0, |p| p.line()), e.to_string()))?;
        let line = record.position().map_or(0, |p| p.line());
        if i == 0 && record.iter().next().is_none_or(|field| field.parse::<f64>().is_err()) {
            continue; // the header
        }
        if record.len() < 2 {
            let reason =
                "expected a wavelength and at least one value, separated by commas, semicolons or tabs";
            return Err(failed(line, reason.to_owned()));
        }
        let expected = *columns.get_or_insert(record.len());
        if record.len() != expected {
            let reason = format!("{} fields, but the rows before have {expected}", record.len());
            return Err(failed(line, reason));
        }
        for (column, field) in record.iter().enumerate() {
            let value = field
                .parse()
                .map_err(|_| failed(line, format!("{field:?} in column {} is not a number", column + 1)))?;
            if column == 0 { wavelengths.push(value) } else { rows.push(value) }
        }
    }
    let Some(columns) = columns else {
        return Err(DatasetError::NoSpectra { name: format!("{path:?}") });
    };
    let spectra = DMatrix::from_row_slice(wavelengths.len(), columns - 1, &rows);
    Table::from_columns(&format!("{path:?}"), wavelengths, spectra).map_err(|error| match error {
        DatasetError::Wavelengths { name, source } => DatasetError::FirstColumn { name, source },
        other => other,
    })
}

/// The separator of the first line that is not a comment.
fn delimiter(bytes: &[u8]) -> u8 {
    let first = bytes.split(|&b| b == b'\n').find(|line| !line.is_empty() && line[0] != b'#');
    first.and_then(|line| line.iter().copied().find(|b| b"\t;,".contains(b))).unwrap_or(b',')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Table, String> {
        read(Path::new("x.csv"), text.as_bytes()).map_err(|e| e.to_string())
    }

    #[test]
    fn headers_comments_and_separators() {
        let expected =
            Table::new("\"x.csv\"", vec![400.0, 410.0], &[vec![0.1, 0.2], vec![0.3, 0.4]]).unwrap();
        for text in [
            "400,0.1,0.3\n410,0.2,0.4\n",
            "wavelength,a,b\n400,0.1,0.3\n410,0.2,0.4",
            "\u{feff}nm;a;b\r\n400;0.1;0.3\r\n410; 0.2 ;0.4\r\n",
            "# measured\n400\t0.1\t0.3\n# later\n\n410\t0.2\t0.4\n",
        ] {
            assert_eq!(parse(text).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn bad_input_is_placed() {
        for (text, message) in [
            ("400,0.1\n410,oops\n", "line 2: \"oops\" in column 2 is not a number"),
            ("400,0.1,0.2\n410,0.1\n", "line 2: 2 fields, but the rows before have 3"),
            ("400,0.1\n410,inf\n", "spectrum 1 of \"x.csv\": the value at 410 nm is inf"),
            ("410,0.1\n400,0.2\n", "number 2 is 400 nm after 410 nm"),
            ("0,0.1\n5,0.2\n", "the first column must hold the wavelengths: are the spectra in rows?"),
            ("400 0.1\n410 0.2\n", "separated by commas"),
            ("nm,a\n", "holds no spectra"),
            ("# nothing\n", "holds no spectra"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(message), "{text:?}: {error}");
        }
    }
}

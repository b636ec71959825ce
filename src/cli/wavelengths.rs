//! Wavelengths as they are typed: a grid, a list, or a file of them.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use spectroll::{Grid, Model};

/// The most bytes of a file of wavelengths: 100,000 of them take less.
const MOST: u64 = 16 << 20;

/// Below this, in nm, wavelengths are likely to be micrometres.
const MICROMETRES: f64 = 100.0;

/// Wavelengths of a fit.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Wavelengths {
    Grid(Grid),
    /// The wavelengths of the data.
    AsMeasured,
}

/// Wavelengths of a fit: `as-measured`, or what [`grid`] takes.
pub(super) fn wavelengths(text: &str) -> Result<Wavelengths, String> {
    if text == "as-measured" {
        return Ok(Wavelengths::AsMeasured);
    }
    grid(text).map(Wavelengths::Grid).map_err(|error| format!("{error}; or as-measured"))
}

/// A grid: start:step:stop, a list between commas, or a file that has them.
pub(super) fn grid(text: &str) -> Result<Grid, String> {
    let path = Path::new(text);
    if path.is_file() {
        return read(path).map_err(|error| format!("{text}: {error}"));
    }
    text.parse::<Grid>().map_err(|error| match text.contains(['.', '/']) && !text.contains([':', ',']) {
        true => "there is no file of this name, and it is no grid in nm, as 400:10:700 is".to_owned(),
        false => format!("{error}, or name a file of them"),
    })
}

/// The wavelengths of a file: of a model's, or of text with one on each line or all on one.
fn read(path: &Path) -> Result<Grid, String> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json")) {
        return Model::load(path).map(|model| model.grid().clone()).map_err(|error| error.to_string());
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|error| error.to_string())?;
    file.take(MOST + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if bytes.len() as u64 > MOST {
        return Err("it is too large for a list of wavelengths".to_owned());
    }
    let text = String::from_utf8(bytes)
        .map_err(|_| "it is not text: write one wavelength in nm on each line".to_owned())?;
    let mut wavelengths = list(text.trim_start_matches('\u{feff}'))?;
    if wavelengths.windows(2).all(|pair| pair[1] < pair[0]) {
        wavelengths.reverse();
    }
    if let Some(&last) = wavelengths.last().filter(|&&last| last > 0.0 && last < MICROMETRES) {
        return Err(format!(
            "its wavelengths go up to {last}, which look like micrometres: write them in nm, 1000 times as large"
        ));
    }
    Grid::from_wavelengths(&wavelengths).map_err(|error| error.to_string())
}

/// The numbers of a text: those of its only row, or one of each. `#` begins a comment, and the first row may be a header.
fn list(text: &str) -> Result<Vec<f64>, String> {
    let rows = (1..).zip(text.lines()).map(|(number, line)| {
        let line = line.split('#').next().unwrap_or_default();
        let words: Vec<&str> =
            line.split([',', ';', '\t', ' ', '\r']).map(|word| word.trim_matches('"')).collect();
        (number, words.into_iter().filter(|word| !word.is_empty() && *word != "nm").collect::<Vec<_>>())
    });
    let rows: Vec<_> = rows.filter(|(_, words)| !words.is_empty()).collect();
    let value = |word: &str| word.strip_suffix("nm").unwrap_or(word).parse::<f64>().ok();
    let is_header = |words: &[&str]| words.iter().all(|word| value(word).is_none());
    let rows = if rows.first().is_some_and(|(_, words)| is_header(words)) { &rows[1..] } else { &rows[..] };
    let Some(((first, words), others)) = rows.split_first() else {
        return Err("it has no numbers: write one wavelength in nm on each line".to_owned());
    };
    let number = |line: usize, word: &str| {
        value(word).ok_or_else(|| format!("line {line}: {word:?} is not a wavelength in nm"))
    };
    if others.is_empty() {
        return words.iter().map(|word| number(*first, word)).collect();
    }
    let one = |(line, words): &(usize, Vec<&str>)| match words[..] {
        [word] => number(*line, word),
        _ => Err(format!("line {line} has {} values, where a list of wavelengths has one", words.len())),
    };
    rows.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_wavelengths_are_read_in_many_forms() {
        for text in [
            "443\n490\n560\n",
            "wavelength\n443\n490.0\n560",
            "# bands\n\n443 nm\r\n490 nm\r\n560 nm # green\r\n",
            "443,490,560",
            "443; 490; 560\n",
            "\"443\"\n\"490\"\n\"560\"\n",
            "443nm\t490nm\t560nm",
        ] {
            assert_eq!(list(text), Ok(vec![443.0, 490.0, 560.0]), "{text:?}");
        }
        for (text, message) in [
            ("", "no numbers"),
            ("wavelength\n", "no numbers"),
            ("443\n490 20\n", "line 2 has 2 values"),
            ("443\nred\n", "line 2: \"red\" is not a wavelength"),
            ("443 red", "line 1: \"red\" is not"),
        ] {
            let error = list(text).unwrap_err();
            assert!(error.contains(message), "{text:?}: {error}");
        }
    }

    #[test]
    fn wavelengths_are_a_grid_a_list_or_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path.display().to_string()
        };
        assert_eq!(wavelengths("as-measured"), Ok(Wavelengths::AsMeasured));
        assert_eq!(grid("400:10:700"), Ok(Grid::DEFAULT));
        assert_eq!(grid("443,490,560").unwrap().len(), 3);
        let bands = "443,490,560".parse::<Grid>().unwrap();
        assert_eq!(grid(&write("bands.txt", "443\n490\n560\n")), Ok(bands.clone()));
        assert_eq!(grid(&write("falling.csv", "nm\n560\n490\n443\n")), Ok(bands));
        let model = write("model.json", &Model::builtin("granada-5nm").unwrap().to_json());
        assert_eq!(grid(&model).unwrap().to_string(), "400:5:700");
        let error = grid(&write("um.txt", "0.443\n0.49\n0.56\n")).unwrap_err();
        assert!(error.contains("look like micrometres"), "{error}");
        let error = grid(&write("mixed.txt", "443\n440\n490\n")).unwrap_err();
        assert!(error.contains("number 2 is 440 nm after 443 nm"), "{error}");
        assert!(grid("bands of mine.txt").unwrap_err().contains("there is no file"));
        assert!(wavelengths("measured").unwrap_err().ends_with("; or as-measured"));
    }
}

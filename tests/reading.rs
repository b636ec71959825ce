//! Files that other people's programs write, read to the last digit, or refused with the words that help: h5py, SciPy,
//! NumPy, pandas and zarr write them (`reading.py`), and say what is in them.
//!
//! The same files with bytes changed are errors or tables: never a panic, a hang, or memory without end.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use serde::Deserialize;
use spectroll::{DatasetError, Grid, ReadOptions, Reading, Table, WavelengthUnit};

#[derive(Deserialize)]
struct Case {
    name: String,
    wavelengths: Option<Vec<f64>>,
    spectra: Option<Vec<Vec<Option<f64>>>>,
    refused: Option<Vec<String>>,
    names: Option<Vec<String>>,
    unit: Option<String>,
}

/// Runs the script; returns what it says of its files.
fn cases(folder: &Path) -> Vec<Case> {
    let python = std::env::var("SPECTROLL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reading.py");
    let output =
        Command::new(python).arg(script).arg(folder).output().expect("SPECTROLL_PYTHON names a Python");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    print!("{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(folder.join("cases.json")).expect("the script writes it");
    serde_json::from_str(&text).expect("the script writes JSON")
}

/// Reads FILE:ARRAY@WAVELENGTHS.
fn read(folder: &Path, case: &Case) -> Result<Reading, DatasetError> {
    let (rest, wavelengths) =
        case.name.split_once('@').map_or((case.name.as_str(), None), |(a, b)| (a, Some(b)));
    let (file, array) = rest.split_once(':').map_or((rest, None), |(a, b)| (a, Some(b)));
    let grid = wavelengths.and_then(|text| text.parse::<Grid>().ok());
    let options = ReadOptions {
        array: array.map(str::to_owned),
        wavelength_array: wavelengths.filter(|_| grid.is_none()).map(str::to_owned),
        measured_at: grid.map(|grid| grid.wavelengths().collect()),
        unit: case.unit.as_deref().map(|_| WavelengthUnit::Um),
        ..ReadOptions::default()
    };
    Table::read(folder.join(file), &options)
}

fn assert_right(case: &Case, table: &Table) {
    let (wavelengths, spectra) = (case.wavelengths.as_ref().unwrap(), case.spectra.as_ref().unwrap());
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs().max(1e-3);
    assert_eq!((table.len(), table.wavelengths().len()), (spectra.len(), wavelengths.len()), "{}", case.name);
    if let Some(names) = &case.names {
        assert_eq!(table.names(), names, "{}", case.name);
    }
    for (band, expected) in wavelengths.iter().enumerate() {
        // Single precision of a wavelength is as the file has it.
        let found = table.wavelengths()[band];
        assert!((found - expected).abs() < 1e-4, "{}: {found} and not {expected} nm", case.name);
        for (spectrum, values) in spectra.iter().enumerate() {
            let found = table.spectrum(spectrum)[band];
            match values[band] {
                Some(value) => assert!(near(found, value), "{}: {found} and not {value}", case.name),
                None => assert!(found.is_nan(), "{}: {found} where nothing was measured", case.name),
            }
        }
    }
}

#[test]
fn files_of_other_programs_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let cases = cases(folder.path());
    assert!(cases.len() >= 40, "{} cases", cases.len());
    for case in &cases {
        match (read(folder.path(), case), &case.refused) {
            (Ok(reading), None) => assert_right(case, &reading.table),
            (Err(error), Some(words)) => {
                let text = error.to_string();
                assert!(words.iter().all(|word| text.contains(word)), "{}: {text}", case.name);
            }
            (Ok(reading), Some(words)) => {
                panic!("{}: read, and not refused with {words:?}: {reading:?}", case.name)
            }
            (Err(error), None) => panic!("{}: {error}", case.name),
        }
    }
}

/// Largest resident memory of this process so far, in bytes, where the system says so.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kilobytes| kilobytes << 10)
}

#[test]
fn damaged_files_are_errors_or_tables() {
    let folder = tempfile::tempdir().unwrap();
    let cases = cases(folder.path());
    let rounds: u64 = std::env::var("SPECTROLL_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(40);
    let mut state = 0x1234_5678_9abc_def1_u64;
    let mut random = move |n: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % n.max(1) as u64) as usize
    };
    let (mut read_count, mut refused) = (0, 0);
    for case in cases.iter().filter(|case| case.refused.is_none()) {
        let file = case.name.split(['@', ':']).next().unwrap();
        let path = folder.path().join(file);
        if path.is_dir() {
            continue;
        }
        let whole = std::fs::read(&path).unwrap();
        for round in 0..rounds {
            let mut bytes = whole.clone();
            match round % 4 {
                0 => bytes.truncate(random(whole.len())),
                // Heads have the sizes.
                1 => {
                    let at = random(whole.len().min(2048));
                    bytes[at] = [0, 1, 0x7f, 0xff][random(4)];
                }
                2 => {
                    for _ in 0..8 {
                        let at = random(whole.len());
                        bytes[at] ^= 1 << random(8);
                    }
                }
                _ => {
                    let at = random(whole.len().saturating_sub(8));
                    let end = (at + 8).min(whole.len());
                    bytes[at..end].fill(if random(2) == 0 { 0xff } else { 0 });
                }
            }
            std::fs::write(&path, &bytes).unwrap();
            let start = Instant::now();
            match read(folder.path(), case) {
                Ok(_) => read_count += 1,
                Err(_) => refused += 1,
            }
            let took = start.elapsed();
            assert!(took < Duration::from_secs(20), "{}, round {round}: {took:?}", case.name);
            if let Some(peak) = peak_memory() {
                assert!(peak < 1 << 30, "{}, round {round}: {peak} bytes of memory", case.name);
            }
        }
        std::fs::write(&path, &whole).unwrap();
    }
    println!("{read_count} damaged files were read, {refused} refused; peak memory {:?}", peak_memory());
    assert!(refused > 0);
}

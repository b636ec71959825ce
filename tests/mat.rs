//! MATLAB files as the field has them, written here byte by byte so that each oddity is one that the test names.

use std::io::Write;
use std::path::PathBuf;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use spectroll::{DatasetError, SpectrumKind, Table};

const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

/// The byte order of a file.
#[derive(Clone, Copy)]
enum Order {
    Little,
    Big,
}

impl Order {
    fn u32(self, value: u32) -> [u8; 4] {
        match self {
            Order::Little => value.to_le_bytes(),
            Order::Big => value.to_be_bytes(),
        }
    }

    fn f64(self, value: f64) -> [u8; 8] {
        match self {
            Order::Little => value.to_le_bytes(),
            Order::Big => value.to_be_bytes(),
        }
    }

    fn header(self) -> Vec<u8> {
        let mut header = b"MATLAB 5.0 MAT-file, written by a test".to_vec();
        header.resize(124, b' ');
        header.extend(match self {
            Order::Little => [0x00, 0x01, b'I', b'M'],
            Order::Big => [0x01, 0x00, b'M', b'I'],
        });
        header
    }

    fn element(self, kind: u32, payload: &[u8]) -> Vec<u8> {
        let mut bytes = [self.u32(kind), self.u32(payload.len() as u32)].concat();
        bytes.extend(payload);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    }

    /// An array of a class with these dimensions; what follows them is `rest`.
    fn array(self, name: &str, class: u32, rows: u32, columns: u32, rest: &[u8]) -> Vec<u8> {
        let flags = self.element(UINT32, &[self.u32(class), self.u32(0)].concat());
        let dimensions = self.element(INT32, &[self.u32(rows), self.u32(columns)].concat());
        self.element(MATRIX, &[flags, dimensions, self.element(1, name.as_bytes()), rest.to_vec()].concat())
    }

    fn doubles(self, name: &str, rows: usize, values: &[f64]) -> Vec<u8> {
        let bytes: Vec<u8> = values.iter().flat_map(|&v| self.f64(v)).collect();
        self.array(name, 6, rows as u32, (values.len() / rows) as u32, &self.element(DOUBLE, &bytes))
    }

    fn sampling(self, name: &str, grid: [f64; 3]) -> Vec<u8> {
        self.doubles(name, 1, &grid)
    }
}

fn compressed(order: Order, element: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(element).unwrap();
    let payload = encoder.finish().unwrap();
    [order.u32(COMPRESSED).to_vec(), order.u32(payload.len() as u32).to_vec(), payload].concat()
}

/// A file in a folder that lives as long as what is returned.
fn file(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.mat");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn open(bytes: &[u8], variable: Option<&str>) -> Result<Table, DatasetError> {
    let (_folder, path) = file(bytes);
    Table::open(&path, variable)
}

fn message(bytes: &[u8], variable: Option<&str>) -> String {
    open(bytes, variable).unwrap_err().to_string()
}

const GRID: [f64; 3] = [400.0, 10.0, 3.0];
const SPECTRA: [f64; 6] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];

#[test]
fn both_byte_orders_plain_and_compressed() {
    for order in [Order::Little, Order::Big] {
        let [spectra, sampling] = [order.doubles("sur_x", 3, &SPECTRA), order.sampling("S_x", GRID)];
        let plain = [order.header(), spectra.clone(), sampling.clone()].concat();
        let packed = [order.header(), compressed(order, &spectra), compressed(order, &sampling)].concat();
        for bytes in [plain, packed] {
            let table = open(&bytes, None).unwrap();
            assert_eq!((table.len(), table.kind()), (2, Some(SpectrumKind::Reflectance)));
            assert_eq!(table.wavelengths(), [400.0, 410.0, 420.0]);
            assert_eq!((table.spectrum(0), table.spectrum(1)), (&SPECTRA[..3], &SPECTRA[3..]));
        }
    }
}

#[test]
fn structs_cells_and_objects_are_stepped_over() {
    let order = Order::Little;
    let junk = [1u32, 2, 3, 4, 17].map(|class| order.array("labels", class, 1, 2, &[0xAB; 24]));
    let bytes =
        [order.header(), junk.concat(), order.doubles("spd_x", 3, &SPECTRA), order.sampling("S_x", GRID)];
    let table = open(&bytes.concat(), None).unwrap();
    assert_eq!((table.len(), table.kind()), (2, Some(SpectrumKind::Illuminant)));
}

#[test]
fn several_matrices_must_be_told_apart() {
    let order = Order::Little;
    let parts = [
        order.header(),
        order.doubles("sur_a", 3, &SPECTRA),
        order.sampling("S_a", GRID),
        order.doubles("sur_b", 3, &SPECTRA[..3]),
        order.sampling("S_b", [500.0, 5.0, 3.0]),
    ];
    let bytes = parts.concat();
    let ambiguous = message(&bytes, None);
    assert!(ambiguous.contains("several") && ambiguous.contains("x.mat:sur_a"), "{ambiguous}");
    assert_eq!(open(&bytes, Some("sur_b")).unwrap().wavelengths(), [500.0, 505.0, 510.0]);
    let absent = message(&bytes, Some("sur_c"));
    assert!(absent.contains("sur_a (3 x 2)") && absent.contains("sur_b (3 x 1)"), "{absent}");
}

#[test]
fn functions_to_integrate_with_stand_in_rows() {
    let order = Order::Little;
    // Two functions of three values each, in rows: columns run over wavelengths.
    let parts =
        [order.header(), order.doubles("T_x", 2, &[1., 4., 2., 5., 3., 6.]), order.sampling("S_x", GRID)];
    let table = open(&parts.concat(), None).unwrap();
    assert_eq!((table.spectrum(0), table.spectrum(1)), (&[1., 2., 3.][..], &[4., 5., 6.][..]));
}

#[test]
fn values_and_places_of_bad_data() {
    let order = Order::Little;
    let with = |value: f64| {
        let mut spectra = SPECTRA;
        spectra[4] = value;
        [order.header(), order.doubles("sur_x", 3, &spectra), order.sampling("S_x", GRID)].concat()
    };
    let missing = open(&with(f64::NAN), None).unwrap();
    assert!(missing.spectrum(1)[1].is_nan() && missing.missing() == 1);
    assert!(message(&with(f64::INFINITY), None).contains("410 nm is inf"));

    let lone = [order.header(), order.doubles("sur_x", 3, &SPECTRA)].concat();
    assert!(message(&lone, None).contains("does not say at which wavelengths its 3 bands are"));
    let other_length =
        [order.header(), order.doubles("sur_x", 3, &SPECTRA), order.sampling("S_x", [400., 10., 4.])];
    assert!(message(&other_length.concat(), None).contains("sur_x (3 x 2)"));
}

#[test]
fn other_versions_say_what_they_are() {
    #[cfg(feature = "hdf5")]
    {
        let v73 = [b"MATLAB 7.3 MAT-file".as_slice(), &[b' '; 600]].concat();
        assert!(message(&v73, None).contains("is not readable as HDF5"));
    }
    let v4 = |name: &str, rows: u32, values: &[f64]| {
        let head = [0, rows, values.len() as u32 / rows, 0, name.len() as u32 + 1].map(u32::to_le_bytes);
        let values: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        [head.concat(), name.as_bytes().to_vec(), vec![0], values].concat()
    };
    let table = open(&[v4("sur_x", 3, &SPECTRA), v4("S_x", 1, &GRID)].concat(), None).unwrap();
    assert_eq!((table.len(), table.spectrum(1)), (2, &SPECTRA[3..]));
    // Text under the name of a MATLAB file is read as text.
    assert!(
        message(b"not at all a MATLAB file, but long enough to look at", None)
            .contains("no table of numbers")
    );
    assert!(message(b"", None).contains("is empty"));
}

/// Every prefix of a file, and a file with each byte of its structure changed: an error or a table, never a panic.
#[test]
fn damaged_files_are_errors() {
    let order = Order::Little;
    let spectra = order.doubles("sur_x", 3, &SPECTRA);
    let whole = [order.header(), compressed(order, &spectra), spectra, order.sampling("S_x", GRID)].concat();
    for end in 0..whole.len() {
        let _ = open(&whole[..end], None);
    }
    for at in 124..whole.len() {
        for value in [0, 1, 0x7F, 0xFF] {
            let mut bytes = whole.clone();
            bytes[at] = value;
            let _ = open(&bytes, None);
        }
    }
}

/// 2 GiB of zeros pack into 2 MiB; unpacking stops at the cap.
#[test]
fn a_bomb_is_refused() {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    let block = vec![0; 1 << 20];
    for _ in 0..2048 {
        encoder.write_all(&block).unwrap();
    }
    let payload = encoder.finish().unwrap();
    let order = Order::Little;
    let element =
        [order.u32(COMPRESSED).to_vec(), order.u32(payload.len() as u32).to_vec(), payload].concat();
    let text = message(&[order.header(), element].concat(), None);
    assert!(text.contains("more than 512 MiB"), "{text}");
}

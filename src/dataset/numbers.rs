//! Numbers as files hold them: floats and integers of every width, in both orders of their bytes.

use std::io::{self, Read};

use half::f16;

/// Type of the numbers of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Number {
    pub(super) kind: NumberKind,
    /// Width in bytes.
    pub(super) bytes: usize,
    pub(super) big_endian: bool,
}

/// Kind of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NumberKind {
    /// IEEE 754: of 2, 4 or 8 bytes.
    Float,
    /// Two's complement: of 1, 2, 4 or 8 bytes.
    Signed,
    /// Of 1, 2, 4 or 8 bytes.
    Unsigned,
}

impl Number {
    /// The number of NumPy's name for it: `<f4`, `>i2`, `|u1`. None of any other type.
    pub(super) fn named(name: &str) -> Option<Number> {
        let (order, kind) = (name.get(..1)?, name.get(1..2)?);
        let bytes = name.get(2..)?.parse().ok()?;
        let kind = match (kind, bytes) {
            ("f", 2 | 4 | 8) => NumberKind::Float,
            ("i", 1 | 2 | 4 | 8) => NumberKind::Signed,
            ("u", 1 | 2 | 4 | 8) => NumberKind::Unsigned,
            _ => return None,
        };
        match order {
            "<" | ">" => {}
            "|" | "=" if bytes == 1 => {}
            _ => return None,
        }
        Some(Number { kind, bytes, big_endian: order == ">" })
    }

    /// The number of a name such as `float32` or `uint8`, in this order.
    pub(super) fn spelled(name: &str, big_endian: bool) -> Option<Number> {
        let start = name.find(|c: char| c.is_ascii_digit())?;
        let bits: usize = name[start..].parse().ok()?;
        let kind = match (&name[..start], bits) {
            ("float", 16 | 32 | 64) => NumberKind::Float,
            ("int", 8 | 16 | 32 | 64) => NumberKind::Signed,
            ("uint", 8 | 16 | 32 | 64) => NumberKind::Unsigned,
            _ => return None,
        };
        Some(Number { kind, bytes: bits / 8, big_endian })
    }

    /// Reads as many bytes as a number has.
    pub(super) fn read(self, bytes: &[u8]) -> f64 {
        let mut word = [0; 8];
        for (i, &byte) in bytes.iter().enumerate() {
            word[if self.big_endian { self.bytes - 1 - i } else { i }] = byte;
        }
        let bits = u64::from_le_bytes(word);
        match (self.kind, self.bytes) {
            (NumberKind::Float, 2) => f16::from_bits(bits as u16).to_f64(),
            (NumberKind::Float, 4) => f64::from(f32::from_bits(bits as u32)),
            (NumberKind::Float, _) => f64::from_bits(bits),
            (NumberKind::Unsigned, _) => bits as f64,
            (NumberKind::Signed, bytes) => {
                let unused = 64 - 8 * bytes as u32;
                ((bits << unused) as i64 >> unused) as f64
            }
        }
    }

    /// Reads all numbers of these bytes; an incomplete one at the end is left.
    pub(super) fn read_all(self, bytes: &[u8]) -> Vec<f64> {
        let mut values = Vec::with_capacity(bytes.len() / self.bytes);
        self.add(bytes, &mut values);
        values
    }

    /// Reads as many numbers from a source, a part at a time: of a large file, memory that is new to the process costs
    /// as much as the reading does.
    pub(super) fn read_from(self, source: &mut impl Read, count: usize) -> io::Result<Vec<f64>> {
        const PART: usize = 1 << 16;
        let mut values = Vec::new();
        values.try_reserve_exact(count)?;
        let mut part = vec![0; PART.min(count * self.bytes)];
        let mut left = count * self.bytes;
        while left > 0 {
            let part = &mut part[..PART.min(left)];
            source.read_exact(part)?;
            self.add(part, &mut values);
            left -= part.len();
        }
        Ok(values)
    }

    /// Reads all numbers of these bytes behind those that are there.
    pub(super) fn add(self, bytes: &[u8], values: &mut Vec<f64>) {
        match (self.kind, self.bytes, self.big_endian) {
            (NumberKind::Float, 8, false) => {
                values.extend(bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)));
            }
            (NumberKind::Float, 4, false) => {
                values.extend(bytes.as_chunks().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))));
            }
            (NumberKind::Unsigned, 2, false) => {
                values.extend(bytes.as_chunks().0.iter().map(|b| f64::from(u16::from_le_bytes(*b))));
            }
            _ => values.extend(bytes.chunks_exact(self.bytes).map(|b| self.read(b))),
        }
    }
}

/// A matrix of as many columns, row by row, with its rows and columns exchanged. It goes by tiles: of a large matrix, each
/// value of a column lies in a page of its own.
pub(super) fn transposed(values: &[f64], columns: usize) -> Vec<f64> {
    const TILE: usize = 32;
    let rows = values.len() / columns.max(1);
    let mut turned = vec![0.0; values.len()];
    for (first, corner) in
        (0..rows).step_by(TILE).flat_map(|row| (0..columns).step_by(TILE).map(move |column| (row, column)))
    {
        for row in first..rows.min(first + TILE) {
            for column in corner..columns.min(corner + TILE) {
                turned[column * rows + row] = values[row * columns + column];
            }
        }
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_orders() {
        assert_eq!(Number::named("<i2").unwrap().read(&(-5i16).to_le_bytes()), -5.0);
        assert_eq!(Number::named(">i8").unwrap().read(&(-5i64).to_be_bytes()), -5.0);
        assert_eq!(Number::spelled("uint16", true).unwrap().read_all(&[1, 0, 0, 2, 9]), [256.0, 2.0]);
        assert_eq!(Number::spelled("float32", false).unwrap().read_all(&0.5f32.to_le_bytes()), [0.5]);
        assert_eq!((Number::named("<c8"), Number::spelled("complex64", false)), (None, None));
    }

    #[test]
    fn matrices_of_any_size_are_turned() {
        for (rows, columns) in [(1, 5), (5, 1), (33, 70), (64, 32)] {
            let values: Vec<f64> = (0..rows * columns).map(|i| i as f64).collect();
            let turned = transposed(&values, columns);
            assert!(
                (0..rows).all(|r| (0..columns).all(|c| turned[c * rows + r] == values[r * columns + c])),
                "{rows} x {columns}"
            );
            assert_eq!(transposed(&turned, rows), values);
        }
    }
}

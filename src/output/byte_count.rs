//! Numbers of bytes as people write them.

use std::fmt;

/// A number of bytes, which prints in decimal units with three digits: `124 TB`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ByteCount(pub u64);

impl fmt::Display for ByteCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ByteCount(bytes) = *self;
        match bytes {
            1 => return f.write_str("1 byte"),
            0..1000 => return write!(f, "{bytes} bytes"),
            _ => {}
        }
        let mut value = bytes as f64;
        let mut units = ["kB", "MB", "GB", "TB", "PB", "EB"].into_iter();
        let mut unit = "bytes";
        // A value that rounds to 1000 is 1 of the next unit.
        while value >= 999.5
            && let Some(next) = units.next()
        {
            (value, unit) = (value / 1000.0, next);
        }
        let scale = match value {
            99.95.. => 1.0,
            9.995.. => 10.0,
            _ => 100.0,
        };
        write!(f, "{} {unit}", (value * scale).round() / scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_enough() {
        for (bytes, text) in [
            (0, "0 bytes"),
            (1, "1 byte"),
            (999, "999 bytes"),
            (1000, "1 kB"),
            (1234, "1.23 kB"),
            (48_040_000_000, "48 GB"),
            (999_999, "1 MB"),
            (99_960, "100 kB"),
            (124_000_000_000_000, "124 TB"),
            (u64::MAX, "18.4 EB"),
        ] {
            assert_eq!(ByteCount(bytes).to_string(), text);
        }
    }
}

//! Values as they are typed, and numbers as they are printed.

use std::num::NonZeroUsize;

use indicatif::{DecimalBytes, HumanCount};

/// A number of threads: more than any machine has cores would only take long to start.
pub(super) fn threads(text: &str) -> Result<NonZeroUsize, String> {
    let threads = text.parse().ok().filter(|threads| (1..=1024).contains(threads));
    threads.and_then(NonZeroUsize::new).ok_or_else(|| "expected 1 to 1024".to_owned())
}

/// A count: digits, with `_` between them as one likes, or a whole number like 1e6.
pub(super) fn count(text: &str) -> Result<u64, String> {
    let digits = text.replace('_', "");
    if let Ok(count) = digits.parse() {
        return Ok(count);
    }
    match digits.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.fract() == 0.0 && value < 2f64.powi(64) => Ok(value as u64),
        _ => Err("expected a whole number, like 1000000 or 1e6".to_owned()),
    }
}

/// A seed: a number, or `random` for one that the operating system draws. Parse it once: another time is another seed.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    match text {
        "random" => getrandom::u64().map_err(|e| format!("the operating system gives no random number: {e}")),
        number => {
            number.parse().map_err(|_| "expected a whole number from 0 to 2^64 - 1, or random".to_owned())
        }
    }
}

/// A number with its thousands set apart.
pub(super) fn grouped(n: u64) -> String {
    HumanCount(n).to_string()
}

/// Bytes in the unit that suits them.
pub(super) fn size(bytes: u64) -> String {
    DecimalBytes(bytes).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_numbers_or_random() {
        assert_eq!(seed("18446744073709551615"), Ok(u64::MAX));
        for text in ["-1", "18446744073709551616", "1.5", "", "Random"] {
            assert_eq!(seed(text).unwrap_err(), "expected a whole number from 0 to 2^64 - 1, or random");
        }
        let drawn: std::collections::BTreeSet<_> = (0..8).map(|_| seed("random").unwrap()).collect();
        assert_eq!(drawn.len(), 8);
    }
}

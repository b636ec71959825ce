//! Values as they are typed, and numbers as they are printed.

use std::num::NonZeroUsize;

use spectroll::output::ByteCount;

/// A number of threads: more than any machine has cores would only take long to start.
pub(super) fn threads(text: &str) -> Result<NonZeroUsize, String> {
    let threads = text.parse().ok().filter(|threads| (1..=1024).contains(threads));
    threads.and_then(NonZeroUsize::new).ok_or_else(|| "expected 1 to 1024".to_owned())
}

/// A count: digits, with `_` between them as one likes, or a whole number like 1e6, 10M or 1.5k.
pub(super) fn count(text: &str) -> Result<u64, String> {
    let text = text.replace('_', "");
    whole(&text).ok_or_else(|| "expected a whole number, like 1000000, 1e6 or 1M".to_owned())
}

/// A whole number with a power of ten behind it, digit by digit: 1.1M as a float would be a little more.
fn whole(text: &str) -> Option<u64> {
    let suffixes = [('k', 3), ('M', 6), ('G', 9), ('T', 12)];
    let suffix = suffixes.into_iter().find_map(|(unit, power)| Some((text.strip_suffix(unit)?, power)));
    let (decimal, power) = match (suffix, text.split_once(['e', 'E'])) {
        (Some(found), _) => found,
        (None, Some((decimal, power))) => (decimal, power.parse::<usize>().ok()?),
        (None, None) => (text, 0),
    };
    let (integer, fraction) = decimal.split_once('.').unwrap_or((decimal, ""));
    let fraction = fraction.trim_end_matches('0');
    let zeros = power.checked_sub(fraction.len())?;
    let digits = integer.to_owned() + fraction;
    // More zeros than u64 has digits are too many for all but 0.
    let is_digits = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit());
    let factor = 10u64.checked_pow(zeros.min(20).try_into().ok()?);
    match digits.parse::<u64>() {
        Ok(0) if is_digits => Some(0),
        Ok(value) if is_digits => value.checked_mul(factor?),
        _ => None,
    }
}

/// A whole number that is no count of things, as seeds are.
pub(super) fn number(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| "expected a whole number from 0 to 2^64 - 1".to_owned())
}

/// A number of attempts. What is out of range is left to the recipe.
pub(super) fn attempts(text: &str) -> Result<u32, String> {
    let attempts = count(text).ok().and_then(|attempts| u32::try_from(attempts).ok());
    attempts.ok_or_else(|| "expected a whole number from 1 to 2^31 - 1".to_owned())
}

/// A factor, whatever its sign.
pub(super) fn factor(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| "expected a number, as in 1.5".to_owned())
}

/// A share of something.
pub(super) fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "expected a share from 0 to 1".to_owned())
}

/// A whole number between two others.
pub(super) fn between<const LOW: u64, const HIGH: u64>(text: &str) -> Result<u32, String> {
    let number = text.parse().ok().filter(|&number| (LOW..=HIGH).contains(&u64::from(number)));
    number.ok_or_else(|| format!("expected a whole number from {LOW} to {HIGH}"))
}

/// A seed: a number, or `random` for one that the operating system draws. Parse it once: another time is another seed.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    match text {
        "random" => getrandom::u64().map_err(|e| format!("the operating system gives no random number: {e}")),
        text => number(text).map_err(|expected| format!("{expected}, or random")),
    }
}

/// Bytes in the unit that suits them.
pub(super) fn size(bytes: u64) -> String {
    ByteCount(bytes).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_whole_numbers_with_powers_of_ten() {
        for (text, value) in [
            ("0", 0),
            ("1_000_000", 1_000_000),
            ("1e6", 1_000_000),
            ("1k", 1000),
            ("10M", 10_000_000),
            ("1G", 1_000_000_000),
            ("2T", 2_000_000_000_000),
            ("1.1M", 1_100_000),
            ("1.50k", 1500),
            ("2.5e3", 2500),
            ("5.0", 5),
            ("0e99", 0),
            ("18446744073709551615", u64::MAX),
        ] {
            assert_eq!(count(text), Ok(value), "{text}");
        }
        for text in [
            "",
            "k",
            "-5",
            "1.5",
            "1.0005k",
            "1e20",
            "18446744073709551616",
            "1K",
            "1kk",
            "1e6k",
            "e6",
            "+1",
            "inf",
        ] {
            assert_eq!(
                count(text).unwrap_err(),
                "expected a whole number, like 1000000, 1e6 or 1M",
                "{text}"
            );
        }
    }

    #[test]
    fn numbers_say_what_they_take() {
        assert_eq!(number("18446744073709551615"), Ok(u64::MAX));
        assert_eq!(number("-1").unwrap_err(), "expected a whole number from 0 to 2^64 - 1");
        assert_eq!((attempts("1e6"), between::<1, 22>("22")), (Ok(1_000_000), Ok(22)));
        for text in ["-1", "many", "4294967296"] {
            assert_eq!(attempts(text).unwrap_err(), "expected a whole number from 1 to 2^31 - 1");
        }
        assert_eq!((share("1e-4"), share("1")), (Ok(1e-4), Ok(1.0)));
        for text in ["-0.1", "1.1", "nan", "all"] {
            assert_eq!(share(text).unwrap_err(), "expected a share from 0 to 1");
        }
        for text in ["-1", "0", "23", "most"] {
            assert_eq!(between::<1, 22>(text).unwrap_err(), "expected a whole number from 1 to 22");
        }
        assert_eq!(
            (factor("-1"), factor("x").unwrap_err()),
            (Ok(-1.0), "expected a number, as in 1.5".to_owned())
        );
    }

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

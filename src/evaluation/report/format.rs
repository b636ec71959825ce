//! Numbers as text.

use super::chart::superscript;

/// Formats a number to two digits, with a power of ten where it needs one.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = value.abs().log10().floor() as i32;
    match exponent {
        -2..=-1 => format!("{value:.3}"),
        0..=1 => format!("{value:.2}"),
        2..=4 => format!("{value:.0}"),
        _ => {
            let (digits, exponent) = decimal(value, exponent);
            format!("{digits:.1} × 10{}", superscript(exponent))
        }
    }
}

/// A value rounded to two digits, between 1 and 10, and its power of ten: rounding may carry into the next one.
fn decimal(value: f64, exponent: i32) -> (f64, i32) {
    let digits = (10.0 * value / 10f64.powi(exponent)).round() / 10.0;
    if digits.abs() < 10.0 { (digits, exponent) } else { (digits / 10.0, exponent + 1) }
}

/// Formats a duration: seconds, or minutes where there are several.
pub(super) fn duration(seconds: f64) -> String {
    match seconds {
        ..9.95 => format!("{seconds:.1} s"),
        ..119.5 => format!("{seconds:.0} s"),
        _ => format!("{:.0} min", seconds / 60.0),
    }
}

/// Makes a name that any file system takes.
pub(super) fn file_stem(name: &str) -> String {
    let stem = std::path::Path::new(name).file_stem().unwrap_or_default().to_string_lossy();
    stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 1.234e-7, 0.0123, 1.5, 99_960.0, 9.96e5, 1e9, -9.99e-5, 1e-300].map(number);
        assert_eq!(
            texts,
            [
                "0",
                "1.2 × 10⁻⁷",
                "0.012",
                "1.50",
                "99960",
                "1.0 × 10⁶",
                "1.0 × 10⁹",
                "-1.0 × 10⁻⁴",
                "1.0 × 10⁻³⁰⁰"
            ]
        );
        assert_eq!([3.0, 61.2, 130.0].map(duration), ["3.0 s", "61 s", "2 min"]);
        assert_eq!(file_stem("a/my model.json"), "my-model");
    }
}

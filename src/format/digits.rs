//! Numbers as text.

use std::fmt::{Display, LowerExp};

/// A whole number with its thousands apart, as in 1 234 567.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let groups = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy);
    groups.collect::<Vec<_>>().join(" ")
}

/// `count` and its `noun`, with an s unless it is one thing.
pub fn plural(count: usize, noun: &str) -> String {
    format!("{} {noun}{}", grouped(count as u64), if count == 1 { "" } else { "s" })
}

/// `value` with four digits of a number of about `unit`, or all digits before the point, without trailing zeros.
pub fn rounded(value: f64, unit: f64) -> String {
    let places = (3.0 - unit.abs().max(1e-14).log10().floor()).clamp(0.0, 17.0) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A number of at most four significant digits, or all digits before the point, without trailing zeros.
pub fn short(value: f64) -> String {
    rounded(value, value)
}

/// A number, with an exponent if it would have many digits.
pub fn number<T: Copy + Into<f64> + Display + LowerExp>(value: T) -> String {
    let size = value.into().abs();
    let is_short = size == 0.0 || !size.is_finite() || (1e-5..1e16).contains(&size);
    if is_short { value.to_string() } else { format!("{value:e}") }
}

/// Numbers in parentheses, as in (0, 0.5, 1e300).
pub fn numbers<T: Copy + Into<f64> + Display + LowerExp>(values: impl IntoIterator<Item = T>) -> String {
    format!("({})", values.into_iter().map(number).collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_has_hundreds_of_digits() {
        assert_eq!(numbers([0.0, -0.5, f64::MAX, 1e-300, 1234.5]), "(0, -0.5, 1.7976931348623157e308, 1e-300, 1234.5)");
        assert_eq!(numbers([0.1f32, f32::NAN, f32::NEG_INFINITY]), "(0.1, NaN, -inf)");
        assert_eq!(number(1e16), "1e16");
    }

    #[test]
    fn numbers_have_four_digits_of_their_unit() {
        let found =
            [2.015564437074636, 0.4782533826, -0.949999988, 12345.678, 0.0, 1.5e-7, 2.0, f64::INFINITY].map(short);
        assert_eq!(found, ["2.016", "0.4783", "-0.95", "12346", "0", "0.00000015", "2", "inf"]);
        assert_eq!(rounded(1.5, 10.0), "1.5");
        assert_eq!(rounded(0.001_234_56, 1.0), "0.001");
    }

    #[test]
    fn one_thing_has_no_s() {
        assert_eq!([0, 1, 1000].map(|n| plural(n, "picture")), ["0 pictures", "1 picture", "1 000 pictures"]);
    }

    #[test]
    fn thousands_are_apart() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1 000", "1 234 567"]);
    }
}

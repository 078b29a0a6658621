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
    fn thousands_are_apart() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1 000", "1 234 567"]);
    }
}

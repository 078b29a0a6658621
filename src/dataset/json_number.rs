//! Numbers of JSON as Python writes them: NaN and infinities, too.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, Visitor};

/// The words for numbers that JSON has not, longer ones first.
const WORDS: [(&str, f64); 3] = [("-Infinity", f64::NEG_INFINITY), ("Infinity", f64::INFINITY), ("NaN", f64::NAN)];

/// A number, which need not be finite: null is NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Number(f64);

impl From<Number> for f64 {
    fn from(Number(value): Number) -> Self {
        value
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor)
    }
}

struct NumberVisitor;

impl Visitor<'_> for NumberVisitor {
    type Value = Number;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number")
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Number, E> {
        Ok(Number(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Number, E> {
        Ok(Number(value as f64))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Number, E> {
        Ok(Number(value as f64))
    }

    fn visit_unit<E: Error>(self) -> Result<Number, E> {
        Ok(Number(f64::NAN))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Number, E> {
        let number = WORDS.iter().find(|(word, _)| *word == text);
        number.map(|(_, value)| Number(*value)).ok_or_else(|| E::invalid_type(serde::de::Unexpected::Str(text), &self))
    }
}

/// `json` with quotes around the words for numbers that JSON has not; `None` if it has none.
pub(super) fn with_quoted_numbers(json: &[u8]) -> Option<Vec<u8>> {
    let mut quoted = Vec::with_capacity(json.len() + 64);
    let (mut at, mut is_text, mut has_words) = (0, false, false);
    while at < json.len() {
        let word = if is_text { None } else { WORDS.iter().find(|(word, _)| json[at..].starts_with(word.as_bytes())) };
        if let Some((word, _)) = word {
            quoted.extend([b"\"", word.as_bytes(), b"\""].concat());
            (at, has_words) = (at + word.len(), true);
            continue;
        }
        // An escaped quote does not end a text.
        let length = if is_text && json[at] == b'\\' { 2.min(json.len() - at) } else { 1 };
        is_text ^= json[at] == b'"';
        quoted.extend(&json[at..at + length]);
        at += length;
    }
    has_words.then_some(quoted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_need_not_be_finite_and_texts_stay() {
        let json = br#"{"a NaN \" NaN": [NaN, -Infinity, Infinity, 1, -2, 0.5, null]}"#;
        let quoted = with_quoted_numbers(json).unwrap();
        let read: std::collections::BTreeMap<String, Vec<Number>> = serde_json::from_slice(&quoted).unwrap();
        let numbers: Vec<f64> = read["a NaN \" NaN"].iter().map(|&number| number.into()).collect();
        assert_eq!(numbers[1..6], [f64::NEG_INFINITY, f64::INFINITY, 1.0, -2.0, 0.5]);
        assert!(numbers[0].is_nan() && numbers[6].is_nan(), "{numbers:?}");
        assert_eq!(with_quoted_numbers(br#"{"NaN": 1}"#), None);
        assert!(serde_json::from_str::<Number>("\"1\"").is_err() && serde_json::from_str::<Number>("[1]").is_err());
    }
}

//! Texts of untrusted files, made safe to print (spec 10).

use std::fmt::Write;

/// `text` with its control characters, and those that change the direction of text, escaped as in `\u{1b}`.
pub fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() || is_direction(c) {
            // Writing to a string cannot fail.
            let _ = write!(escaped, "{}", c.escape_default());
        } else {
            escaped.push(c);
        }
    }
    escaped
}

/// True for marks, embeddings, overrides and isolates of text direction, and for separators of lines and paragraphs.
fn is_direction(c: char) -> bool {
    matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_are_escaped_and_other_characters_are_kept() {
        assert_eq!(escaped("Zürich, 東京 \"x\" \\"), "Zürich, 東京 \"x\" \\");
        assert_eq!(escaped("a\u{1b}[2J\n\u{202e}b\u{9b}"), "a\\u{1b}[2J\\n\\u{202e}b\\u{9b}");
    }
}

//! Texts of untrusted files, made safe to show (spec 10).

use std::fmt::Write as _;
use std::path::Path;

/// `text` in one line, with its unsafe characters escaped as in `\u{1b}`: control characters, those that change the
/// direction of text, separators of lines and paragraphs, and invisible ones.
pub fn escaped(text: &str) -> String {
    with_escapes(text, is_unsafe, |c| c.escape_default())
}

/// [`escaped`], but line feeds stay: for text of several lines whose parts are escaped.
pub fn escaped_lines(text: &str) -> String {
    with_escapes(text, |c| c != '\n' && is_unsafe(c), |c| c.escape_default())
}

/// [`escaped`], of the name of a file.
pub fn escaped_path(path: &Path) -> String {
    escaped(&path.to_string_lossy())
}

/// The JSON document `json` with its unsafe characters in JSON's escapes. They can only be in strings: outside of
/// these, JSON has no such character but the line feed, which stays.
pub fn escaped_json(json: &str) -> String {
    let escape = |c: char| c.encode_utf16(&mut [0; 2]).iter().map(|unit| format!("\\u{unit:04x}")).collect::<String>();
    with_escapes(json, |c| c != '\n' && is_unsafe(c), escape)
}

fn with_escapes<E: std::fmt::Display>(
    text: &str,
    is_escaped: impl Fn(char) -> bool,
    escape: impl Fn(char) -> E,
) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        if is_escaped(c) {
            // Writing to a string cannot fail.
            let _ = write!(escaped, "{}", escape(c));
        } else {
            escaped.push(c);
        }
    }
    escaped
}

/// True for characters that move the cursor, hide or reorder text, or are invisible. `tools/web/src/dom.ts` and
/// `format-spec/reader/strivec_reader/__main__.py` have the same list.
fn is_unsafe(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_are_escaped_and_other_characters_are_kept() {
        assert_eq!(escaped("Zürich, 東京 \"x\" \\"), "Zürich, 東京 \"x\" \\");
        assert_eq!(escaped("a\u{1b}[2J\n\u{202e}b\u{9b}"), "a\\u{1b}[2J\\n\\u{202e}b\\u{9b}");
        for c in "\0\u{7f}\u{85}\u{200b}\u{200e}\u{2028}\u{2029}\u{2066}\u{2069}\u{61c}\u{feff}\u{e0041}".chars() {
            assert!(escaped(&c.to_string()).is_ascii(), "{:x}", u32::from(c));
        }
        assert_eq!(escaped_lines("a\r\nb"), "a\\r\nb");
    }

    #[test]
    fn escaped_json_has_the_same_values() {
        let value = "\u{1b}\u{9b}\r\n\u{202e}\u{e0041}東京";
        let json = serde_json::to_string_pretty(&[value]).unwrap();
        let escaped = escaped_json(&json);
        assert!(escaped.chars().all(|c| c == '\n' || !is_unsafe(c)), "{escaped:?}");
        assert_eq!(serde_json::from_str::<[String; 1]>(&escaped).unwrap(), [value]);
    }
}

//! The statements of an OBJ file: lines without comments; a backslash at the end of a line continues it.

use glam::DVec3;
use std::fmt::Display;
use strivec_format::Place;

use super::super::error::excerpt;
use super::super::{Fault, Input, Point, Visitor};
use strivec_format::color::byte;

/// Bytes of one statement: room for a polygon of a million corners.
const MAX_BYTES: usize = 1 << 24;

pub(super) struct Statements<'i, 'a> {
    input: &'i mut Input<'a>,
    text: Vec<u8>,
    /// Buffer for a continuation line.
    more: Vec<u8>,
    /// First line of the statement, from 1, and number of lines read.
    line: u64,
    lines: u64,
}

impl<'i, 'a> Statements<'i, 'a> {
    /// The statements of `input` from its beginning, without a byte order mark.
    ///
    /// # Errors
    ///
    /// If the text is UTF-16.
    pub(super) fn from_start(input: &'i mut Input<'a>) -> Result<Self, Fault> {
        input.go_to(0)?;
        if matches!(input.peek(2)?[..], [0xff, 0xfe] | [0xfe, 0xff]) {
            return Err(Fault::unsupported("text in UTF-16", "save it as UTF-8"));
        }
        if input.peek(3)? == b"\xef\xbb\xbf" {
            input.go_to(3)?;
        }
        Ok(Self { input, text: Vec::new(), more: Vec::new(), line: 0, lines: 0 })
    }

    /// Reads the next statement, which may be blank. Returns false at the end.
    pub(super) fn advance(&mut self, visitor: &mut dyn Visitor) -> Result<bool, Fault> {
        self.input.report(visitor)?;
        if !self.input.line(&mut self.text, MAX_BYTES)? {
            return Ok(false);
        }
        self.lines += 1;
        self.line = self.lines;
        cut_comment(&mut self.text);
        while self.text.last() == Some(&b'\\') {
            self.text.pop();
            if !self.input.line(&mut self.more, MAX_BYTES)? {
                break;
            }
            self.lines += 1;
            cut_comment(&mut self.more);
            self.text.push(b' ');
            self.text.append(&mut self.more);
            Fault::unless_within("bytes of a statement", MAX_BYTES as u64, self.text.len() as u64)?;
            self.input.report(visitor)?;
        }
        Ok(true)
    }

    /// The line on which the statement begins, from 1.
    pub(super) fn line(&self) -> u64 {
        self.line
    }

    /// The keyword; empty if the statement is blank.
    pub(super) fn keyword(&self) -> &[u8] {
        words(&self.text).next().unwrap_or_default()
    }

    /// The words after the keyword.
    pub(super) fn words(&self) -> impl Iterator<Item = &[u8]> {
        words(&self.text).skip(1)
    }

    /// The vertex of this statement: three coordinates, then nothing, a weight that divides them, or a color.
    pub(super) fn vertex(&self) -> Result<Point, Fault> {
        let mut values = [0.0; 6];
        let mut count = 0;
        for word in self.words() {
            let value = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
            match (values.get_mut(count), value) {
                (Some(slot), Some(value)) => *slot = value,
                _ => return Err(self.wrong("v and 3, 4 or 6 numbers")),
            }
            count += 1;
        }
        let [x, y, z, a, b, c] = values;
        let (position, color) = match count {
            3 => (DVec3::new(x, y, z), None),
            4 => (DVec3::new(x, y, z) / a, None),
            6 => (DVec3::new(x, y, z), Some(color(DVec3::new(a, b, c)))),
            _ => return Err(self.wrong("v and 3, 4 or 6 numbers")),
        };
        Point::new(position, color, || format!("line {}", self.line))
    }

    /// The fault that this statement is not `expected`.
    pub(super) fn wrong(&self, expected: impl Display) -> Fault {
        Fault::malformed(Place::Line(self.line), expected, excerpt(&self.text))
    }
}

fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

fn cut_comment(line: &mut Vec<u8>) {
    if let Some(start) = line.iter().position(|&b| b == b'#') {
        line.truncate(start);
    }
}

/// A color in \[0, 1\] as bytes.
pub(super) fn color(channels: DVec3) -> [u8; 3] {
    channels.to_array().map(byte)
}

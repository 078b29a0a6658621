//! The values after a PLY header, in any encoding: the selected properties of each record of an element.

use std::fmt;
use std::io::BufRead;

use super::super::error::excerpt;
use super::super::{Fault, Input, Visitor};
use super::header::{BodyEncoding, Kind, PlyElement, PlyHeader, PlyScalar};

/// Bytes of one read; more than the largest record without lists.
const CHUNK: usize = 1 << 16;
/// Bytes of one number of an ASCII file.
const MAX_TOKEN: usize = 1024;

/// A position in the file, for errors.
#[derive(Clone, Copy, Debug)]
pub(super) enum BodyOffset {
    Line(u64),
    Byte(u64),
}

impl fmt::Display for BodyOffset {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(formatter, "line {line}"),
            Self::Byte(byte) => write!(formatter, "byte {byte}"),
        }
    }
}

/// A position in the file to return to.
pub(super) struct Mark {
    offset: u64,
    line: u64,
}

pub(super) struct BodyReader<'i, 'a> {
    input: &'i mut Input<'a>,
    encoding: BodyEncoding,
    /// Last byte of a line.
    line_end: u8,
    /// Number of the current line, from 1.
    line: u64,
    token: Vec<u8>,
    chunk: Vec<u8>,
}

impl<'i, 'a> BodyReader<'i, 'a> {
    /// The body after `header`.
    pub(super) fn new(input: &'i mut Input<'a>, header: &PlyHeader) -> Self {
        let PlyHeader { encoding, lines, line_end, .. } = *header;
        Self { input, encoding, line_end, line: lines + 1, token: Vec::new(), chunk: vec![0; CHUNK] }
    }

    pub(super) fn mark(&self) -> Mark {
        Mark { offset: self.input.offset(), line: self.line }
    }

    pub(super) fn go_back(&mut self, mark: &Mark) -> Result<(), Fault> {
        self.line = mark.line;
        self.input.go_to(mark.offset)
    }

    /// Calls `each` for each record with the values of the properties `wanted`, in that order, and the record's place.
    pub(super) fn records(
        &mut self,
        element: &PlyElement,
        wanted: &[usize],
        visitor: &mut dyn Visitor,
        mut each: impl FnMut(&mut dyn Visitor, &[f64], BodyOffset) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        match element.record_size() {
            Some(size) if self.encoding != BodyEncoding::Ascii => {
                self.even_records(element, size, wanted, visitor, each)
            }
            _ => {
                let slot = |n| wanted.iter().position(|&property| property == n);
                let slots: Vec<Option<usize>> = (0..element.properties.len()).map(slot).collect();
                let mut values = vec![0.0; wanted.len()];
                for _ in 0..element.count {
                    let place = self.record(element, |body, n, kind| match (kind, slots[n]) {
                        (Kind::Scalar(scalar), Some(slot)) => {
                            values[slot] = body.number(scalar)?;
                            Ok(())
                        }
                        _ => body.skip_value(kind),
                    })?;
                    each(visitor, &values, place)?;
                    self.input.report(visitor)?;
                }
                Ok(())
            }
        }
    }

    /// [`BodyReader::records`] of `size` bytes each.
    fn even_records(
        &mut self,
        element: &PlyElement,
        size: usize,
        wanted: &[usize],
        visitor: &mut dyn Visitor,
        mut each: impl FnMut(&mut dyn Visitor, &[f64], BodyOffset) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let mut starts = Vec::with_capacity(element.properties.len());
        let mut start = 0;
        for property in &element.properties {
            let Kind::Scalar(scalar) = property.kind else { continue };
            starts.push((start, scalar));
            start += scalar.size();
        }
        let fields: Vec<(usize, PlyScalar)> = wanted.iter().map(|&property| starts[property]).collect();
        let mut values = vec![0.0; wanted.len()];
        let big_endian = self.encoding == BodyEncoding::BigEndian;
        let mut left = element.count;
        while left > 0 {
            let records = left.min((CHUNK / size) as u64);
            let chunk = &mut self.chunk[..records as usize * size];
            let mut place = self.input.offset();
            self.input.fill(chunk, &element.name)?;
            for record in chunk.chunks_exact(size) {
                for (value, &(start, scalar)) in values.iter_mut().zip(&fields) {
                    *value = scalar.decode(&record[start..], big_endian);
                }
                each(visitor, &values, BodyOffset::Byte(place))?;
                place += size as u64;
            }
            left -= records;
            self.input.report(visitor)?;
        }
        Ok(())
    }

    /// Calls `each` for each item of the list property `list`; the flag is true for the first item of a list.
    pub(super) fn items(
        &mut self,
        element: &PlyElement,
        list: usize,
        visitor: &mut dyn Visitor,
        mut each: impl FnMut(&mut dyn Visitor, bool, f64, BodyOffset) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        for _ in 0..element.count {
            self.record(element, |body, n, kind| match kind {
                Kind::List { count, item } if n == list => body.list(count, item, visitor, &mut each),
                _ => body.skip_value(kind),
            })?;
            self.input.report(visitor)?;
        }
        Ok(())
    }

    fn list(
        &mut self,
        count: PlyScalar,
        item: PlyScalar,
        visitor: &mut dyn Visitor,
        each: &mut impl FnMut(&mut dyn Visitor, bool, f64, BodyOffset) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let place = self.place();
        let mut left = self.length(count, item)?;
        let mut first = true;
        if self.encoding == BodyEncoding::Ascii {
            for _ in 0..left {
                let value = self.number(item)?;
                each(visitor, first, value, self.place())?;
                first = false;
                self.input.report(visitor)?;
            }
            return Ok(());
        }
        let big_endian = self.encoding == BodyEncoding::BigEndian;
        while left > 0 {
            let items = left.min((CHUNK / item.size()) as u64);
            let chunk = &mut self.chunk[..items as usize * item.size()];
            self.input.fill(chunk, "a list")?;
            for bytes in chunk.chunks_exact(item.size()) {
                each(visitor, first, item.decode(bytes, big_endian), place)?;
                first = false;
            }
            left -= items;
            self.input.report(visitor)?;
        }
        Ok(())
    }

    /// Skips all records of `element`.
    pub(super) fn skip(&mut self, element: &PlyElement, visitor: &mut dyn Visitor) -> Result<(), Fault> {
        match element.record_size() {
            Some(size) if self.encoding != BodyEncoding::Ascii => {
                // `check_counts` has checked that all records fit into the file.
                self.skip_bytes(element.count.saturating_mul(size as u64), &element.name)?;
                self.input.report(visitor)
            }
            _ => self.records(element, &[], visitor, |_, _, _| Ok(())),
        }
    }

    /// Calls `value` with the index and kind of each property of the next record. Returns the place of the record.
    fn record(
        &mut self,
        element: &PlyElement,
        mut value: impl FnMut(&mut Self, usize, Kind) -> Result<(), Fault>,
    ) -> Result<BodyOffset, Fault> {
        let mut place = self.place();
        for (n, property) in element.properties.iter().enumerate() {
            value(self, n, property.kind)?;
        }
        if self.encoding == BodyEncoding::Ascii {
            place = self.place();
            self.end_line()?;
        }
        Ok(place)
    }

    fn skip_value(&mut self, kind: Kind) -> Result<(), Fault> {
        let (items, item) = match kind {
            Kind::Scalar(scalar) => (1, scalar),
            Kind::List { count, item } => (self.length(count, item)?, item),
        };
        if self.encoding == BodyEncoding::Ascii {
            return (0..items).try_for_each(|_| self.token());
        }
        self.skip_bytes(items.saturating_mul(item.size() as u64), "values")
    }

    fn skip_bytes(&mut self, bytes: u64, what: &str) -> Result<(), Fault> {
        self.input.expect_left(bytes, what)?;
        self.input.go_to(self.input.offset() + bytes)
    }

    /// The length of a list, checked against the rest of the file.
    fn length(&mut self, count: PlyScalar, item: PlyScalar) -> Result<u64, Fault> {
        let mut place = self.place();
        let length = self.number(count)?;
        if self.encoding == BodyEncoding::Ascii {
            // Blank lines may have preceded it.
            place = self.place();
        }
        // An item of text takes at least a blank and a digit.
        let room = self.input.left() / if self.encoding == BodyEncoding::Ascii { 2 } else { item.size() as u64 };
        if length < 0.0 || length > room as f64 {
            return Err(Fault::malformed(place.to_string(), format!("a list length from 0 to {room}"), length));
        }
        Ok(length as u64)
    }

    fn place(&self) -> BodyOffset {
        match self.encoding {
            BodyEncoding::Ascii => BodyOffset::Line(self.line),
            _ => BodyOffset::Byte(self.input.offset()),
        }
    }

    fn number(&mut self, scalar: PlyScalar) -> Result<f64, Fault> {
        if self.encoding != BodyEncoding::Ascii {
            let mut bytes = [0; 8];
            self.input.fill(&mut bytes[..scalar.size()], "a number")?;
            return Ok(scalar.decode(&bytes, self.encoding == BodyEncoding::BigEndian));
        }
        self.token()?;
        scalar.parse(&self.token).ok_or_else(|| {
            let expected = format!("a number of type {scalar:?}");
            Fault::malformed(self.place().to_string(), expected, excerpt(&self.token))
        })
    }

    /// Reads the next word, on this line or a later one.
    fn token(&mut self) -> Result<(), Fault> {
        self.token.clear();
        loop {
            let (bytes, line_end) = (self.input.fill_buf()?, self.line_end);
            let blank = if self.token.is_empty() {
                let blank = bytes.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(bytes.len());
                self.line += bytes[..blank].iter().filter(|&&b| b == line_end).count() as u64;
                blank
            } else {
                0
            };
            let word = &bytes[blank..];
            let (length, at_end) = (word.iter().position(u8::is_ascii_whitespace), bytes.is_empty());
            let taken = length.unwrap_or(word.len());
            if self.token.len() + taken > MAX_TOKEN {
                let problem = format!("the number is longer than {MAX_TOKEN} characters");
                return Err(Fault::broken(self.place().to_string(), problem));
            }
            self.token.extend_from_slice(&word[..taken]);
            self.input.consume(blank + taken);
            match (length.is_some() || at_end, self.token.is_empty()) {
                (true, false) => return Ok(()),
                (true, true) => {
                    return Err(Fault::malformed(self.place().to_string(), "a number", "the end of the file"));
                }
                (false, _) => {}
            }
        }
    }

    /// Skips the rest of the line after a record: some programs write more words than properties.
    fn end_line(&mut self) -> Result<(), Fault> {
        loop {
            let bytes = self.input.fill_buf()?;
            if bytes.is_empty() {
                return Ok(());
            }
            let end = bytes.iter().position(|&b| b == self.line_end);
            let skipped = end.map_or(bytes.len(), |end| end + 1);
            self.input.consume(skipped);
            if end.is_some() {
                self.line += 1;
                return Ok(());
            }
        }
    }
}

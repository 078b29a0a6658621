//! Lines of numbers: XYZ, TXT, CSV, PTS, ASC, and Open3D's XYZN and XYZRGB, whose names define their columns.
//!
//! The separator is that of the first line of numbers: a semicolon, else a comma, else a pipe, else runs of blanks. A
//! line or comment before the numbers may name the columns. Without names, the first three columns are x, y and z. The
//! last three of six columns, or of a PTS file's seven, are red, green and blue if they are bytes in each of the first
//! thousand lines; otherwise they are a normal, which is ignored. Unused columns may hold anything.

mod colors;
mod columns;
#[cfg(test)]
mod tests;

use std::ops::Range;

use glam::DVec3;

use self::colors::Colors;
use self::columns::{Columns, Separator};
use super::{Fault, Input, Point, ReadOptions, Visitor};

/// Bytes of a line.
const MAX_LINE: usize = 1 << 16;

/// Reads `input`.
///
/// # Errors
///
/// If a line is too long or has another number of columns than the first one, a used number is invalid or not finite,
/// there are no points or fewer than a PTS file declares, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    read_after(Before::default(), input, options, visitor)
}

/// Reads `input` as `.xyzn`: x, y, z and a normal.
///
/// # Errors
///
/// The errors of [`read`].
pub fn read_normals(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    read_after(Before::named(&["x", "y", "z", "nx", "ny", "nz"]), input, options, visitor)
}

/// Reads `input` as `.xyzrgb`: x, y, z and a color, as fractions or bytes.
///
/// # Errors
///
/// The errors of [`read`].
pub fn read_colors(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    read_after(Before::named(&["x", "y", "z", "r", "g", "b"]), input, options, visitor)
}

fn read_after(
    mut before: Before,
    input: &mut Input<'_>,
    options: &ReadOptions,
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    let mut text = Vec::new();
    let mut line = TextLine { number: 0, bytes: &[] };
    let mut table: Option<NumberTable> = None;
    let mut points = 0_u64;
    while input.line(&mut text, MAX_LINE)? {
        input.report(visitor)?;
        line = TextLine { number: line.number + 1, bytes: &[] };
        let line = TextLine::of(&text, line.number)?;
        let table = match &mut table {
            Some(_) if line.is_blank() || line.comment().is_some() => continue,
            Some(table) => table,
            None if before.takes(&line)? => continue,
            None => table.insert(NumberTable::of_first(&line, &before)),
        };
        table.split(&line)?;
        points += 1;
        table.point(&line, options, visitor)?;
    }
    if let Some(table) = &mut table {
        table.colors.finish(visitor)?;
    }
    match before.count {
        Some(count) if points < count => {
            let expected = format!("{count} points, as declared in the first line");
            Err(Fault::malformed(format!("line {}", line.number), expected, points))
        }
        _ if points == 0 => Err(Fault::broken("the file", "it has no lines of numbers")),
        _ => Ok(()),
    }
}

/// A line without its end, its byte order mark and the blanks around it.
struct TextLine<'a> {
    number: u64,
    bytes: &'a [u8],
}

impl<'a> TextLine<'a> {
    fn of(text: &'a [u8], number: u64) -> Result<Self, Fault> {
        let mut bytes = text;
        if number == 1 {
            if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
                return Err(Fault::unsupported("text in UTF-16", "save it as UTF-8"));
            }
            bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        }
        Ok(Self { number, bytes: bytes.trim_ascii() })
    }

    fn place(&self) -> String {
        format!("line {}", self.number)
    }

    fn is_blank(&self) -> bool {
        self.bytes.is_empty()
    }

    /// The comment after `#` or `//`, if the line is one.
    fn comment(&self) -> Option<&'a [u8]> {
        self.bytes.strip_prefix(b"//").or_else(|| self.bytes.strip_prefix(b"#"))
    }

    /// The number in `field`.
    fn number(&self, field: Range<usize>) -> Result<f64, Fault> {
        let field = columns::unquoted(&self.bytes[field]);
        if let Some(number) = std::str::from_utf8(field).ok().and_then(|text| text.parse().ok()) {
            return Ok(number);
        }
        if field.contains(&b',') {
            return Err(Fault::unsupported(
                format!("{}: a decimal comma", self.place()),
                "write numbers with a decimal point",
            ));
        }
        Err(Fault::malformed(self.place(), "a number", shown(field)))
    }
}

/// The beginning of a text, for errors.
fn shown(text: &[u8]) -> String {
    match std::str::from_utf8(&text[..text.len().min(40)]) {
        Ok(text) => format!("{text:?}"),
        Err(_) => "bytes that are not UTF-8".into(),
    }
}

/// The lines before the first line of numbers.
#[derive(Default)]
struct Before {
    /// Names of columns, and true if they are from a comment, which may be something else.
    names: Option<(Vec<String>, bool)>,
    /// PTS: the number of points in the first line.
    count: Option<u64>,
}

impl Before {
    /// The beginning of a file whose format names its columns.
    fn named(names: &[&str]) -> Self {
        Self { names: Some((names.iter().map(|&name| name.into()).collect(), false)), count: None }
    }

    /// Takes `line` and returns true, unless it is a line of numbers.
    fn takes(&mut self, line: &TextLine<'_>) -> Result<bool, Fault> {
        if line.is_blank() {
            return Ok(true);
        }
        if let Some(comment) = line.comment() {
            if let Some(names) = columns::names(comment) {
                self.names = Some((names, true));
            }
            return Ok(true);
        }
        if self.count.is_none() && line.bytes.iter().all(u8::is_ascii_digit) {
            self.count = Some(
                shown(line.bytes)
                    .trim_matches('"')
                    .parse()
                    .map_err(|_| Fault::malformed(line.place(), "a number of points", shown(line.bytes)))?,
            );
            return Ok(true);
        }
        let named = matches!(self.names, Some((_, false)));
        if named || columns::starts_with_a_number(line.bytes) {
            return Ok(false);
        }
        let names = columns::names(line.bytes).ok_or_else(|| {
            Fault::malformed(line.place(), "numbers, or the names of columns with x, y and z", shown(line.bytes))
        })?;
        self.names = Some((names, false));
        Ok(true)
    }
}

/// The lines of numbers: their common layout, and the fields of the current line.
struct NumberTable {
    separator: Separator,
    columns: Columns,
    /// Number of columns.
    width: usize,
    /// Number of the first line.
    first: u64,
    fields: Vec<Range<usize>>,
    colors: Colors,
}

impl NumberTable {
    fn of_first(line: &TextLine<'_>, before: &Before) -> Self {
        let separator = Separator::of(line.bytes);
        let mut fields = Vec::new();
        separator.split(line.bytes, &mut fields);
        let width = fields.len();
        // A comment with another number of words does not name the columns.
        let names = before.names.as_ref().filter(|(names, comment)| !comment || names.len() == width);
        let columns = names
            .and_then(|(names, _)| Columns::named(names))
            .unwrap_or_else(|| Columns::unnamed(width, before.count.is_some()));
        let colors = Colors::new(columns.color.is_some(), names.is_some());
        Self { separator, columns, width, first: line.number, fields, colors }
    }

    fn split(&mut self, line: &TextLine<'_>) -> Result<(), Fault> {
        self.separator.split(line.bytes, &mut self.fields);
        let needed = self.columns.needed();
        if self.width < needed {
            return Err(Fault::malformed(line.place(), format!("at least {needed} columns"), self.fields.len()));
        }
        if self.fields.len() != self.width {
            let expected = format!("{} columns, as in line {}", self.width, self.first);
            return Err(Fault::malformed(line.place(), expected, self.fields.len()));
        }
        Ok(())
    }

    fn point(&mut self, line: &TextLine<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
        let of = |column: usize| line.number(self.fields[column].clone());
        let [x, y, z] = self.columns.position;
        let point = match Point::new(DVec3::new(of(x)?, of(y)?, of(z)?), None, || line.place()) {
            Ok(point) => point,
            Err(fault) => return fault.pass(visitor),
        };
        let color = match self.columns.color {
            Some([red, green, blue]) if self.colors.wanted() => Some([of(red)?, of(green)?, of(blue)?]),
            _ => None,
        };
        if let Some(column) = self.columns.confidence {
            let confidence = of(column)?;
            if confidence.is_nan() {
                return Err(Fault::malformed(line.place(), "a confidence that is a number", confidence));
            }
            if confidence < options.min_confidence {
                return Ok(());
            }
        }
        self.colors.point(point, color, visitor)
    }
}

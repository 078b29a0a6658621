//! Separators and meanings of columns.

use std::ops::Range;

/// The separator of columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    /// One of `;`, `,` and `|`, between columns that may be empty.
    Mark(u8),
    /// Any number of spaces and tabs.
    Blanks,
}

impl Separator {
    /// The separator of `line`. Semicolons come first, because with them a comma is a decimal one.
    pub(super) fn of(line: &[u8]) -> Self {
        let mark = b";,|".iter().find(|mark| line.contains(mark));
        mark.map_or(Self::Blanks, |mark| Self::Mark(*mark))
    }

    /// Sets `fields` to the ranges of the fields of `line`, without blanks around them. An empty field at the end is
    /// dropped.
    pub(super) fn split(self, line: &[u8], fields: &mut Vec<Range<usize>>) {
        fields.clear();
        let mut start = 0;
        match self {
            Self::Blanks => {
                for (place, byte) in line.iter().enumerate() {
                    if byte.is_ascii_whitespace() {
                        if place > start {
                            fields.push(start..place);
                        }
                        start = place + 1;
                    }
                }
                if start < line.len() {
                    fields.push(start..line.len());
                }
            }
            Self::Mark(mark) => {
                for (place, byte) in line.iter().enumerate() {
                    if *byte == mark {
                        fields.push(trimmed(line, start..place));
                        start = place + 1;
                    }
                }
                let last = trimmed(line, start..line.len());
                if !last.is_empty() {
                    fields.push(last);
                }
            }
        }
    }
}

fn trimmed(line: &[u8], mut field: Range<usize>) -> Range<usize> {
    while !field.is_empty() && line[field.start].is_ascii_whitespace() {
        field.start += 1;
    }
    while !field.is_empty() && line[field.end - 1].is_ascii_whitespace() {
        field.end -= 1;
    }
    field
}

/// `field` without the quotation marks around it.
pub(super) fn unquoted(field: &[u8]) -> &[u8] {
    field.strip_prefix(b"\"").and_then(|field| field.strip_suffix(b"\"")).unwrap_or(field)
}

/// True if the first field of `line` is a number; with a decimal comma, its integer part counts.
pub(super) fn starts_with_a_number(line: &[u8]) -> bool {
    let end = line.iter().position(|b| b.is_ascii_whitespace() || b";,|".contains(b)).unwrap_or(line.len());
    std::str::from_utf8(unquoted(&line[..end])).is_ok_and(|field| field.parse::<f64>().is_ok())
}

/// The names of columns in `line`, in lower case, if x, y and z are among them.
pub(super) fn names(line: &[u8]) -> Option<Vec<String>> {
    let line = line.trim_ascii();
    let mut fields = Vec::new();
    Separator::of(line).split(line, &mut fields);
    let names: Vec<_> =
        fields.into_iter().map(|f| String::from_utf8_lossy(unquoted(&line[f])).to_ascii_lowercase()).collect();
    Columns::named(&names).is_some().then_some(names)
}

/// Indices of the used columns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Columns {
    /// x, y and z.
    pub(super) position: [usize; 3],
    /// Red, green and blue, or a normal.
    pub(super) color: Option<[usize; 3]>,
    pub(super) confidence: Option<usize>,
}

impl Columns {
    /// The columns with these names, which are in lower case; `None` without x, y and z.
    pub(super) fn named(names: &[String]) -> Option<Self> {
        let find = |known: &[&str]| names.iter().position(|name| known.contains(&name.as_str()));
        let color = || Some([find(&["red", "r"])?, find(&["green", "g"])?, find(&["blue", "b"])?]);
        Some(Self {
            position: [find(&["x"])?, find(&["y"])?, find(&["z"])?],
            color: color(),
            confidence: find(&["confidence", "conf", "weight"]),
        })
    }

    /// The columns of a file without names, by their number. PTS has an intensity before the color; in other files of
    /// seven columns, an opacity may follow the color, so no color is read.
    pub(super) fn unnamed(width: usize, pts: bool) -> Self {
        let color = match (width, pts) {
            (6, _) => Some([3, 4, 5]),
            (7, true) => Some([4, 5, 6]),
            _ => None,
        };
        Self { position: [0, 1, 2], color, confidence: None }
    }

    /// Smallest number of columns of a line.
    pub(super) fn needed(&self) -> usize {
        let all = self.position.into_iter().chain(self.color.into_iter().flatten()).chain(self.confidence);
        all.max().map_or(0, |last| last + 1)
    }
}

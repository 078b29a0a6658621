//! The header: the fields, and the layout of records.

use std::ops::Range;

use crate::{Fault, Input};

/// Bytes of a record.
const MAX_RECORD: u64 = 1 << 16;

/// Bytes of a line.
pub(super) const MAX_LINE: usize = 1 << 16;
/// Lines of the header, comments included.
const MAX_LINES: u64 = 1000;

/// Encoding of the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Data {
    Ascii,
    Binary,
    Compressed,
}

/// Type of a field's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FieldKind {
    Float,
    Signed,
    Unsigned,
}

/// A field. Only the first of its numbers is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PcdField {
    kind: FieldKind,
    /// Bytes of a number.
    pub(super) size: usize,
    /// Offset in a record.
    pub(super) start: usize,
    /// Index of its first number in a line.
    pub(super) column: usize,
}

impl PcdField {
    /// Range in a record.
    pub(super) fn bytes(&self) -> Range<usize> {
        self.start..self.start + self.size
    }

    /// The number in `bytes`, which are `size` long.
    pub(super) fn value(&self, bytes: &[u8]) -> f64 {
        match (self.kind, bytes) {
            (FieldKind::Float, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).into(),
            (FieldKind::Float, bytes) => f64::from_bits(unsigned(bytes)),
            (FieldKind::Unsigned, bytes) => unsigned(bytes) as f64,
            (FieldKind::Signed, bytes) => {
                let unused = 64 - 8 * bytes.len() as u32;
                ((unsigned(bytes) << unused) as i64 >> unused) as f64
            }
        }
    }

    /// The packed color in `bytes`: the bits of the number, of any type.
    pub(super) fn packed(&self, bytes: &[u8]) -> u32 {
        unsigned(bytes) as u32
    }

    /// The packed color in a line of text: an integer, or a float whose bits are the color.
    pub(super) fn packed_of_text(&self, text: &str) -> Option<u32> {
        match (text.parse::<i64>(), self.kind) {
            (Ok(packed), _) => Some(packed as u32),
            (Err(_), FieldKind::Float) => text.parse::<f32>().ok().map(f32::to_bits),
            (Err(_), _) => None,
        }
    }
}

fn unsigned(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// The header.
#[derive(Debug)]
pub(super) struct PcdHeader {
    pub(super) data: Data,
    pub(super) points: u64,
    /// Bytes of a record.
    pub(super) record: u64,
    /// Numbers in a line.
    pub(super) columns: usize,
    pub(super) position: [PcdField; 3],
    /// `rgb` or `rgba`.
    pub(super) color: Option<PcdField>,
    /// Lines of the header.
    pub(super) lines: u64,
}

impl PcdHeader {
    /// Bytes of all records.
    ///
    /// # Errors
    ///
    /// If the product overflows.
    pub(super) fn bytes(&self) -> Result<u64, Fault> {
        let bytes = self.points.checked_mul(self.record);
        bytes
            .ok_or_else(|| Fault::broken("POINTS", format!("{} points of {} bytes overflow", self.points, self.record)))
    }

    /// Reads the header, up to the first byte of the points.
    pub(super) fn read(input: &mut Input<'_>) -> Result<Self, Fault> {
        let mut entries: Vec<(&str, Vec<String>)> = Vec::new();
        let mut line = Vec::new();
        let mut lines = 0;
        let data = loop {
            lines += 1;
            let place = || format!("line {lines}");
            Fault::unless_within("lines of a header", MAX_LINES, lines)?;
            if !input.line(&mut line, MAX_LINE)? {
                return Err(Fault::malformed(place(), "a line DATA", "the end of the file"));
            }
            if line.starts_with(b"#") || line.trim_ascii().is_empty() {
                continue;
            }
            let text = std::str::from_utf8(&line)
                .map_err(|_| Fault::malformed(place(), "a header line", "bytes that are not UTF-8"))?;
            let mut words = text.split_ascii_whitespace();
            let key = words.next().unwrap_or_default();
            let key = match key {
                "VERSION" | "VIEWPOINT" => continue,
                "COLUMNS" => "FIELDS",
                "DATA" => break data(words.next().unwrap_or_default(), place())?,
                _ => *["FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "POINTS"]
                    .iter()
                    .find(|known| **known == key)
                    .ok_or_else(|| {
                        let shown: String = key.chars().take(40).collect();
                        Fault::malformed(place(), "a header line", format!("{shown:?}"))
                    })?,
            };
            if entries.iter().any(|(known, _)| *known == key) {
                return Err(Fault::broken(place(), format!("a second line {key}")));
            }
            entries.push((key, words.map(String::from).collect()));
        };
        Self::of(&HeaderLines(entries), data, lines)
    }

    fn of(entries: &HeaderLines<'_>, data: Data, lines: u64) -> Result<Self, Fault> {
        let names = entries.words("FIELDS")?;
        let sizes = entries.numbers("SIZE", names.len())?;
        let kinds = entries.words("TYPE")?;
        if kinds.len() != names.len() {
            return Err(Fault::malformed("TYPE", format!("{} letters", names.len()), kinds.len()));
        }
        let counts = match entries.words("COUNT") {
            Ok(_) => entries.numbers("COUNT", names.len())?,
            Err(_) => vec![1; names.len()],
        };
        let (mut record, mut columns) = (0_u64, 0_u64);
        let mut fields = Vec::with_capacity(names.len());
        for (((name, size), kind), count) in names.iter().zip(sizes).zip(kinds).zip(counts) {
            let (start, column) = (record as usize, columns as usize);
            let kind = match (kind.as_str(), size) {
                ("F", 4 | 8) => FieldKind::Float,
                ("I", 1 | 2 | 4 | 8) => FieldKind::Signed,
                ("U", 1 | 2 | 4 | 8) => FieldKind::Unsigned,
                _ => {
                    let found: String = kind.chars().take(8).collect();
                    let expected = "F of 4 or 8 bytes, or I or U of 1, 2, 4 or 8 bytes";
                    return Err(Fault::malformed("TYPE and SIZE", expected, format!("{found} of {size}")));
                }
            };
            fields.push((name.as_str(), count, PcdField { kind, size: size as usize, start, column }));
            columns = columns.saturating_add(count);
            record = record.saturating_add(size.saturating_mul(count));
            Fault::unless_within("bytes of a record", MAX_RECORD, record)?;
        }
        let find = |wanted: &str| {
            fields
                .iter()
                .find(|(name, count, _)| name.eq_ignore_ascii_case(wanted) && *count > 0)
                .map(|(_, _, field)| field.clone())
        };
        let axis = |wanted: &str| {
            find(wanted).ok_or_else(|| Fault::broken("FIELDS", format!("the field {wanted} is missing")))
        };
        let color = find("rgb").or_else(|| find("rgba")).filter(|field| field.size >= 4);
        Ok(Self {
            data,
            points: entries.points()?,
            record,
            columns: columns as usize,
            position: [axis("x")?, axis("y")?, axis("z")?],
            color,
            lines,
        })
    }
}

fn data(word: &str, place: String) -> Result<Data, Fault> {
    match word {
        "ascii" => Ok(Data::Ascii),
        "binary" => Ok(Data::Binary),
        "binary_compressed" => Ok(Data::Compressed),
        _ => {
            let found: String = word.chars().take(40).collect();
            Err(Fault::malformed(place, "DATA ascii, binary or binary_compressed", format!("{found:?}")))
        }
    }
}

/// The lines of the header: a key and words.
struct HeaderLines<'a>(Vec<(&'a str, Vec<String>)>);

impl HeaderLines<'_> {
    fn words(&self, key: &str) -> Result<&[String], Fault> {
        let entry = self.0.iter().find(|(known, _)| *known == key);
        entry
            .map(|(_, words)| &words[..])
            .ok_or_else(|| Fault::broken("the header", format!("the line {key} is missing")))
    }

    fn numbers(&self, key: &str, count: usize) -> Result<Vec<u64>, Fault> {
        let words = self.words(key)?;
        if words.len() != count {
            return Err(Fault::malformed(key, format!("{count} numbers"), words.len()));
        }
        let number = |word: &String| {
            let shown = || format!("{:?}", word.chars().take(40).collect::<String>());
            word.parse().map_err(|_| Fault::malformed(key, "a number", shown()))
        };
        words.iter().map(number).collect()
    }

    /// The number of points: WIDTH times HEIGHT, or POINTS, which must be equal.
    fn points(&self) -> Result<u64, Fault> {
        let one = |key: &str| self.numbers(key, 1).map(|numbers| numbers[0]);
        let points = match self.words("POINTS") {
            Ok(_) => Some(one("POINTS")?),
            Err(_) => None,
        };
        if let (Some(points), Err(_)) = (points, self.words("WIDTH")) {
            return Ok(points);
        }
        let (width, height) = (one("WIDTH")?, one("HEIGHT")?);
        let product = width.checked_mul(height);
        match (product, points) {
            (Some(product), None) => Ok(product),
            (Some(product), Some(points)) if product == points => Ok(points),
            _ => {
                let expected = format!("WIDTH {width} times HEIGHT {height}");
                Err(Fault::malformed("POINTS", expected, points.map_or("an overflow".into(), |p| p.to_string())))
            }
        }
    }
}

//! The header: the encoding, and the elements with their properties.

use super::super::error::excerpt;
use super::super::{Fault, Input};
use strivec_format::Place;

/// Lines, elements, and properties of one element. The headers of Gaussian splats have about 70 properties.
const MAX_LINES: u64 = 10_000;
const MAX_ELEMENTS: u64 = 256;
const MAX_PROPERTIES: u64 = 1024;
/// Bytes of a line; comments may be long.
const MAX_LINE: usize = 1 << 16;
/// Keywords whose lines must be complete.
const KEYWORDS: [&str; 4] = ["format", "element", "property", "end_header"];

/// Encoding of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BodyEncoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PlyScalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

/// Type of a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(PlyScalar),
    List { count: PlyScalar, item: PlyScalar },
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Debug)]
pub(super) struct PlyElement {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

pub(super) struct PlyHeader {
    pub(super) encoding: BodyEncoding,
    pub(super) elements: Vec<PlyElement>,
    /// Lines of the header.
    pub(super) lines: u64,
    /// Last byte of a line: LF, or CR if the lines end in CR alone.
    pub(super) line_end: u8,
}

impl PlyScalar {
    /// The type of either of its names.
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of a number.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// True if f32 represents all values exactly.
    pub(super) fn fits_f32(self) -> bool {
        !matches!(self, Self::I32 | Self::U32 | Self::F64)
    }

    /// The number at the beginning of `bytes`; f64 represents all values of all types exactly.
    #[inline]
    pub(super) fn decode(self, bytes: &[u8], big_endian: bool) -> f64 {
        macro_rules! number {
            ($type:ty) => {{
                let mut own = [0; size_of::<$type>()];
                own.copy_from_slice(&bytes[..size_of::<$type>()]);
                f64::from(if big_endian { <$type>::from_be_bytes(own) } else { <$type>::from_le_bytes(own) })
            }};
        }
        match self {
            Self::I8 => number!(i8),
            Self::U8 => number!(u8),
            Self::I16 => number!(i16),
            Self::U16 => number!(u16),
            Self::I32 => number!(i32),
            Self::U32 => number!(u32),
            Self::F32 => number!(f32),
            Self::F64 => number!(f64),
        }
    }

    /// `token` as a number of this type, if it is one.
    pub(super) fn parse(self, token: &[u8]) -> Option<f64> {
        let token = std::str::from_utf8(token).ok()?;
        match self {
            Self::I8 => token.parse::<i8>().ok().map(f64::from),
            Self::U8 => token.parse::<u8>().ok().map(f64::from),
            Self::I16 => token.parse::<i16>().ok().map(f64::from),
            Self::U16 => token.parse::<u16>().ok().map(f64::from),
            Self::I32 => token.parse::<i32>().ok().map(f64::from),
            Self::U32 => token.parse::<u32>().ok().map(f64::from),
            Self::F32 => token.parse::<f32>().ok().map(f64::from),
            Self::F64 => token.parse::<f64>().ok(),
        }
    }
}

impl PlyElement {
    /// Index of the property `name`.
    pub(super) fn property(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|property| property.name == name)
    }

    /// Bytes of one record; `None` if the element has lists.
    pub(super) fn record_size(&self) -> Option<usize> {
        self.properties.iter().try_fold(0, |size, property| match property.kind {
            Kind::Scalar(scalar) => Some(size + scalar.size()),
            Kind::List { .. } => None,
        })
    }

    /// Smallest number of bytes of a record: two for each number in text, else its size; lists may be empty.
    fn least_record(&self, encoding: BodyEncoding) -> u64 {
        let least = |property: &Property| match (encoding, property.kind) {
            (BodyEncoding::Ascii, _) => 2,
            (_, Kind::Scalar(scalar) | Kind::List { count: scalar, .. }) => scalar.size() as u64,
        };
        self.properties.iter().map(least).sum()
    }
}

impl PlyHeader {
    /// Reads the header.
    ///
    /// # Errors
    ///
    /// If it is invalid, exceeds a limit, or declares more than the rest of the file can hold.
    pub(super) fn read(input: &mut Input<'_>) -> Result<Self, Fault> {
        let (mut encoding, mut elements, mut lines) = (None, Vec::<PlyElement>::new(), 0);
        let mut bytes = Vec::new();
        let line_end =
            if matches!(input.peek(5)?[..], [b'p', b'l', b'y', b'\r', next] if next != b'\n') { b'\r' } else { b'\n' };
        loop {
            if !input.line_until(&mut bytes, MAX_LINE, line_end)? {
                return Err(Fault::malformed(input.place(), "a line end_header", "the end of the file"));
            }
            lines += 1;
            Fault::unless_within("lines of a header", MAX_LINES, lines)?;
            let line = String::from_utf8_lossy(&bytes);
            let words: Vec<&str> = line.split_ascii_whitespace().take(6).collect();
            let wrong = |expected: &str| Fault::malformed(Place::Line(lines), expected, excerpt(&bytes));
            if lines == 1 {
                if words != ["ply"] {
                    return Err(wrong("ply"));
                }
                continue;
            }
            match words[..] {
                [] | ["comment" | "obj_info", ..] => {}
                ["format", name, version] => {
                    encoding = Some(match (name, version) {
                        ("ascii", "1.0") => BodyEncoding::Ascii,
                        ("binary_little_endian", "1.0") => BodyEncoding::LittleEndian,
                        ("binary_big_endian", "1.0") => BodyEncoding::BigEndian,
                        _ => return Err(wrong("format ascii, binary_little_endian or binary_big_endian, and 1.0")),
                    });
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| wrong("\"element NAME COUNT\""))?;
                    if elements.iter().any(|element| element.name == name) {
                        return Err(wrong("an element with another name"));
                    }
                    elements.push(PlyElement { name: name.into(), count, properties: Vec::new() });
                    Fault::unless_within("elements of a header", MAX_ELEMENTS, elements.len() as u64)?;
                }
                ["property", ref what @ .., name] => {
                    let kind = kind(what)
                        .ok_or_else(|| wrong("\"property TYPE NAME\" or \"property list TYPE TYPE NAME\""))?;
                    let element = elements.last_mut().ok_or_else(|| wrong("an element before its properties"))?;
                    element.properties.push(Property { name: name.into(), kind });
                    let count = element.properties.len() as u64;
                    Fault::unless_within("properties of an element", MAX_PROPERTIES, count)?;
                }
                ["end_header"] => break,
                // Some programs sign the file without a keyword.
                [word, ..] if elements.is_empty() && !KEYWORDS.contains(&word) => {}
                _ => return Err(wrong("a header line")),
            }
        }
        let encoding = encoding.ok_or_else(|| Fault::broken("the header", "the line format is missing"))?;
        check_counts(&elements, encoding, input)?;
        Ok(Self { encoding, elements, lines, line_end })
    }
}

/// The type of a property, from the words between `property` and its name.
fn kind(words: &[&str]) -> Option<Kind> {
    match *words {
        [scalar] => PlyScalar::of(scalar).map(Kind::Scalar),
        ["list", count, item] => {
            let count = PlyScalar::of(count).filter(|count| count.is_integer())?;
            Some(Kind::List { count, item: PlyScalar::of(item)? })
        }
        _ => None,
    }
}

/// Checks that the rest of the file can hold all declared records.
fn check_counts(elements: &[PlyElement], encoding: BodyEncoding, input: &Input<'_>) -> Result<(), Fault> {
    // The last line of an ASCII file may lack its end.
    let left = input.left() + u64::from(encoding == BodyEncoding::Ascii);
    let mut least = 0_u64;
    for PlyElement { name, count, properties } in elements {
        if properties.is_empty() && *count > 0 {
            return Err(Fault::broken("the header", format!("the element {name} has no properties")));
        }
    }
    for element in elements {
        least = least.saturating_add(element.count.saturating_mul(element.least_record(encoding)));
        if least > left {
            let (PlyElement { count, name, .. }, left) = (element, input.left());
            let problem =
                format!("{count} x {name} is declared, which needs at least {least} bytes, but {left} are left");
            return Err(Fault::broken(input.place(), problem));
        }
    }
    Ok(())
}

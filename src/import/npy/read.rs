//! Streaming reader for untrusted `.npy` arrays of any numeric type.
//!
//! The header is a Python literal. Only the flat literal of three keys that NumPy itself writes is accepted, by a
//! scanner that cannot recurse: parsers of any literal overflow the stack on hostile input.

use std::io::Read;

use half::f16;
use strivec_format::Invalid;

use super::{Header, NpyError, Number};

/// Bytes of the longest header that is accepted: NumPy writes about 80, padded to a multiple of 64.
const MAX_HEADER: usize = 1 << 16;
/// Axes of an array at most (NumPy's own limit).
const MAX_AXES: usize = 64;

fn malformed(place: &'static str, expected: &'static str, found: impl ToString) -> NpyError {
    NpyError::Malformed(Invalid::new(place, expected, found.to_string()))
}

impl Number {
    /// Bytes of one number.
    pub fn width(self) -> usize {
        match self {
            Self::Bool => 1,
            Self::Signed(width) | Self::Unsigned(width) | Self::Float(width) => width.into(),
        }
    }

    /// The number in these bytes: [`Number::width`] of them, least significant first.
    fn value(self, bytes: &[u8]) -> f64 {
        let mut eight = [0; 8];
        eight[..bytes.len()].copy_from_slice(bytes);
        let bits = u64::from_le_bytes(eight);
        match self {
            Self::Bool => f64::from(u8::from(bits != 0)),
            Self::Unsigned(_) => bits as f64,
            Self::Signed(width) => {
                let unused = 64 - 8 * u32::from(width);
                ((bits << unused) as i64 >> unused) as f64
            }
            Self::Float(2) => f16::from_bits(bits as u16).to_f64(),
            Self::Float(4) => f32::from_bits(bits as u32).into(),
            Self::Float(_) => f64::from_bits(bits),
        }
    }
}

impl Header {
    /// Reads the header, after which the input stands at the first number.
    ///
    /// # Errors
    ///
    /// [`NpyError::Malformed`] if NumPy does not write such a header, if the numbers are complex, structured or text,
    /// or if their bytes are 2^64 and more; [`NpyError::Io`] if the input fails or ends.
    pub fn read(input: &mut dyn Read) -> Result<Self, NpyError> {
        let mut start = [0; 8];
        input.read_exact(&mut start)?;
        if &start[..6] != b"\x93NUMPY" {
            return Err(malformed("magic", "\\x93NUMPY", format!("{:02x?}", &start[..6])));
        }
        let length = match start[6] {
            1 => {
                let mut bytes = [0; 2];
                input.read_exact(&mut bytes)?;
                usize::from(u16::from_le_bytes(bytes))
            }
            2 | 3 => {
                let mut bytes = [0; 4];
                input.read_exact(&mut bytes)?;
                u32::from_le_bytes(bytes) as usize
            }
            version => return Err(malformed("version", "1, 2 or 3", version)),
        };
        if length > MAX_HEADER {
            return Err(malformed("header length", "at most 65536 bytes", length));
        }
        let mut text = vec![0; length];
        input.read_exact(&mut text)?;
        let text = String::from_utf8(text).map_err(|_| malformed("header", "UTF-8 text", "other bytes"))?;
        Self::parse(&text)
    }

    fn parse(text: &str) -> Result<Self, NpyError> {
        let whole = || {
            malformed(
                "header",
                "NumPy's descr, fortran_order and shape",
                text.trim().chars().take(200).collect::<String>(),
            )
        };
        let inner = text.trim().strip_prefix('{').and_then(|t| t.strip_suffix('}')).ok_or_else(whole)?;
        let (mut descr, mut fortran, mut shape) = (None, None, None);
        let mut rest = inner.trim_start();
        while !rest.is_empty() {
            let (key, after) = quoted(rest).ok_or_else(whole)?;
            let value = after.trim_start().strip_prefix(':').ok_or_else(whole)?.trim_start();
            rest = match key {
                "descr" => {
                    let (value, after) = quoted(value).ok_or_else(|| {
                        malformed("descr", "one type of number", value.chars().take(80).collect::<String>())
                    })?;
                    descr = Some(value);
                    after
                }
                "fortran_order" => {
                    let is = ["True", "False"].into_iter().find(|w| value.starts_with(w)).ok_or_else(whole)?;
                    fortran = Some(is == "True");
                    &value[is.len()..]
                }
                "shape" => {
                    let (inside, after) = value.strip_prefix('(').and_then(|v| v.split_once(')')).ok_or_else(whole)?;
                    shape = Some(inside);
                    after
                }
                _ => return Err(whole()),
            };
            rest = rest.trim_start();
            rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
        }
        let (number, big_endian) = number_of(descr.ok_or_else(whole)?)?;
        let fortran_order = fortran.ok_or_else(whole)?;
        let lengths = shape.ok_or_else(whole)?.split(',').map(str::trim).filter(|l| !l.is_empty());
        let shape: Vec<u64> =
            lengths.map(|l| l.trim_end_matches('L').parse().map_err(|_| whole())).collect::<Result<_, _>>()?;
        if shape.len() > MAX_AXES {
            return Err(malformed("shape", "at most 64 axes", shape.len()));
        }
        let count = shape.iter().try_fold(1u64, |all, &l| all.checked_mul(l));
        let count = count.filter(|c| c.checked_mul(number.width() as u64).is_some());
        let count = count.ok_or_else(|| malformed("shape", "fewer than 2^64 bytes", format!("{shape:?}")))?;
        Ok(Self { number, big_endian, fortran_order, shape, count })
    }

    /// Bytes of all numbers together.
    pub fn bytes(&self) -> u64 {
        self.count * self.number.width() as u64
    }

    /// Calls `visit` with the index and value of each number, in the order of the file.
    ///
    /// # Errors
    ///
    /// [`NpyError::Io`] if the input fails or ends before the last number, and any error that `visit` returns.
    pub fn for_each<E: From<NpyError>>(
        &self,
        input: &mut dyn Read,
        mut visit: impl FnMut(u64, f64) -> Result<(), E>,
    ) -> Result<(), E> {
        const AT_ONCE: usize = 1 << 13;
        let width = self.number.width();
        let mut bytes = vec![0; AT_ONCE * width];
        let mut next = 0;
        while next < self.count {
            let some = (self.count - next).min(AT_ONCE as u64) as usize;
            let part = &mut bytes[..some * width];
            input.read_exact(part).map_err(NpyError::from)?;
            for number in part.chunks_exact_mut(width) {
                if self.big_endian {
                    number.reverse();
                }
                visit(next, self.number.value(number))?;
                next += 1;
            }
        }
        Ok(())
    }

    /// All numbers at once; the caller bounds [`Header::count`] first.
    ///
    /// # Errors
    ///
    /// [`NpyError::Io`] if the input fails or ends before the last number.
    pub fn numbers(&self, input: &mut dyn Read) -> Result<Vec<f64>, NpyError> {
        let mut numbers = Vec::new();
        self.for_each(input, |_, value| {
            numbers.push(value);
            Ok::<_, NpyError>(())
        })?;
        Ok(numbers)
    }
}

/// The text between the quotes that `text` starts with, and the rest after them.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|c| ['\'', '"'].contains(c))?;
    text[1..].split_once(quote)
}

/// The type of number with this NumPy name, such as `<f4`, and whether it is big-endian.
pub fn number_of(descr: &str) -> Result<(Number, bool), NpyError> {
    let unknown = || malformed("descr", "booleans, integers or floats", descr);
    let mut letters = descr.chars();
    let order = letters.next().ok_or_else(unknown)?;
    let kind = letters.next().ok_or_else(unknown)?;
    let width: u8 = letters.as_str().parse().map_err(|_| unknown())?;
    let number = match (kind, width) {
        ('b', 1) => Number::Bool,
        ('i', 1 | 2 | 4 | 8) => Number::Signed(width),
        ('u', 1 | 2 | 4 | 8) => Number::Unsigned(width),
        ('f', 2 | 4 | 8) => Number::Float(width),
        _ => return Err(unknown()),
    };
    match order {
        '<' | '|' | '=' => Ok((number, false)),
        '>' => Ok((number, true)),
        _ => Err(unknown()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, numbers: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(numbers);
        bytes
    }

    fn read(header: &str, numbers: &[u8]) -> Result<(Header, Vec<f64>), NpyError> {
        let bytes = file(header, numbers);
        let mut input = bytes.as_slice();
        let header = Header::read(&mut input)?;
        let numbers = header.numbers(&mut input)?;
        Ok((header, numbers))
    }

    #[test]
    fn every_type_of_number_is_read() {
        let of = |descr: &str, bytes: &[u8]| {
            read(&format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (2,), }}   \n"), bytes).unwrap().1
        };
        assert_eq!(of("|b1", &[0, 7]), [0.0, 1.0]);
        assert_eq!(of("|u1", &[0, 255]), [0.0, 255.0]);
        assert_eq!(of("|i1", &[127, 255]), [127.0, -1.0]);
        assert_eq!(of(">i2", &[255, 254, 1, 0]), [-2.0, 256.0]);
        assert_eq!(of("<u4", &[1, 0, 0, 0, 0, 0, 0, 128]), [1.0, 2147483648.0]);
        assert_eq!(of("<f2", &[0, 0x3C, 0, 0xC0]), [1.0, -2.0]);
        assert_eq!(of("<f4", &[1.5f32.to_le_bytes(), (-0.25f32).to_le_bytes()].concat()), [1.5, -0.25]);
        assert_eq!(of(">f8", &[1.5f64.to_be_bytes(), f64::MAX.to_be_bytes()].concat()), [1.5, f64::MAX]);
        assert_eq!(of("<i8", &[(-3i64).to_le_bytes(), 4i64.to_le_bytes()].concat()), [-3.0, 4.0]);
    }

    #[test]
    fn shapes_and_orders() {
        let (header, numbers) =
            read("{'descr': '|u1', 'fortran_order': True, 'shape': (2, 3)}", &[1, 2, 3, 4, 5, 6]).unwrap();
        assert_eq!((header.shape, header.fortran_order, numbers.len()), (vec![2, 3], true, 6));
        let (header, numbers) = read("{'shape': (), 'descr': '|u1', 'fortran_order': False}", &[9]).unwrap();
        assert_eq!((header.count, numbers), (1, vec![9.0]));
    }

    #[test]
    fn headers_that_numpy_does_not_write_are_errors() {
        for header in [
            "",
            "{}",
            "{'descr': '<f4', 'fortran_order': False}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (18446744073709551615, 2)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (-1,)}",
            "{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1,)}",
            "{'descr': '<c8', 'fortran_order': False, 'shape': (1,)}",
            "{'descr': '<f4', 'fortran_order': Maybe, 'shape': (1,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (1,), 'more': 1}",
            "((((((((((((((((",
        ] {
            assert!(read(header, &[0; 64]).is_err(), "{header}");
        }
        assert!(read("{'descr': '<f4', 'fortran_order': False, 'shape': (2,)}", &[0; 7]).is_err(), "too short");
        assert!(Header::read(&mut &b"\x93NUMPY\x02\x00\xff\xff\xff\xff"[..]).is_err(), "a long header");
    }
}

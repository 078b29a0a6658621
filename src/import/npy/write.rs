//! Writer of `.npy` arrays and of `.npz` archives of them, which NumPy opens.

use std::io::{self, Seek, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::Number;

/// Bytes that a header is padded to a multiple of, so that the numbers are aligned.
const ALIGNMENT: usize = 64;

/// A type of number that arrays hold.
pub trait Element: Copy {
    /// Type of the number in the file.
    const NUMBER: Number;

    /// Appends its bytes, least significant first.
    fn put(self, bytes: &mut Vec<u8>);

    /// The number that a reader found.
    fn from_f64(value: f64) -> Self;
}

macro_rules! elements {
    ($($type:ty: $number:expr;)*) => {$(
        impl Element for $type {
            const NUMBER: Number = $number;

            fn put(self, bytes: &mut Vec<u8>) {
                bytes.extend(self.to_le_bytes());
            }

            fn from_f64(value: f64) -> Self {
                value as Self
            }
        }
    )*};
}

elements! {
    u8: Number::Unsigned(1);
    u32: Number::Unsigned(4);
    f32: Number::Float(4);
    f64: Number::Float(8);
}

impl Element for bool {
    const NUMBER: Number = Number::Bool;

    fn put(self, bytes: &mut Vec<u8>) {
        bytes.push(self.into());
    }

    fn from_f64(value: f64) -> Self {
        value != 0.0
    }
}

/// NumPy's name of a type of number, least significant byte first.
fn descr(number: Number) -> String {
    match number {
        Number::Bool => "|b1".into(),
        Number::Signed(1) => "|i1".into(),
        Number::Unsigned(1) => "|u1".into(),
        Number::Signed(width) => format!("<i{width}"),
        Number::Unsigned(width) => format!("<u{width}"),
        Number::Float(width) => format!("<f{width}"),
    }
}

/// Magic number, version 1.0 and header of an array in C order.
fn header(number: Number, shape: &[usize]) -> io::Result<Vec<u8>> {
    let lengths: String = shape.iter().map(|length| format!("{length}, ")).collect();
    let mut text = format!("{{'descr': '{}', 'fortran_order': False, 'shape': ({lengths}), }}", descr(number));
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    let unpadded = bytes.len() + size_of::<u16>() + text.len() + 1;
    text.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(ALIGNMENT) - unpadded));
    text.push('\n');
    let length = u16::try_from(text.len());
    let length =
        length.map_err(|_| io::Error::new(io::ErrorKind::InvalidInput, "too many axes for a `.npy` header"))?;
    bytes.extend(length.to_le_bytes());
    bytes.extend(text.as_bytes());
    Ok(bytes)
}

/// Writes an array of this shape in C order: the last axis varies fastest.
///
/// # Errors
///
/// If `out` fails, and [`io::ErrorKind::InvalidInput`] if there are more or fewer values than the shape has.
pub fn write<T: Element>(mut out: impl Write, shape: &[usize], values: impl IntoIterator<Item = T>) -> io::Result<()> {
    const AT_ONCE: usize = 1 << 16;
    let mut bytes = header(T::NUMBER, shape)?;
    let mut count = 0;
    for value in values {
        value.put(&mut bytes);
        count += 1;
        if bytes.len() >= AT_ONCE {
            out.write_all(&bytes)?;
            bytes.clear();
        }
    }
    out.write_all(&bytes)?;
    if count != shape.iter().product::<usize>() {
        let message = format!("an array of shape {shape:?} cannot hold {count} values");
        return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    }
    Ok(())
}

/// Writes named arrays as a deflated `.npz` archive. Equal arrays give equal bytes: no entry has a date.
#[derive(Debug)]
pub struct NpzWriter<W: Write + Seek> {
    zip: ZipWriter<W>,
    options: SimpleFileOptions,
}

impl<W: Write + Seek> NpzWriter<W> {
    /// Starts an archive. Arrays of 4 GiB and more need `large` sizes (ZIP64).
    pub fn new(out: W, large: bool) -> Self {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(DateTime::default())
            .large_file(large);
        Self { zip: ZipWriter::new(out), options }
    }

    /// Adds an array in C order.
    ///
    /// # Errors
    ///
    /// If [`write()`] fails, or an array of this name was added before.
    pub fn add<T: Element>(
        &mut self,
        name: &str,
        shape: &[usize],
        values: impl IntoIterator<Item = T>,
    ) -> io::Result<()> {
        self.zip.start_file(format!("{name}.npy"), self.options)?;
        write(&mut self.zip, shape, values)
    }

    /// Writes the directory.
    ///
    /// # Errors
    ///
    /// If the output fails.
    pub fn finish(self) -> io::Result<W> {
        Ok(self.zip.finish()?)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Header;
    use super::*;

    fn read_back<T: Element>(shape: &[usize], values: &[T]) -> (Header, Vec<f64>) {
        let mut bytes = Vec::new();
        write(&mut bytes, shape, values.iter().copied()).unwrap();
        let mut rest = bytes.as_slice();
        let header = Header::read(&mut rest).unwrap();
        assert_eq!((bytes.len() - rest.len()) % ALIGNMENT, 0);
        let numbers = header.numbers(&mut rest).unwrap();
        assert!(rest.is_empty());
        (header, numbers)
    }

    #[test]
    fn arrays_read_back() {
        let (header, numbers) = read_back(&[2, 1, 2], &[1.5f32, -0.25, f32::MAX, 0.0]);
        assert_eq!((header.number, header.shape, header.fortran_order), (Number::Float(4), vec![2, 1, 2], false));
        assert_eq!(numbers, [1.5, -0.25, f32::MAX.into(), 0.0]);
        assert_eq!(read_back(&[], &[f64::MIN]).1, [f64::MIN]);
        assert_eq!(read_back(&[3], &[true, false, true]).1, [1.0, 0.0, 1.0]);
        assert_eq!(read_back(&[1, 2], &[7u8, 255]).1, [7.0, 255.0]);
        assert_eq!(read_back(&[2], &[7u32, u32::MAX]).1, [7.0, f64::from(u32::MAX)]);
        assert_eq!(read_back::<f32>(&[0, 3], &[]).0.shape, [0, 3]);
    }

    #[test]
    fn bytes_are_numpys() {
        let mut bytes = Vec::new();
        write(&mut bytes, &[3], [1u32, 2, 3]).unwrap();
        let text = "{'descr': '<u4', 'fortran_order': False, 'shape': (3, ), }";
        let mut expected = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        expected.extend(format!("{text:117}\n").as_bytes());
        expected.extend([1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0]);
        assert_eq!(bytes, expected);
    }

    #[test]
    fn another_number_of_values_is_an_error() {
        for count in [0, 5, 7] {
            let error = write(io::sink(), &[2, 3], std::iter::repeat_n(0f32, count)).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
        }
    }

    #[test]
    fn equal_archives_have_equal_bytes() {
        let archive = || {
            let mut archive = NpzWriter::new(io::Cursor::new(Vec::new()), false);
            archive.add("a", &[2], [1.0f64, 2.0]).unwrap();
            archive.add("b", &[], [true]).unwrap();
            assert!(archive.add("a", &[], [true]).is_err(), "a name twice");
            archive.finish().unwrap().into_inner()
        };
        assert_eq!(archive(), archive());
    }
}

//! Records: the fixed fields at the start of payloads, header and table entries (spec 2 and 3).
//!
//! The one module that uses bincode: fields in order, little-endian, fixed width, no padding; a sequence or a string
//! is preceded by its length as u64. Each section's file defines its record; every record checks its own limits, both
//! when it is read and when it is written.

use std::fmt::Display;

use bincode::de::BorrowDecoder;
use bincode::de::read::BorrowReader;
use bincode::enc::Encoder;
use bincode::error::{DecodeError, EncodeError};
pub(super) use bincode::{BorrowDecode, Encode};

use super::error::Error;
use super::limits;

const CONFIG: bincode::config::Configuration<
    bincode::config::LittleEndian,
    bincode::config::Fixint,
    bincode::config::Limit<{ limits::RECORD_BYTES }>,
> = bincode::config::standard().with_little_endian().with_fixed_int_encoding().with_limit::<{ limits::RECORD_BYTES }>();

/// A record with limits of its own.
pub(super) trait Record {
    /// The first limit that the record at `place` exceeds.
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        let _ = place;
        Ok(())
    }
}

/// Reads the record at the start of `bytes`, within its limits; also returns the bytes that follow it.
pub(super) fn read<'a, T: BorrowDecode<'a, ()> + Record>(
    place: &dyn Display,
    bytes: &'a [u8],
) -> Result<(T, &'a [u8]), Error> {
    let (record, used): (T, usize) = bincode::borrow_decode_from_slice(bytes, CONFIG).map_err(|error| match error {
        DecodeError::UnexpectedEnd { additional } => {
            let expected = format!("at least {} bytes", bytes.len() + additional);
            Error::malformed(format!("{place} record"), expected, format!("{} bytes", bytes.len()))
        }
        // Of [`Str`] and [`List`]; records have no arrays whose length is not their type's.
        DecodeError::ArrayLengthMismatch { required, found } => {
            let place = format!("{place} length of a string or a list");
            Error::Limit { place, min: 0, max: required as u64, found: found as u64 }
        }
        DecodeError::LimitExceeded => {
            let expected = format!("at most {} bytes", limits::RECORD_BYTES);
            Error::malformed(format!("{place} record"), expected, "more")
        }
        DecodeError::Utf8 { inner } => Error::malformed(place, "UTF-8", inner),
        other => Error::malformed(format!("{place} record"), "of the specified fields", other),
    })?;
    record.check(place)?;
    Ok((record, &bytes[used..]))
}

/// [`read`] of a record that fills `bytes`.
pub(super) fn read_whole<'a, T: BorrowDecode<'a, ()> + Record>(
    place: &dyn Display,
    bytes: &'a [u8],
) -> Result<T, Error> {
    let (record, rest) = read(place, bytes)?;
    Error::unless_equal(format!("{place} number of bytes after the record"), 0, rest.len())?;
    Ok(record)
}

/// The bytes of a record that is within its limits.
pub(super) fn write<T: Encode + Record>(place: &dyn Display, record: &T) -> Result<Vec<u8>, Error> {
    record.check(place)?;
    bincode::encode_to_vec(record, CONFIG)
        .map_err(|error| Error::malformed(format!("{place} record"), "of the specified fields", error))
}

/// A string of at most `MAX` bytes.
#[derive(Clone, Copy)]
pub(super) struct Str<'a, const MAX: u64>(pub(super) &'a str);

/// A list of at most `MAX` items.
pub(super) struct List<T, const MAX: u64>(pub(super) Vec<T>);

/// The length before a string or a list, which is compared with its limit before anything else.
fn length<'a, D: BorrowDecoder<'a>>(decoder: &mut D, max: u64) -> Result<usize, DecodeError> {
    let length = u64::borrow_decode(decoder)?;
    if length <= max {
        return Ok(length as usize);
    }
    Err(DecodeError::ArrayLengthMismatch { required: max as usize, found: length.try_into().unwrap_or(usize::MAX) })
}

impl<'a, Context, const MAX: u64> BorrowDecode<'a, Context> for Str<'a, MAX> {
    fn borrow_decode<D: BorrowDecoder<'a, Context = Context>>(decoder: &mut D) -> Result<Self, DecodeError> {
        let length = length(decoder, MAX)?;
        decoder.claim_bytes_read(length)?;
        let bytes = decoder.borrow_reader().take_bytes(length)?;
        std::str::from_utf8(bytes).map(Self).map_err(|inner| DecodeError::Utf8 { inner })
    }
}

impl<const MAX: u64> Encode for Str<'_, MAX> {
    fn encode<E: Encoder>(&self, encoder: &mut E) -> Result<(), EncodeError> {
        self.0.encode(encoder)
    }
}

impl<'a, Context, T: BorrowDecode<'a, Context>, const MAX: u64> BorrowDecode<'a, Context> for List<T, MAX> {
    fn borrow_decode<D: BorrowDecoder<'a, Context = Context>>(decoder: &mut D) -> Result<Self, DecodeError> {
        let length = length(decoder, MAX)?;
        (0..length).map(|_| T::borrow_decode(decoder)).collect::<Result<_, _>>().map(Self)
    }
}

impl<T: Encode + 'static, const MAX: u64> Encode for List<T, MAX> {
    fn encode<E: Encoder>(&self, encoder: &mut E) -> Result<(), EncodeError> {
        self.0.encode(encoder)
    }
}

/// Fields that follow in the record if `first` announces them.
pub(super) struct Optional<A, B> {
    pub(super) first: A,
    pub(super) more: Option<B>,
}

/// Fields that decide whether more follow.
pub(super) trait HasMore {
    fn has_more(&self) -> bool;
}

impl<'a, Context, A, B> BorrowDecode<'a, Context> for Optional<A, B>
where
    A: BorrowDecode<'a, Context> + HasMore,
    B: BorrowDecode<'a, Context>,
{
    fn borrow_decode<D: BorrowDecoder<'a, Context = Context>>(decoder: &mut D) -> Result<Self, DecodeError> {
        let first = A::borrow_decode(decoder)?;
        let more = first.has_more().then(|| B::borrow_decode(decoder)).transpose()?;
        Ok(Self { first, more })
    }
}

impl<A: Encode, B: Encode> Encode for Optional<A, B> {
    fn encode<E: Encoder>(&self, encoder: &mut E) -> Result<(), EncodeError> {
        self.first.encode(encoder)?;
        self.more.iter().try_for_each(|more| more.encode(encoder))
    }
}

/// A string that is a whole record: a license, the key or value of a note.
#[derive(Encode, BorrowDecode)]
pub(super) struct Text<'a> {
    pub(super) text: Str<'a, { *limits::TEXT_BYTES.end() }>,
}

impl Record for Text<'_> {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} bytes of text"), limits::TEXT_BYTES, self.text.0.len())
    }
}

/// The number of items that follow.
#[derive(Encode, BorrowDecode)]
pub(super) struct Count {
    pub(super) count: u64,
}

impl Record for Count {}

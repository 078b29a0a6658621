//! Arrays of numbers in groups (spec 3.3): as floats, or as integers times a step for each group.

use std::borrow::Cow;
use std::fmt::Display;

use super::codec::adaptive::{self, ArrayShape, Groups};
use super::encoding::{ArrayOptions, Encoding, Filter, GRID_BITS, integers, largest, step, step_code, write_integers};
use super::error::Error;
use super::limits::Budget;
use super::payload::Body;
use super::record::{BorrowDecode, Encode};
use super::writer::{Compression, FinishedSection, SectionPlace, Writer};
use crate::binary16;

/// The codes of an array, at the end of its section's record; 4 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Encode, BorrowDecode)]
pub(super) struct ArrayHead {
    encoding: u8,
    bits: u8,
    filter: u8,
    reserved: u8,
}

/// An array that is ready for a file.
pub(super) struct EncodedArray {
    pub(super) head: ArrayHead,
    pub(super) body: Vec<u8>,
}

/// Writes `values`, cut into groups of `lengths`; `steps` holds the groups' step codes, or is `None` for the finest that
/// reach every number.
pub(super) fn write(
    place: &dyn Display,
    values: &[f32],
    lengths: impl Iterator<Item = usize> + Clone,
    ArrayOptions { encoding, filter }: ArrayOptions,
    steps: Option<&[u8]>,
) -> Result<EncodedArray, Error> {
    let (code, bits) = encoding.codes();
    let filter_code = match filter {
        Filter::None => 0,
        Filter::Planes => 1,
    };
    let mut body = Vec::with_capacity(encoding.length(lengths.clone().count() as u64, values.len() as u64) as usize);
    let head = ArrayHead { encoding: code, bits, filter: filter_code, reserved: 0 };
    check_filter(place, encoding, filter)?;
    let within = |largest: f32, is_too_large: &dyn Fn(f32) -> bool| match values.iter().position(|&v| is_too_large(v)) {
        Some(i) => Err(Error::Overflow { place: format!("{place} entry {i}"), value: values[i], largest }),
        None => Ok(()),
    };
    match encoding {
        Encoding::F32 => body.extend(values.iter().flat_map(|v| v.to_le_bytes())),
        Encoding::F16 => {
            within(binary16::LARGEST, &|v| binary16::value_of(binary16::bits_of(v)).is_infinite())?;
            body.extend(values.iter().flat_map(|&v| binary16::bits_of(v).to_le_bytes()));
        }
        Encoding::Grid(bits) => {
            let found;
            let steps = match steps {
                Some(steps) => steps,
                None => {
                    let most = step(u8::MAX) * largest(bits);
                    within(most, &|v| v.abs() > most)?;
                    found = finest_steps(bits, groups_of(values, lengths.clone()));
                    &found
                }
            };
            body.extend_from_slice(steps);
            let width = encoding.width();
            for (group, &code) in groups_of(values, lengths.clone()).zip(steps) {
                let step = step(code);
                let integers: Vec<i16> = group.iter().map(|&v| rounded(v, step, largest(bits))).collect();
                let first = body.len();
                body.resize(first + width * integers.len(), 0);
                write_integers(&mut body[first..], &integers, width);
            }
        }
    }
    if filter == Filter::Planes {
        to_planes(&mut body, encoding.width());
    }
    Ok(EncodedArray { head, body })
}

/// The section of a `record` and a `body` that ends with an array in `encoding`, compressed if that makes it smaller. `shape`
/// is asked for if integers are to be coded.
pub(super) fn finished(
    compression: Compression,
    place: SectionPlace,
    record: Vec<u8>,
    body: &[u8],
    encoding: Encoding,
    shape: impl FnOnce(u8) -> ArrayShape,
) -> Result<FinishedSection, Error> {
    match encoding {
        Encoding::F32 | Encoding::F16 => compression.finished(place, record, body),
        Encoding::Grid(bits) => {
            compression.finished_adaptive(place, record, body, || adaptive::compress_integers(&shape(bits), body))
        }
    }
}

/// Writes the section at `place`, named `name`, of a network's numbers (DECODER, MATRIX or PREFIX). `steps` holds the step
/// codes of its rows, or is empty for the finest steps. `record` makes its record from the array's head.
pub(super) fn write_network(
    writer: &mut Writer,
    place: SectionPlace,
    name: &dyn Display,
    values: &[f32],
    lengths: impl Iterator<Item = usize> + Clone,
    (options, steps): (ArrayOptions, &[u8]),
    record: impl FnOnce(ArrayHead) -> Result<Vec<u8>, Error>,
) -> Result<(), Error> {
    let (rows, _) = count(lengths.clone());
    let steps = Some(steps).filter(|steps| !steps.is_empty());
    if let Some(steps) = steps {
        Error::unless_equal(format!("number of step codes of {name}"), rows, steps.len() as u64)?;
    }
    let EncodedArray { head, body } = write(name, values, lengths.clone(), options, steps)?;
    let shape = |bits| of_rows(bits, lengths);
    let section = finished(writer.compression(), place, record(head)?, &body, options.encoding, shape)?;
    writer.add(section);
    Ok(())
}

/// The numbers of a network (DECODER, MATRIX and PREFIX), whose array is the whole of `body`, and the step codes of its
/// rows, none for floats.
pub(super) fn read_network(
    body: &Body<'_>,
    head: &ArrayHead,
    lengths: impl Iterator<Item = usize> + Clone,
    budget: &mut Budget,
) -> Result<(Vec<f32>, Vec<u8>), Error> {
    let encoding = head.options(body.section)?.encoding;
    let (groups, numbers) = count(lengths.clone());
    // The numbers, and the integers in another arrangement.
    budget.spend(body.section, 8 * numbers)?;
    let length = encoding.length(groups, numbers);
    let bytes = decode(body, length, encoding, budget, |bits| of_rows(bits, lengths.clone()))?;
    let steps = if encoding.is_by_group() { bytes[..groups as usize].to_vec() } else { Vec::new() };
    Ok((read(body.section, head, &bytes, lengths)?, steps))
}

/// The decoded `body` of `length` bytes, which ends with an array in `encoding`. `shape` is asked for if integers are coded.
pub(super) fn decode<'a>(
    body: &Body<'a>,
    length: u64,
    encoding: Encoding,
    budget: &mut Budget,
    shape: impl FnOnce(u8) -> ArrayShape,
) -> Result<Cow<'a, [u8]>, Error> {
    body.decode_by(length, budget, |bytes, _| {
        let Encoding::Grid(bits) = encoding else {
            return Err(Error::malformed(format!("{} codec", body.section), "stored or zstd for floats", "adaptive"));
        };
        adaptive::decompress_integers(body.section, &shape(bits), length as usize, bytes)
    })
}

/// The shape of an array of rows of these lengths.
fn of_rows(bits: u8, lengths: impl Iterator<Item = usize>) -> ArrayShape {
    ArrayShape { bits, masks: None, groups: Groups::Rows(lengths.collect()) }
}

/// Groups and numbers.
pub(super) fn count(lengths: impl Iterator<Item = usize>) -> (u64, u64) {
    lengths.fold((0, 0), |(groups, numbers), length| (groups + 1, numbers + length as u64))
}

/// The numbers of `body`, whose length the caller has checked against [`Encoding::length`].
pub(super) fn read(
    place: &dyn Display,
    head: &ArrayHead,
    body: &[u8],
    lengths: impl Iterator<Item = usize> + Clone,
) -> Result<Vec<f32>, Error> {
    let ArrayOptions { encoding, filter } = head.options(place)?;
    let groups = if encoding.is_by_group() { lengths.clone().count() } else { 0 };
    let (steps, numbers) = body.split_at(groups);
    let numbers: Cow<[u8]> = match filter {
        Filter::Planes => from_planes(numbers, encoding.width()).into(),
        _ => numbers.into(),
    };
    let mut values = Vec::with_capacity(numbers.len() / encoding.width());
    match encoding {
        Encoding::F32 => values.extend(numbers.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b))),
        Encoding::F16 => {
            values.extend(numbers.as_chunks().0.iter().map(|&b| binary16::value_of(u16::from_le_bytes(b))));
        }
        Encoding::Grid(bits) => {
            let width = encoding.width();
            let most = largest(bits) as i16;
            let mut rest = &numbers[..];
            for (n, (length, &code)) in lengths.zip(steps).enumerate() {
                let (group, after) = rest.split_at(width * length);
                rest = after;
                let step = step(code);
                let is_allowed = |q: i16| q.unsigned_abs() <= most.unsigned_abs() && (code != 0 || q == 0);
                if let Some(q) = integers(group, width).find(|&q| !is_allowed(q)) {
                    let expected = if code == 0 { "0".into() } else { format!("-{most} to {most}") };
                    return Err(Error::malformed(format!("{place} integer of group {n}"), expected, q));
                }
                values.extend(integers(group, width).map(|q| step * f32::from(q)));
            }
        }
    }
    Ok(values)
}

impl ArrayHead {
    /// The encoding and filter of these codes.
    pub(super) fn options(&self, place: &dyn Display) -> Result<ArrayOptions, Error> {
        let options = self.codes(place)?;
        check_filter(place, options.encoding, options.filter)?;
        Ok(options)
    }

    /// [`Error::Unsupported`] if a code or the reserved byte belongs to a later version.
    pub(super) fn check(&self, place: &dyn Display) -> Result<(), Error> {
        self.codes(place).map(drop)
    }

    fn codes(&self, place: &dyn Display) -> Result<ArrayOptions, Error> {
        let encoding = self.encoding(place)?;
        let filter = match self.filter {
            0 => Filter::None,
            1 => Filter::Planes,
            code => return Err(Error::unknown_code(place, "filter", code)),
        };
        Error::unless_reserved(format!("{place} array head"), &[self.reserved])?;
        Ok(ArrayOptions { encoding, filter })
    }

    fn encoding(&self, place: &dyn Display) -> Result<Encoding, Error> {
        let unsupported = |field: &str, code| Err(Error::unknown_code(place, field, code));
        match (self.encoding, self.bits) {
            (0, 0) => Ok(Encoding::F32),
            (1, 0) => Ok(Encoding::F16),
            (2, bits) if GRID_BITS.contains(&bits) => Ok(Encoding::Grid(bits)),
            (0..=2, bits) => unsupported("bits", bits),
            (code, _) => unsupported("encoding", code),
        }
    }
}

/// The step codes that lose least: the smallest steps that reach each group's largest number.
fn finest_steps<'a>(bits: u8, groups: impl Iterator<Item = &'a [f32]>) -> Vec<u8> {
    let size = |values: &[f32]| values.iter().fold(0.0f32, |m, v| m.max(v.abs()));
    groups.map(|group| step_code(size(group) / largest(bits))).collect()
}

fn check_filter(place: &dyn Display, encoding: Encoding, filter: Filter) -> Result<(), Error> {
    let (fits, name) = match filter {
        Filter::None => (true, "none"),
        Filter::Planes => (!encoding.is_by_group(), "planes"),
    };
    if fits { Ok(()) } else { Err(Error::malformed(format!("{place} filter"), "one of its encoding", name)) }
}

/// `values` cut into groups.
fn groups_of(values: &[f32], lengths: impl Iterator<Item = usize>) -> impl Iterator<Item = &[f32]> {
    let mut rest = values;
    lengths.map(move |length| {
        let (group, after) = rest.split_at(length);
        rest = after;
        group
    })
}

/// The integer of `value` in these steps.
fn rounded(value: f32, step: f32, largest: f32) -> i16 {
    if step == 0.0 { 0 } else { (value / step).round_ties_even().clamp(-largest, largest) as i16 }
}

fn to_planes(bytes: &mut [u8], width: usize) {
    let numbers = bytes.len() / width;
    let interleaved = bytes.to_vec();
    for (i, number) in interleaved.chunks_exact(width).enumerate() {
        for (plane, &byte) in number.iter().enumerate() {
            bytes[plane * numbers + i] = byte;
        }
    }
}

fn from_planes(bytes: &[u8], width: usize) -> Vec<u8> {
    let numbers = bytes.len() / width;
    (0..numbers).flat_map(|i| (0..width).map(move |plane| bytes[plane * numbers + i])).collect()
}

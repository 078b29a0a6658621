//! Arrays of numbers in groups (spec 3.3): as floats, as integers times a step for each group, or as integers times a
//! step for the cosine transform of each group.

use std::fmt::Display;

use half::f16;

use super::cosine::CosineTransform;
use super::encoding::{ArrayOptions, Encoding, Filter, GRID_BITS, largest, step, step_code};
use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Body;
use super::record::{BorrowDecode, Encode};

/// The codes of an array, at the end of its section's record; 8 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Encode, BorrowDecode)]
pub(super) struct ArrayHead {
    encoding: u8,
    bits: u8,
    filter: u8,
    reserved: u8,
    /// The largest difference of a number from that which the writer was given.
    error: f32,
}

/// An array that is ready for a file.
pub(super) struct Written {
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
) -> Result<Written, Error> {
    let (code, bits) = encoding.codes();
    let filter_code = match filter {
        Filter::None => 0,
        Filter::Planes => 1,
        Filter::Differences => 2,
    };
    let mut body = Vec::with_capacity(encoding.length(lengths.clone().count() as u64, values.len() as u64) as usize);
    let head = |error| ArrayHead { encoding: code, bits, filter: filter_code, reserved: 0, error };
    check_filter(place, encoding, filter)?;
    let within = |largest: f32, is_too_large: &dyn Fn(f32) -> bool| match values.iter().position(|&v| is_too_large(v)) {
        Some(i) => Err(Error::Overflow { place: format!("{place} entry {i}"), value: values[i], largest }),
        None => Ok(()),
    };
    match encoding {
        Encoding::F32 => body.extend(values.iter().flat_map(|v| v.to_le_bytes())),
        Encoding::F16 => {
            within(f16::MAX.into(), &|v| f16::from_f32(v).is_infinite())?;
            body.extend(values.iter().flat_map(|&v| f16::from_f32(v).to_le_bytes()));
        }
        Encoding::Grid(_) | Encoding::Cosine => {
            let found;
            let steps = match steps {
                Some(steps) => steps,
                None => {
                    if let Encoding::Grid(bits) = encoding {
                        let most = step(u8::MAX) * largest(bits);
                        within(most, &|v| v.abs() > most)?;
                    }
                    found = finest_steps(encoding, groups_of(values, lengths.clone()));
                    &found
                }
            };
            body.extend_from_slice(steps);
            let mut cosines = Cosines::default();
            let mut integers = Vec::new();
            for (group, &code) in groups_of(values, lengths.clone()).zip(steps) {
                let step = step(code);
                match encoding {
                    Encoding::Grid(bits) => round_to_grid(group, step, largest(bits), &mut integers),
                    _ => round_to_grid(cosines.forward(group), step, f32::from(i16::MAX), &mut integers),
                }
                write_integers(&integers, encoding, filter, &mut body);
            }
        }
    }
    let floats_at = if encoding.is_by_group() { lengths.clone().count() } else { 0 };
    if filter == Filter::Planes {
        to_planes(&mut body[floats_at..], encoding.width());
    }
    let mut written = Written { head: head(0.0), body };
    let read = read(place, &written.head, &written.body, lengths)?;
    let error = read.iter().zip(values).map(|(r, v)| (f64::from(*r) - f64::from(*v)).abs()).fold(0.0, f64::max);
    // Rounded up, so that the bound holds.
    written.head.error = if error == 0.0 { 0.0 } else { (error as f32).next_up() };
    Ok(written)
}

/// [`write`] of the numbers of a network (DECODER, MATRIX and PREFIX), in the finest steps.
pub(super) fn write_network(
    place: &dyn Display,
    values: &[f32],
    lengths: impl Iterator<Item = usize> + Clone,
    options: ArrayOptions,
) -> Result<Written, Error> {
    check_network_encoding(place, options.encoding)?;
    write(place, values, lengths, options, None)
}

/// The numbers of a network (DECODER, MATRIX and PREFIX), whose array is the whole of `body`.
pub(super) fn read_network(
    body: &Body<'_>,
    head: &ArrayHead,
    lengths: impl Iterator<Item = usize> + Clone,
    budget: &mut Budget,
) -> Result<Vec<f32>, Error> {
    let encoding = head.options(body.section)?.encoding;
    check_network_encoding(body.section, encoding)?;
    let (groups, numbers) = count(lengths.clone());
    // The numbers, and the integers in another arrangement.
    budget.spend(body.section, 8 * numbers)?;
    let bytes = body.decode(encoding.length(groups, numbers), budget)?;
    read(body.section, head, &bytes, lengths)
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
    let numbers: std::borrow::Cow<[u8]> = match filter {
        Filter::Planes => from_planes(numbers, encoding.width()).into(),
        _ => numbers.into(),
    };
    let mut values = Vec::with_capacity(numbers.len() / encoding.width());
    match encoding {
        Encoding::F32 => values.extend(numbers.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b))),
        Encoding::F16 => values.extend(numbers.as_chunks().0.iter().map(|&b| f16::from_le_bytes(b).to_f32())),
        Encoding::Grid(bits) => {
            let mut at = 0;
            for (n, (length, &code)) in lengths.zip(steps).enumerate() {
                let step = step(code);
                let most = largest(bits) as i8;
                let mut previous = 0i8;
                for &byte in &numbers[at..at + length] {
                    let q = if filter == Filter::Differences { previous.wrapping_add(byte as i8) } else { byte as i8 };
                    if q.unsigned_abs() > most.unsigned_abs() || (code == 0 && q != 0) {
                        let expected = if code == 0 { "0".into() } else { format!("-{most} to {most}") };
                        return Err(Error::malformed(format!("{place} integer of group {n}"), expected, q));
                    }
                    previous = q;
                    values.push(step * f32::from(q));
                }
                at += length;
            }
        }
        Encoding::Cosine => {
            let integers = numbers.as_chunks::<2>().0;
            let (mut cosines, mut coefficients, mut at) = (Cosines::default(), Vec::new(), 0);
            for length in lengths.clone() {
                limits::check(format!("{place} numbers of a group"), limits::COSINE_LENGTH, length)?;
            }
            for (n, (length, &code)) in lengths.zip(steps).enumerate() {
                let step = step(code);
                coefficients.clear();
                coefficients
                    .extend(integers[at..at + length].iter().map(|&b| step * from_zigzag(u16::from_le_bytes(b))));
                if code == 0 && integers[at..at + length].iter().any(|b| *b != [0; 2]) {
                    return Err(Error::malformed(format!("{place} integers of group {n}"), "zeros", "another number"));
                }
                values.extend_from_slice(cosines.inverse(&coefficients));
                at += length;
            }
        }
    }
    Ok(values)
}

impl ArrayHead {
    /// The encoding and filter of these codes.
    pub(super) fn options(&self, place: &dyn Display) -> Result<ArrayOptions, Error> {
        let encoding = self.encoding(place)?;
        let filter = match self.filter {
            0 => Filter::None,
            1 => Filter::Planes,
            2 => Filter::Differences,
            code => return Err(Error::unsupported(format!("{place} filter"), format!("code {code}"))),
        };
        check_filter(place, encoding, filter)?;
        Error::unless_equal(format!("{place} reserved field"), 0, self.reserved)?;
        let valid = self.error.is_finite() && self.error >= 0.0 && (encoding != Encoding::F32 || self.error == 0.0);
        if !valid {
            return Err(Error::invalid(format!("{place} error"), "finite, at least 0, and 0 for f32", self.error));
        }
        Ok(ArrayOptions { encoding, filter })
    }

    fn encoding(&self, place: &dyn Display) -> Result<Encoding, Error> {
        let unsupported = |what: &str, code| Err(Error::unsupported(format!("{place} {what}"), format!("code {code}")));
        match (self.encoding, self.bits) {
            (0, 0) => Ok(Encoding::F32),
            (1, 0) => Ok(Encoding::F16),
            (2, bits) if GRID_BITS.contains(&bits) => Ok(Encoding::Grid(bits)),
            (3, 16) => Ok(Encoding::Cosine),
            (0..=3, bits) => unsupported("bits", bits),
            (code, _) => unsupported("encoding", code),
        }
    }
}

/// The step codes that lose least: the smallest steps that reach each group's largest number, or coefficient.
fn finest_steps<'a>(encoding: Encoding, groups: impl Iterator<Item = &'a [f32]>) -> Vec<u8> {
    let size = |values: &[f32]| values.iter().fold(0.0f32, |m, v| m.max(v.abs()));
    let mut cosines = Cosines::default();
    let step_of = |group: &[f32]| match encoding {
        Encoding::F32 | Encoding::F16 => 0.0,
        Encoding::Grid(bits) => size(group) / largest(bits),
        Encoding::Cosine => size(cosines.forward(group)) / f32::from(i16::MAX),
    };
    groups.map(step_of).map(step_code).collect()
}

/// The arrays of networks have no cosine encoding (spec 3.5, 3.8 and 3.11).
fn check_network_encoding(place: &dyn Display, encoding: Encoding) -> Result<(), Error> {
    match encoding {
        Encoding::F32 | Encoding::F16 | Encoding::Grid(_) => Ok(()),
        Encoding::Cosine => Err(Error::malformed(format!("{place} encoding"), "f32, f16 or grid", "cosine")),
    }
}

fn check_filter(place: &dyn Display, encoding: Encoding, filter: Filter) -> Result<(), Error> {
    let (fits, name) = match filter {
        Filter::None => (true, "none"),
        Filter::Planes => (encoding.width() > 1, "planes"),
        Filter::Differences => (matches!(encoding, Encoding::Grid(_)), "differences"),
    };
    if fits { Ok(()) } else { Err(Error::malformed(format!("{place} filter"), "one of its encoding", name)) }
}

/// Transforms of the lengths used so far.
#[derive(Default)]
struct Cosines {
    known: Vec<(usize, CosineTransform)>,
    result: Vec<f32>,
}

impl Cosines {
    fn with_length(&mut self, length: usize) -> (&CosineTransform, &mut Vec<f32>) {
        let at = self.known.iter().position(|k| k.0 == length).unwrap_or_else(|| {
            self.known.push((length, CosineTransform::new(length)));
            self.known.len() - 1
        });
        (&self.known[at].1, &mut self.result)
    }

    fn forward(&mut self, values: &[f32]) -> &[f32] {
        let (transform, result) = self.with_length(values.len());
        transform.forward(values, result);
        &self.result
    }

    fn inverse(&mut self, coefficients: &[f32]) -> &[f32] {
        let (transform, result) = self.with_length(coefficients.len());
        transform.inverse(coefficients, result);
        &self.result
    }
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

fn round_to_grid(values: &[f32], step: f32, largest: f32, integers: &mut Vec<i16>) {
    integers.clear();
    if step == 0.0 {
        integers.resize(values.len(), 0);
    } else {
        integers.extend(values.iter().map(|v| (v / step).round_ties_even().clamp(-largest, largest) as i16));
    }
}

fn write_integers(integers: &[i16], encoding: Encoding, filter: Filter, body: &mut Vec<u8>) {
    if encoding == Encoding::Cosine {
        body.extend(integers.iter().flat_map(|&q| to_zigzag(q).to_le_bytes()));
        return;
    }
    let mut previous = 0;
    for &q in integers {
        body.push(q.wrapping_sub(previous) as u8);
        if filter == Filter::Differences {
            previous = q;
        }
    }
}

fn to_zigzag(q: i16) -> u16 {
    ((q << 1) ^ (q >> 15)) as u16
}

fn from_zigzag(z: u16) -> f32 {
    f32::from((z >> 1) as i16 ^ -((z & 1) as i16))
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

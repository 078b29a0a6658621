//! The body of an array in the encoding grid: masks of components, step codes, and integers, each by those near it (spec 2.5).

use std::fmt;
use std::hint::select_unpredictable;

use super::coder::{BitDecoder, BitEncoder, Coder, Counter};
use crate::container::Error;
use crate::container::encoding::{Encoding, integers, largest, write_integers};

/// Sizes of remainders that contexts distinguish: four to an octave.
const CLASSES: usize = 48;
/// Remainders count as no larger than this in the sizes around a number.
const LARGEST_SIZE: i32 = 1023;
/// Contexts of a number beside the class: where in a step the prediction lies (3), whether the last remainder was 0 (2), and
/// how large the prediction is (3).
const PLACES: usize = 18;
/// Step codes of an octave have one context each half of it.
const STEP_CONTEXTS: usize = 64;
/// Bits that are set if a remainder is larger than 0, 1, 2, …; larger ones are a number behind those.
const UNARY: usize = 18;
/// The first of these bits, which are most of all bits: their counters are in tables of their own, which fit a near cache.
const FIRST: usize = 4;
/// Most bits of that number but its first.
const LONGEST: u32 = 17;

/// The shape of an array and of the masks before it.
#[derive(Clone, Debug)]
pub(in crate::container) struct ArrayShape {
    /// Bits of the integers, as in the array's head.
    pub(in crate::container) bits: u8,
    /// Tensors and their rank, if the body begins with masks of the components that they have.
    pub(in crate::container) masks: Option<[usize; 2]>,
    pub(in crate::container) groups: Groups,
}

/// The groups of an array. The numbers of a group have one step.
#[derive(Clone, Debug)]
pub(in crate::container) enum Groups {
    /// Components of so many tensors, block by block. A block has a number of components a tensor, and the lengths of the vectors
    /// of each. Masks, if there are any, select the components that tensors have.
    Components { tensors: usize, blocks: Vec<(usize, Vec<usize>)> },
    /// Rows of networks, of these lengths.
    Rows(Vec<usize>),
}

impl ArrayShape {
    /// Bytes of the masks.
    fn mask_bytes(&self) -> usize {
        self.masks.map_or(0, |[tensors, rank]| tensors * rank.div_ceil(8))
    }

    /// Bytes of an integer.
    fn width(&self) -> usize {
        Encoding::Grid(self.bits).width()
    }

    /// \[block\] the groups, and the lengths of the vectors of each; `masks` are read. Rows are of blocks of one group.
    fn blocks(&self, masks: &[u8]) -> Vec<(usize, &[usize])> {
        match &self.groups {
            Groups::Rows(lengths) => lengths.chunks(1).map(|row| (1, row)).collect(),
            Groups::Components { tensors, blocks } => {
                let mut first = 0;
                let mut block = |rank: usize| {
                    let range = first..first + rank;
                    first = range.end;
                    match self.masks {
                        None => tensors * rank,
                        Some([_, all]) => {
                            let is_set = |mask: &[u8], c: usize| mask[c / 8] >> (c % 8) & 1 == 1;
                            let of_tensor = |mask: &[u8]| range.clone().filter(|&c| is_set(mask, c)).count();
                            masks.chunks_exact(all.div_ceil(8)).map(of_tensor).sum()
                        }
                    }
                };
                blocks.iter().map(|(rank, vectors)| (block(*rank), vectors.as_slice())).collect()
            }
        }
    }
}

/// Groups, and numbers in all of them.
fn count(blocks: &[(usize, &[usize])]) -> [usize; 2] {
    let numbers = |(count, vectors): &(usize, &[usize])| count.saturating_mul(vectors.iter().sum());
    [blocks.iter().map(|b| b.0).sum(), blocks.iter().map(numbers).fold(0, usize::saturating_add)]
}

/// Codes `body`: the masks, the step codes, and the integers of an array of this shape.
pub(in crate::container) fn compress(shape: &ArrayShape, body: &[u8]) -> Vec<u8> {
    let (masks, rest) = body.split_at(shape.mask_bytes());
    let blocks = shape.blocks(masks);
    let (steps, numbers) = rest.split_at(count(&blocks)[0]);
    let mut encoder = BitEncoder::new();
    if let Some([_, rank]) = shape.masks {
        code_masks(&mut encoder, rank, &mut masks.to_vec());
    }
    code_steps(&mut encoder, &mut steps.to_vec());
    let all: Vec<i16> = integers(numbers, shape.width()).collect();
    let mut predictor = Predictor::of(&blocks, &all);
    predictor.code(&mut encoder);
    // Only a decoder finds a number that is too large.
    let _ =
        NumberContexts::new(predictor, shape).code(&mut encoder, &blocks, steps, &mut numbers.to_vec(), shape.width());
    encoder.finish()
}

/// The inverse of [`compress`]: a body of `length` bytes. Takes that, and less than 1 MiB for contexts; the caller has checked that
/// there is so much.
pub(in crate::container) fn decompress(
    place: &dyn fmt::Display,
    shape: &ArrayShape,
    length: usize,
    bytes: &[u8],
) -> Result<Vec<u8>, Error> {
    let mask_bytes = shape.mask_bytes();
    if length < mask_bytes {
        return Err(Error::malformed(format!("{place} body length"), format!("at least {mask_bytes}"), length));
    }
    let mut decoder = BitDecoder::new(bytes, place)?;
    let mut body = vec![0; length];
    let (masks, rest) = body.split_at_mut(mask_bytes);
    if let Some([_, rank]) = shape.masks {
        code_masks(&mut decoder, rank, masks);
    }
    let blocks = shape.blocks(masks);
    let [groups, numbers] = count(&blocks);
    let implied = shape.width().saturating_mul(numbers).saturating_add(groups).saturating_add(mask_bytes);
    Error::unless_equal(format!("{place} body length"), implied, length)?;
    let (steps, numbers) = rest.split_at_mut(groups);
    code_steps(&mut decoder, steps);
    let mut predictor = Predictor::default();
    predictor.code(&mut decoder);
    let result = NumberContexts::new(predictor, shape).code(&mut decoder, &blocks, steps, numbers, shape.width());
    result.map_err(|TooLarge { largest, group }| {
        Error::malformed(
            format!("{place} integer of group {group}"),
            format!("-{largest} to {largest}"),
            "a larger one",
        )
    })?;
    decoder.finish(place)?;
    Ok(body)
}

/// Codes which components tensors have, each by the component before it and by the same one of the tensor before.
fn code_masks(coder: &mut impl Coder, rank: usize, masks: &mut [u8]) {
    let mut counters = vec![[Counter::default(); 4]; rank];
    let mut before = vec![true; rank];
    for mask in masks.chunks_exact_mut(rank.div_ceil(8)) {
        let mut last = true;
        for (c, (counters, before)) in counters.iter_mut().zip(&mut before).enumerate() {
            let bit = mask[c / 8] >> (c % 8) & 1 == 1;
            last = coder.code_in(bit, &mut counters[usize::from(last) + 2 * usize::from(*before)]);
            *before = last;
            mask[c / 8] |= u8::from(last) << (c % 8);
        }
    }
}

/// Codes step codes, each by its difference to the one before.
fn code_steps(coder: &mut impl Coder, steps: &mut [u8]) {
    let mut differences = DifferenceContexts::default();
    let mut before = 0;
    for step in steps {
        before = differences.code(coder, *step, before);
        *step = before;
    }
}

/// Contexts of differences between step codes, by the size of the last one.
struct DifferenceContexts {
    zero: [Counter; 4],
    sign: [Counter; 3],
    /// \[size of the last one\]\[n\] whether the magnitude is larger than n + 1.
    larger: [[Counter; 127]; 4],
    last: i32,
}

impl Default for DifferenceContexts {
    fn default() -> Self {
        Self { zero: Default::default(), sign: Default::default(), larger: [[Counter::default(); 127]; 4], last: 0 }
    }
}

impl DifferenceContexts {
    /// The step code, `before` that before it. Differences wrap around, so that every one of them is a step code.
    fn code(&mut self, coder: &mut impl Coder, step: u8, before: u8) -> u8 {
        let difference = i32::from(step.wrapping_sub(before) as i8);
        let context = self.last.unsigned_abs().min(3) as usize;
        let mut found = 0;
        if coder.code_in(difference != 0, &mut self.zero[context]) {
            let sign = &mut self.sign[(self.last.signum() + 1) as usize];
            let is_negative = coder.code_in(difference < 0, sign);
            found = 1;
            while found < 128 && coder.code_in(difference.abs() > found, &mut self.larger[context][found as usize - 1])
            {
                found += 1;
            }
            if is_negative {
                found = -found;
            }
        }
        self.last = found;
        before.wrapping_add(found as u8)
    }
}

/// How a number follows from the two before it in its vector, in 1/256.
#[derive(Clone, Copy, Debug, Default)]
struct Predictor {
    weights: [i16; 2],
}

impl Predictor {
    /// The one with the least squared remainders.
    fn of(blocks: &[(usize, &[usize])], integers: &[i16]) -> Self {
        // Sums of the normal equations of r[i] by r[i − 1] and r[i − 2].
        let (mut a11, mut a12, mut a22, mut b1, mut b2) = (0i64, 0i64, 0i64, 0i64, 0i64);
        let mut rest = integers;
        let groups = blocks.iter().flat_map(|&(count, vectors)| std::iter::repeat_n(vectors, count));
        for &length in groups.flatten() {
            let (vector, after) = rest.split_at(length);
            rest = after;
            for three in vector.windows(3) {
                let [z, y, x] = [0, 1, 2].map(|i| i64::from(three[i]));
                a11 += y * y;
                a12 += y * z;
                a22 += z * z;
                b1 += x * y;
                b2 += x * z;
            }
        }
        let [a11, a12, a22, b1, b2] = [a11, a12, a22, b1, b2].map(|v| v as f64);
        let determinant = a11 * a22 - a12 * a12;
        if determinant <= 0.0 {
            return Self::default();
        }
        let weight = |numerator: f64| (256.0 * numerator / determinant).round() as i16;
        Self { weights: [weight(b1 * a22 - b2 * a12), weight(b2 * a11 - b1 * a12)] }
    }

    /// Codes the weights, the highest of 16 bits first.
    fn code(&mut self, coder: &mut impl Coder) {
        for weight in &mut self.weights {
            *weight = code_bits(coder, u32::from(*weight as u16), 16) as u16 as i16;
        }
    }

    /// 256 times the number that follows `last` and the one before it.
    #[inline(always)]
    fn next(self, last: [i32; 2]) -> i32 {
        i32::from(self.weights[0]) * last[0] + i32::from(self.weights[1]) * last[1]
    }
}

/// The lowest `count` bits of `bits`, the highest first, each as likely 0 as 1.
fn code_bits(coder: &mut impl Coder, bits: u32, count: u32) -> u32 {
    (0..count).rev().fold(0, |found, at| found << 1 | u32::from(coder.code(bits >> at & 1 == 1, 1 << 15, [])))
}

/// A number is larger than its bits allow.
#[derive(Clone, Copy, Debug)]
struct TooLarge {
    largest: i32,
    group: usize,
}

/// \[context\]\[n\] the counters of the bits for whether a remainder is larger than n.
struct Larger {
    first: Vec<[Counter; FIRST]>,
    other: Vec<[Counter; UNARY - FIRST]>,
}

impl Larger {
    fn new(contexts: usize) -> Self {
        Self { first: vec![Default::default(); contexts], other: vec![Default::default(); contexts] }
    }
}

/// Codes how many of the bits for whether a remainder of this `magnitude` is larger than n are 1, for n from `from` on,
/// each by a counter of both.
#[inline(always)]
fn code_unary(coder: &mut impl Coder, magnitude: i32, from: usize, by: [&mut [Counter]; 2]) -> usize {
    let [by_place, by_step] = by;
    let mut found = 0;
    for (place, step) in by_place.iter_mut().zip(by_step) {
        let probability = (place.probability() + step.probability()) / 2;
        if !coder.code(magnitude > (from + found) as i32, probability, [place, step]) {
            break;
        }
        found += 1;
    }
    found
}

/// The contexts of numbers.
struct NumberContexts {
    predictor: Predictor,
    largest: i32,
    /// \[place\]\[class\], and \[step\]\[class\].
    by_place: Larger,
    by_step: Larger,
    /// \[where in a step the prediction lies\]\[sign of the last remainder\].
    signs: [[Counter; 3]; 3],
    /// \[vertex of all vectors of a group\] how large remainders were there lately, in 1/16; of components, in their block.
    sizes: Vec<i32>,
    are_rows: bool,
}

impl NumberContexts {
    fn new(predictor: Predictor, shape: &ArrayShape) -> Self {
        Self {
            predictor,
            largest: largest(shape.bits) as i32,
            by_place: Larger::new(CLASSES * PLACES),
            by_step: Larger::new(CLASSES * STEP_CONTEXTS),
            signs: Default::default(),
            sizes: Vec::new(),
            are_rows: matches!(shape.groups, Groups::Rows(_)),
        }
    }

    /// Codes the integers of `bytes`, of `width` bytes each. An encoder finds them there, a decoder writes them there.
    fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        blocks: &[(usize, &[usize])],
        steps: &[u8],
        bytes: &mut [u8],
        width: usize,
    ) -> Result<(), TooLarge> {
        let mut rest = bytes;
        let longest = blocks.iter().flat_map(|(_, vectors)| *vectors).max();
        let mut vector = vec![0; longest.map_or(0, |&longest| longest)];
        let groups = blocks.iter().flat_map(|&(count, vectors)| (0..count).map(move |n| (n, vectors)));
        for (group, ((n, vectors), &step)) in groups.zip(steps).enumerate() {
            if coder.is_over() {
                break;
            }
            if n == 0 {
                if !self.are_rows {
                    self.sizes.clear();
                }
                self.sizes.resize(vectors.iter().sum::<usize>().max(self.sizes.len()), 0);
            }
            let mut first = 0;
            for &length in vectors {
                let (bytes, after) = rest.split_at_mut(width * length);
                rest = after;
                let vector = &mut vector[..length];
                if !C::DECODES {
                    vector.iter_mut().zip(integers(bytes, width)).for_each(|(number, q)| *number = q);
                }
                self.code_vector(coder, usize::from(step >> 2), first, vector)
                    .ok_or(TooLarge { largest: self.largest, group })?;
                if C::DECODES {
                    write_integers(bytes, vector, width);
                }
                first += length;
            }
        }
        Ok(())
    }

    /// Codes a vector whose vertices begin at `first`; `None` if a number is too large.
    ///
    /// Not inlined: a browser compiles a function better only for the calls after that.
    #[inline(never)]
    fn code_vector(&mut self, coder: &mut impl Coder, step: usize, first: usize, vector: &mut [i16]) -> Option<()> {
        let sizes = &mut self.sizes[first..first + vector.len()];
        let mut near = sizes.first().copied().unwrap_or(0);
        let mut last = [0; 2];
        let mut last_remainder = 0i32;
        for (i, number) in vector.iter_mut().enumerate() {
            let exact = self.predictor.next(last);
            let prediction = ((exact + 128) >> 8).clamp(-self.largest, self.largest);
            let fraction = exact - (prediction << 8);
            let third = usize::from(fraction > -43) + usize::from(fraction > 42);
            let next = sizes.get(i + 1).copied().unwrap_or(sizes[i]);
            let class = class_of((3 * near + ((3 * sizes[i] + next) >> 2)) >> 2);
            let large = prediction.unsigned_abs();
            let large = usize::from(large > 0) + usize::from(large > 2);
            let place = (3 * (2 * third + usize::from(last_remainder == 0)) + large) * CLASSES + class;
            let step = step * CLASSES + class;
            let remainder = i32::from(*number) - prediction;
            let magnitude = remainder.abs();
            let by: [&mut [Counter]; 2] = [&mut self.by_place.first[place], &mut self.by_step.first[step]];
            let mut found = code_unary(coder, magnitude, 0, by);
            if found == FIRST {
                let by: [&mut [Counter]; 2] = [&mut self.by_place.other[place], &mut self.by_step.other[step]];
                found += code_unary(coder, magnitude, FIRST, by);
            }
            let mut remainder_found = found as i32;
            if found > 0 {
                let sign = &mut self.signs[third][(last_remainder.signum() + 1) as usize];
                let is_negative = coder.code_even(remainder < 0, sign);
                if found == UNARY {
                    remainder_found += code_large(coder, (magnitude - UNARY as i32) as u32)? as i32;
                }
                remainder_found = select_unpredictable(is_negative, -remainder_found, remainder_found);
            }
            let found = prediction + remainder_found;
            if found.abs() > self.largest {
                return None;
            }
            *number = found as i16;
            let size = remainder_found.abs().min(LARGEST_SIZE);
            near = (5 * near + 48 * size) >> 3;
            sizes[i] = (7 * sizes[i] + 16 * size) >> 3;
            last = [found, last[0]];
            last_remainder = remainder_found;
        }
        Some(())
    }
}

/// The class of remainders of this size, in 1/16.
#[inline(always)]
fn class_of(size: i32) -> usize {
    let size = size as u32 + 4;
    let octave = size.ilog2() - 2;
    ((4 * octave + (size >> octave) - 4) as usize).min(CLASSES - 1)
}

/// A number from 0 on: the number of its bits but the first once it is one larger, in ones that a zero ends, then those bits.
/// `None` if it has more than [`LONGEST`].
#[cold]
fn code_large(coder: &mut impl Coder, number: u32) -> Option<u32> {
    let number = number.wrapping_add(1);
    let length = number.max(1).ilog2();
    let mut found = 0;
    while coder.code(length > found, 1 << 15, []) {
        found += 1;
        if found > LONGEST {
            return None;
        }
    }
    Some((1 << found | code_bits(coder, number, found)) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// The body of an array of `groups` groups of `numbers` integers each, of up to `bits` bits, that change slowly.
    fn body(masks: Vec<u8>, groups: usize, numbers: usize, bits: u8) -> Vec<u8> {
        let random = Random::new(5, "integers of a codec");
        let largest = f64::from((1i32 << (bits - 1)) - 1);
        let mut body = masks;
        body.extend((0..groups).map(|g| (100 + g % 7) as u8));
        for n in 0..groups * numbers {
            let slow = (n as f64 * 0.3).sin() * largest;
            let q = (slow + 3.0 * random.uniform(n as u64)).clamp(-largest, largest) as i16;
            body.extend(&q.to_le_bytes()[..if bits > 8 { 2 } else { 1 }]);
        }
        body
    }

    #[test]
    fn integers_are_read_as_written() {
        let rows = vec![3, 1, 12, 12, 5];
        for bits in [16, 8, 6, 5, 4, 3] {
            let components =
                |masks, tensors, blocks| ArrayShape { bits, masks, groups: Groups::Components { tensors, blocks } };
            let networks = ArrayShape { bits, masks: None, groups: Groups::Rows(rows.clone()) };
            let masks = vec![0b0000_0101, 0b1, 0b0011_1111, 0b0, 0b0, 0b1];
            for (shape, body) in [
                (components(None, 5, vec![(8, vec![2, 4, 3])]), body(Vec::new(), 40, 9, bits)),
                (components(Some([3, 9]), 3, vec![(9, vec![2, 4, 3])]), body(masks.clone(), 10, 9, bits)),
                // Blocks of 3 and 7 groups.
                (components(Some([3, 9]), 3, vec![(2, vec![3, 3, 3]), (7, vec![1, 4, 4])]), body(masks, 10, 9, bits)),
                (networks, {
                    let mut body = body(Vec::new(), 5, 7, bits);
                    // 33 numbers instead of 35.
                    body.truncate(5 + 33 * if bits > 8 { 2 } else { 1 });
                    body
                }),
            ] {
                let bytes = compress(&shape, &body);
                assert_eq!(decompress(&"X", &shape, body.len(), &bytes), Ok(body.clone()), "{shape:?}");
                assert!(decompress(&"X", &shape, body.len(), &[&bytes[..], &[0]].concat()).is_err());
                assert!(decompress(&"X", &shape, body.len() - 1, &bytes).is_err());
            }
        }
    }

    #[test]
    fn the_largest_integers_and_steps_are_read_as_written() {
        let shape = ArrayShape {
            bits: 16,
            masks: None,
            groups: Groups::Components { tensors: 2, blocks: vec![(2, vec![2, 2, 2])] },
        };
        let mut body = vec![0, 255, 127, 128];
        for n in 0..24 {
            let q = [i16::MAX, -i16::MAX, 0, -1][n % 4];
            body.extend(q.to_le_bytes());
        }
        assert_eq!(decompress(&"X", &shape, body.len(), &compress(&shape, &body)), Ok(body));
    }

    #[test]
    fn noise_never_reads_as_integers_that_are_too_large() {
        let groups = Groups::Components { tensors: 4, blocks: vec![(6, vec![3, 2, 4])] };
        let shape = ArrayShape { bits: 5, masks: Some([4, 6]), groups };
        let random = Random::new(8, "noise of a codec");
        let mut read = 0;
        for n in 0..3000 {
            let byte = |at: u64| random.below(64 * n + at, 256) as u8;
            // Zeros behind noise code likely bits.
            let noise: Vec<u8> = (0..64).map(|at| if at < n % 64 { byte(at) } else { 0 }).collect();
            for groups in 0..=24 {
                if let Ok(body) = decompress(&"X", &shape, 4 + 10 * groups, &noise) {
                    read += 1;
                    assert!(body[4 + groups..].iter().all(|&q| (q as i8).unsigned_abs() <= 15), "{n}");
                }
            }
        }
        assert!(read < 300, "{read} of 3000");
    }

    #[test]
    fn slow_changes_take_a_fraction_of_their_bytes() {
        let shape = ArrayShape {
            bits: 16,
            masks: None,
            groups: Groups::Components { tensors: 40, blocks: vec![(10, vec![20, 20, 20])] },
        };
        let random = Random::new(6, "slow integers");
        let mut body = vec![90; 400];
        for n in 0..400 * 60u64 {
            let q = ((n as f64 * 0.2).sin() * 40.0 + 2.0 * random.uniform(n)) as i16;
            body.extend(q.to_le_bytes());
        }
        let bytes = compress(&shape, &body);
        assert!(bytes.len() * 4 < body.len(), "{} of {} bytes", bytes.len(), body.len());
    }
}

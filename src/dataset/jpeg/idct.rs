//! The inverse transform of a block, in the integers of libjpeg's slow method (`jidctint.c`), after Loeffler, Ligtenberg and
//! Moschytz, "Practical fast 1-D DCT algorithms with 11 multiplications" (1989).

use std::num::Wrapping;

use super::frame::BLOCK;

/// Sums of hostile coefficients may overflow, which has no meaning and does no harm.
type Number = Wrapping<i32>;
/// One of eight, for each column or row.
type Lanes = [Number; BLOCK];

/// Fraction bits of the factors.
const FACTOR_BITS: u32 = 13;
/// Fraction bits of the numbers between the two passes.
const BETWEEN_BITS: u32 = 2;
/// Bits by which both passes together scale up a mean: eight samples along each axis.
const SCALE_BITS: u32 = 3;
/// Half of the range of samples, which were shifted by it.
const MIDDLE: i32 = 128;

/// Writes the samples of the block of `coefficients`, in natural order, to the eight rows of `samples` that are `stride`
/// apart. `quantization` is in natural order as well.
pub(super) fn write_block(coefficients: &[i16; 64], quantization: &[u16; 64], samples: &mut [u8], stride: usize) {
    if coefficients[1..].iter().all(|&coefficient| coefficient == 0) {
        let mean = Wrapping(i32::from(coefficients[0]) * i32::from(quantization[0]));
        let sample = sample(mean << BETWEEN_BITS as usize, BETWEEN_BITS + SCALE_BITS);
        for row in samples.chunks_mut(stride).take(BLOCK) {
            row[..BLOCK].fill(sample);
        }
        return;
    }
    let mut rows = [[Wrapping(0); BLOCK]; BLOCK];
    for (value, (&coefficient, &step)) in rows.as_flattened_mut().iter_mut().zip(coefficients.iter().zip(quantization))
    {
        *value = Wrapping(i32::from(coefficient) * i32::from(step));
    }
    let columns = pass(&rows).map(|row| row.map(|value| descaled(value, FACTOR_BITS - BETWEEN_BITS)));
    let done = transposed(&pass(&transposed(&columns)));
    for (row, done) in samples.chunks_mut(stride).zip(done) {
        for (to, value) in row.iter_mut().zip(done) {
            *to = sample(value, FACTOR_BITS + BETWEEN_BITS + SCALE_BITS);
        }
    }
}

/// `value` without its last `bits` bits, rounded.
fn descaled(value: Number, bits: u32) -> Number {
    (value + (Wrapping(1_i32) << (bits as usize - 1))) >> bits as usize
}

fn sample(value: Number, bits: u32) -> u8 {
    (descaled(value, bits) + Wrapping(MIDDLE)).0.clamp(0, 255) as u8
}

fn transposed(rows: &[Lanes; BLOCK]) -> [Lanes; BLOCK] {
    let mut columns = [[Wrapping(0); BLOCK]; BLOCK];
    for (row, values) in rows.iter().enumerate() {
        for (column, &value) in values.iter().enumerate() {
            columns[column][row] = value;
        }
    }
    columns
}

/// The transform along the first axis, with [`FACTOR_BITS`] more fraction bits.
fn pass(input: &[Lanes; BLOCK]) -> [Lanes; BLOCK] {
    let mut output = [[Wrapping(0); BLOCK]; BLOCK];
    for lane in 0..BLOCK {
        let values = transform(input.map(|values| values[lane]));
        for (to, value) in output.iter_mut().zip(values) {
            to[lane] = value;
        }
    }
    output
}

/// The inverse transform of eight numbers.
#[inline(always)]
fn transform(input: [Number; BLOCK]) -> [Number; BLOCK] {
    // Fractions of 1 << FACTOR_BITS: cosines of multiples of π/16, and their sums and differences.
    let times = |value: Number, factor: i32| value * Wrapping(factor);
    let scaled = |value: Number| value << FACTOR_BITS as usize;

    let common = times(input[2] + input[6], 4433);
    let (even_2, even_3) = (common - times(input[6], 15137), common + times(input[2], 6270));
    let (even_0, even_1) = (scaled(input[0] + input[4]), scaled(input[0] - input[4]));
    let even = [even_0 + even_3, even_1 + even_2, even_1 - even_2, even_0 - even_3];

    let common = times(input[7] + input[3] + input[5] + input[1], 9633);
    let outer = times(input[7] + input[1], -7373);
    let inner = times(input[5] + input[3], -20995);
    let first = times(input[7] + input[3], -16069) + common;
    let second = times(input[5] + input[1], -3196) + common;
    let odd = [
        times(input[1], 12299) + outer + second,
        times(input[3], 25172) + inner + first,
        times(input[5], 16819) + inner + second,
        times(input[7], 2446) + outer + first,
    ];
    [
        even[0] + odd[0],
        even[1] + odd[1],
        even[2] + odd[2],
        even[3] + odd[3],
        even[3] - odd[3],
        even[2] - odd[2],
        even[1] - odd[1],
        even[0] - odd[0],
    ]
}

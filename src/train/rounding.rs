//! Training for a file that holds integers: pictures are of rounded factors, and the optimizer moves the unrounded ones.
//!
//! A factor is an integer times the step of its component. The gradient at the rounded factors moves the unrounded ones
//! (straight-through estimation; Bengio, Léonard and Courville, 2013). To the loss comes what the integers cost in the
//! file: their bits, estimated from the differences to their predictions along a vector (spec 2.5).
//!
//! Factors are rounded from the first step on. Noise of a step's width in their place, for some of the steps, is no
//! better (docs/experiments/2026-11-27-noise-and-tables.md).

use std::ops::Range;

use strivec_field::{Field, FieldFactors, FieldScale, HeldComponents};
use strivec_format::container::step;

/// An integer that differs from its prediction by e takes log₂(1 + `GROWTH`·e²)/2 bits more than one that does not.
/// The coder's own tables in place of this formula gain nothing (docs/experiments/2026-11-27-noise-and-tables.md).
const GROWTH: f32 = 8.0;
/// The share of a number that predicts the next one of its vector.
const PREDICTED: f32 = 0.8;

/// The largest integer of a file.
const LARGEST: f32 = i16::MAX as f32;

/// What factors are rounded to, and the file that they are rounded for.
#[derive(Clone, Debug, PartialEq)]
pub struct Rounding {
    /// \[scale\]\[block\]\[held component, over all tensors\] the code of its step
    /// ([`strivec_format::container::step`]); 0 if the component is zero.
    pub(super) codes: Vec<Vec<Vec<u8>>>,
    /// The loss of a bit, in mean squared error.
    pub bit: f64,
    /// The loss of a bit at the start.
    pub first_bit: f64,
    /// The bytes that the scene should have, without metadata.
    pub goal: u64,
    /// The bytes that the scene had at the start, without metadata.
    pub start: u64,
}

/// The unrounded factors of a trainer, and their steps.
#[derive(Debug)]
pub(super) struct Unrounded {
    /// \[scale\]\[block\] laid out as the factors are held.
    factors: Vec<Vec<Vec<f32>>>,
    /// \[scale\]\[block\]\[held component, over all tensors\].
    steps: Vec<Vec<Vec<f32>>>,
}

/// The factors of a block of a tensor before they are rounded.
pub(super) struct UnroundedTensor<'a> {
    factors: &'a mut [f32],
    /// \[held component\].
    steps: &'a [f32],
}

impl Unrounded {
    /// Takes the factors of `field` as the unrounded ones, and rounds those of the field to steps of `codes`, which belong to
    /// its held components.
    pub(super) fn from_field(field: &mut Field<f32>, codes: &[Vec<Vec<u8>>]) -> Self {
        let of_scale = |scale: &FieldScale<f32>| scale.blocks().map(|block| block.values().to_vec()).collect();
        let factors = field.scales.iter().map(of_scale).collect();
        let of_block = |codes: &Vec<u8>| codes.iter().map(|&code| step(code)).collect();
        let steps = codes.iter().map(|blocks| blocks.iter().map(of_block).collect()).collect();
        let mut unrounded = Some(Self { factors, steps });
        for (s, scale) in field.scales.iter_mut().enumerate() {
            let tensors = Self::of_scale(&mut unrounded, s, scale);
            for (block, tensors) in scale.blocks_mut().zip(tensors) {
                let (held, values) = block.split();
                for (tensor, values) in tensors.into_iter().flatten().zip(held.split_mut(values)) {
                    tensor.round(values);
                }
            }
        }
        unrounded.expect("it is not taken")
    }

    /// \[scale\]\[block\] laid out as the factors are held.
    pub(super) fn factors(&self) -> &[Vec<Vec<f32>>] {
        &self.factors
    }

    /// \[block\]\[tensor\] of scale `s`, which is `scale`; `None` for each if factors are not rounded.
    pub(super) fn of_scale<'a>(
        unrounded: &'a mut Option<Self>,
        s: usize,
        scale: &FieldScale<f32>,
    ) -> Vec<Vec<Option<UnroundedTensor<'a>>>> {
        let Some(Self { factors, steps }) = unrounded else {
            let none =
                |block: &FieldFactors<f32>| std::iter::repeat_with(|| None).take(block.held().tensors()).collect();
            return scale.blocks().map(none).collect();
        };
        let of_block = |((factors, steps), block): ((&'a mut Vec<f32>, &'a Vec<f32>), &FieldFactors<f32>)| {
            let held = block.held();
            let of_tensor = |(n, factors)| Some(UnroundedTensor { factors, steps: &steps[held.range(n)] });
            held.split_mut(factors).into_iter().enumerate().map(of_tensor).collect()
        };
        factors[s].iter_mut().zip(&steps[s]).zip(scale.blocks()).map(of_block).collect()
    }
}

impl UnroundedTensor<'_> {
    /// Lets `optimizer` move the `factors` of a tensor by `gradients`. If they are rounded ones of `unrounded`, these are moved,
    /// also by the derivative of the bits times `bit`, and rounded anew. `vectors` are the rows of each vector.
    #[inline(always)]
    pub(super) fn update(
        unrounded: Option<Self>,
        bit: f32,
        vectors: &[Range<usize>],
        gradients: &mut [f32],
        factors: &mut [f32],
        optimizer: impl FnOnce(&mut [f32], &[f32]),
    ) {
        let Some(unrounded) = unrounded else { return optimizer(factors, gradients) };
        // Before the optimizer: bits are a part of the loss.
        unrounded.add_bits(bit, vectors, gradients);
        optimizer(unrounded.factors, gradients);
        unrounded.round(factors);
    }

    #[inline(always)]
    fn add_bits(&self, bit: f32, vectors: &[Range<usize>], gradients: &mut [f32]) {
        let rank = self.steps.len();
        let scale = bit * GROWTH / std::f32::consts::LN_2;
        for vector in vectors {
            for row in vector.clone() {
                let is_first = row == vector.start;
                for (c, &step) in self.steps.iter().enumerate() {
                    let at = row * rank + c;
                    // A component of zeros has no step and no bits.
                    let per_step = if step > 0.0 { 1.0 / step } else { 0.0 };
                    let predicted = if is_first { 0.0 } else { PREDICTED * self.factors[at - rank] };
                    let e = (self.factors[at] - predicted) * per_step;
                    // The derivative of log₂(1 + GROWTH·e²)/2.
                    let slope = scale * per_step * e / (1.0 + GROWTH * e * e);
                    gradients[at] += slope;
                    if !is_first {
                        // A number also moves the prediction of the next one.
                        gradients[at - rank] -= PREDICTED * slope;
                    }
                }
            }
        }
    }

    /// Writes the rounded factors.
    #[inline(always)]
    fn round(&self, rounded: &mut [f32]) {
        let rank = self.steps.len().max(1);
        for (rounded, factors) in rounded.chunks_exact_mut(rank).zip(self.factors.chunks_exact(rank)) {
            for ((rounded, &v), &step) in rounded.iter_mut().zip(factors).zip(self.steps) {
                let integer = (v / step).round_ties_even().clamp(-LARGEST, LARGEST);
                *rounded = if step > 0.0 { step * integer } else { 0.0 };
            }
        }
    }
}

impl Rounding {
    /// Codes of a block by \[tensor\]\[component of the scale\], in the order of the components that tensors hold.
    pub(super) fn of_held(held: &HeldComponents, codes: &[u8]) -> Vec<u8> {
        let of_tensor = |n: usize| held.of(n).iter().map(move |&c| codes[n * held.rank() + c as usize]);
        (0..held.tensors()).flat_map(of_tensor).collect()
    }

    /// The opposite of [`Rounding::of_held`]: 0 for components that tensors do not hold.
    pub(super) fn of_all(held: &HeldComponents, codes: &[u8]) -> Vec<u8> {
        let mut all = vec![0; held.tensors() * held.rank()];
        for n in 0..held.tensors() {
            held.of(n)
                .iter()
                .zip(&codes[held.range(n)])
                .for_each(|(&c, &code)| all[n * held.rank() + c as usize] = code);
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bits that [`UnroundedTensor::add_bits`] differentiates, of one component with `rows` on each axis.
    fn bits(factors: &[f32], step: f32, rows: usize) -> f64 {
        let of_vector = |vector: &[f32]| {
            let mut before = 0.0;
            let mut sum = 0.0;
            for &v in vector {
                let e = f64::from(v - PREDICTED * before) / f64::from(step);
                sum += 0.5 * (1.0 + f64::from(GROWTH) * e * e).log2();
                before = v;
            }
            sum
        };
        factors.chunks_exact(rows).map(of_vector).sum()
    }

    #[test]
    fn gradients_are_those_of_the_bits() {
        const ROWS: usize = 3;
        let axes = [0..ROWS, ROWS..2 * ROWS, 2 * ROWS..3 * ROWS];
        let mut factors = [0.3, -0.2, 0.25, 1.0, 0.0, -0.4, 0.02, 0.7, 0.1f32];
        let (step, bit) = (0.1, 2.0);
        let mut gradients = [1.0; 9];
        UnroundedTensor { factors: &mut factors.clone(), steps: &[step] }.add_bits(bit, &axes, &mut gradients);
        for n in 0..9 {
            let mut at = |by: f32| {
                let before = factors[n];
                factors[n] += by;
                let bits = bits(&factors, step, ROWS);
                factors[n] = before;
                bits
            };
            let difference = (at(1e-3) - at(-1e-3)) / 2e-3;
            let expected = 1.0 + f64::from(bit) * difference;
            assert!(
                (f64::from(gradients[n]) - expected).abs() < 1e-2 * expected.abs().max(1.0),
                "{n}: {} {expected}",
                gradients[n]
            );
        }
    }

    #[test]
    fn factors_are_rounded_to_steps_and_stay_zero_without_one() {
        let mut factors = [0.26, 5.0, -0.14, 5.0];
        let tensor = UnroundedTensor { factors: &mut factors, steps: &[0.125, 0.0] };
        let mut rounded = [9.0; 4];
        tensor.round(&mut rounded);
        assert_eq!(rounded, [0.25, 0.0, -0.125, 0.0]);
    }
}

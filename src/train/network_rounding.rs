//! The shared weights while a scene is trained for a file ([`super::rounding`]): pictures are of rounded ones, and the
//! optimizer moves the unrounded ones.

use super::networks::decoder_parts;
use strivec_field::{Field, FieldDecoder};
use strivec_format::container::{NetworkSteps, step, step_code};

/// Bits of the numbers of matrices and decoder in a file.
/// The bytes of finer weights are missing elsewhere in a small file
/// (docs/experiments/2026-11-27-noise-and-tables.md). Rounding costs 0.03 dB at most
/// (docs/experiments/2026-11-27-rounded-networks.md).
pub const NETWORK_BITS: u8 = 8;

/// The largest integer of these bits.
const LARGEST: f32 = ((1 << (NETWORK_BITS - 1)) - 1) as f32;

/// The unrounded shared weights of a trainer, without the sky's coefficients, which no file rounds.
#[derive(Debug)]
pub(super) struct UnroundedNetworks {
    /// Unrounded weights, in the order of the flat vector ([`super::NetworkLayout`]).
    values: Vec<f32>,
    /// \[row\] the length of each group that has one step in a file (spec 3.3), in the same order.
    rows: Vec<usize>,
    /// Each feature has a row in the matrix of each scale: \[feature\]\[scale\] the first rows.
    features: usize,
    scales: usize,
}

impl UnroundedNetworks {
    /// Takes the weights of `field` as the unrounded ones, and rounds those of the field.
    pub(super) fn from_field(field: &mut Field<f32>) -> Self {
        let decoder = &field.decoder;
        let ranks = field.scales.iter().map(|scale| scale.appearance_rank());
        let of_matrices = std::iter::repeat_n(ranks, decoder.features).flatten();
        let of_layers = decoder
            .layers
            .iter()
            .flat_map(|layer| std::iter::repeat_n(layer.inputs, layer.outputs).chain([layer.outputs]));
        let rows: Vec<usize> = of_matrices.chain(of_layers).collect();
        let values = decoder_parts(&mut field.decoder).flatten().map(|v| *v).collect();
        let networks = Self { values, rows, features: field.decoder.features, scales: field.scales.len() };
        networks.round(field);
        networks
    }

    /// Writes the unrounded weights.
    pub(super) fn write(&self, decoder: &mut FieldDecoder<f32>) {
        decoder_parts(decoder).flatten().zip(&self.values).for_each(|(weight, &v)| *weight = v);
    }

    /// The unrounded weights in the order of the flat vector, to change.
    pub(super) fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// \[row\] the weights, and the code of the finest step that reaches them.
    fn rows(&self) -> impl Iterator<Item = (&[f32], u8)> {
        let mut rest = self.values.as_slice();
        self.rows.iter().map(move |&length| {
            let (row, after) = rest.split_at(length);
            rest = after;
            // The finest step that reaches the largest weight, in each step anew: weights grow in training.
            let largest = row.iter().fold(0.0f32, |largest, v| largest.max(v.abs()));
            (row, step_code(largest / LARGEST))
        })
    }

    /// Writes the rounded weights into `field`.
    pub(super) fn round(&self, field: &mut Field<f32>) {
        let rounded = self.rows().flat_map(|(row, code)| {
            let step = step(code);
            row.iter().map(move |v| if step > 0.0 { step * (v / step).round_ties_even() } else { 0.0 })
        });
        decoder_parts(&mut field.decoder).flatten().zip(rounded).for_each(|(weight, v)| *weight = v);
    }

    /// The step codes of a file that has these weights.
    pub(super) fn steps(&self) -> NetworkSteps {
        let codes: Vec<u8> = self.rows().map(|(_, code)| code).collect();
        let (of_matrices, decoder) = codes.split_at(self.scales * self.features);
        let of_scale = |s: usize| of_matrices[s..].iter().step_by(self.scales).copied().collect();
        let matrices = (0..self.scales).map(of_scale).collect();
        NetworkSteps { decoder: decoder.to_vec(), matrices, prefixes: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::networks::put_decoder;
    use strivec_format::container::{ArrayOptions, EncodeOptions, Encoding, decode, encode};

    const TWO_SCALES: &[u8] =
        include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/residual.strivec"));

    /// The weights of `field` in the order of the flat vector.
    fn weights(field: &mut Field<f32>) -> Vec<f32> {
        decoder_parts(&mut field.decoder).flatten().map(|v| *v).collect()
    }

    #[test]
    fn a_file_has_the_weights_that_pictures_are_of() {
        let mut scene = decode(TWO_SCALES).unwrap();
        let mut field = Field::unlimited(&scene);
        let trained = weights(&mut field);
        let mut networks = UnroundedNetworks::from_field(&mut field);
        assert_ne!(weights(&mut field), trained);
        networks.values_mut().iter_mut().enumerate().for_each(|(n, v)| *v *= 1.0 + 0.1 * (n % 7) as f32);
        networks.round(&mut field);
        put_decoder(&field.decoder, &mut scene);
        let options = EncodeOptions {
            networks: ArrayOptions::best(Encoding::Grid(NETWORK_BITS)),
            network_steps: networks.steps(),
            ..EncodeOptions::default()
        };
        let mut read = Field::unlimited(&decode(&encode(&scene, &options).unwrap()).unwrap());
        assert_eq!(weights(&mut read), weights(&mut field));

        networks.write(&mut field.decoder);
        assert_eq!(weights(&mut field), networks.values);
    }
}

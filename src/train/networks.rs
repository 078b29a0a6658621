//! The shared weights as one flat vector: appearance matrices, each layer's weights and bias, the sky's coefficients.
//! Gradients and optimizer state have the same layout.

use strivec_field::{Field, FieldDecoder, Real};
use strivec_format::model::Scene;

/// Layout of the flat vector.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NetworkLayout {
    /// Length of the appearance part.
    pub appearance: usize,
    /// (first weight, first bias, end) of each layer.
    pub layers: Vec<(usize, usize, usize)>,
    /// Length of the sky's part, which is the last one; 0 without a sky.
    pub sky: usize,
}

impl NetworkLayout {
    /// The layout of `field`'s shared weights.
    pub fn new<T>(field: &Field<T>) -> Self {
        let decoder = &field.decoder;
        let appearance = decoder.appearance.len();
        let mut end = appearance;
        let layers = (decoder.layers.iter())
            .map(|l| {
                let (weights, bias) = (end, end + l.weights.len());
                end = bias + l.bias.len();
                (weights, bias, end)
            })
            .collect();
        Self { appearance, layers, sky: field.sky.as_ref().map_or(0, |sky| sky.coefficients.len()) }
    }

    /// The first of the sky's coefficients.
    pub fn sky_at(&self) -> usize {
        self.layers.last().map_or(self.appearance, |l| l.2)
    }

    /// Length of the flat vector.
    pub fn len(&self) -> usize {
        self.sky_at() + self.sky
    }

    /// True if there are no weights.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The parts of `field`'s shared weights in the order of the flat vector.
pub fn network_parts<T: Real>(field: &mut Field<T>) -> impl Iterator<Item = &mut [T]> {
    let Field { decoder, sky, .. } = field;
    decoder_parts(decoder).chain(sky.iter_mut().map(|sky| sky.coefficients.as_mut_slice()))
}

/// The weights and biases of the appearance matrices and of the decoder's layers, in a fixed order.
pub(super) fn decoder_parts<T>(decoder: &mut FieldDecoder<T>) -> impl Iterator<Item = &mut [T]> {
    std::iter::once(decoder.appearance.as_mut_slice())
        .chain(decoder.layers.iter_mut().flat_map(|l| [l.weights.as_mut_slice(), l.bias.as_mut_slice()]))
}

/// Writes matrices and layers into `scene`.
pub(super) fn put_decoder(decoder: &FieldDecoder<f32>, scene: &mut Scene) {
    let width = decoder.appearance.len() / decoder.features.max(1);
    let mut first = 0;
    for matrix in scene.scales.iter_mut().map(|scale| &mut scale.appearance_matrix) {
        let rank = matrix.rank as usize;
        for (p, row) in matrix.weights.chunks_exact_mut(rank.max(1)).enumerate() {
            row.copy_from_slice(&decoder.appearance[p * width + first..][..rank]);
        }
        first += rank;
    }
    for (layer, trained) in scene.decoder.layers.iter_mut().zip(&decoder.layers) {
        layer.weights.clone_from(&trained.weights);
        layer.bias.clone_from(&trained.bias);
    }
}

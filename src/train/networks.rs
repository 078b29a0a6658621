//! The shared weights as one flat vector: appearance matrices, then each layer's weights and bias. Gradients and
//! optimizer state have the same layout.

use crate::field::{FieldDecoder, Real};

/// Layout of the flat vector.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NetworkLayout {
    /// Length of the appearance part.
    pub appearance: usize,
    /// (first weight, first bias, end) of each layer.
    pub layers: Vec<(usize, usize, usize)>,
}

impl NetworkLayout {
    /// The layout of `decoder`'s weights.
    pub fn new<T>(decoder: &FieldDecoder<T>) -> Self {
        let appearance = decoder.appearance.len();
        let mut end = appearance;
        let layers = (decoder.layers.iter())
            .map(|l| {
                let (weights, bias) = (end, end + l.weights.len());
                end = bias + l.bias.len();
                (weights, bias, end)
            })
            .collect();
        Self { appearance, layers }
    }

    /// Length of the flat vector.
    pub fn len(&self) -> usize {
        self.layers.last().map_or(self.appearance, |l| l.2)
    }

    /// True if there are no weights.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The parts of `decoder`'s weights in the order of the flat vector.
pub fn network_parts<T: Real>(decoder: &mut FieldDecoder<T>) -> impl Iterator<Item = &mut [T]> {
    std::iter::once(decoder.appearance.as_mut_slice())
        .chain(decoder.layers.iter_mut().flat_map(|l| [l.weights.as_mut_slice(), l.bias.as_mut_slice()]))
}

//! A chunk's (tensor, sample) pairs in the order of tensors, with the inputs of the gradients of the tensors' factors.

use strivec_field::{Real, Samples};

/// A sample that a tensor takes part in.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TensorPair<T> {
    /// The sample's place.
    pub(super) place: u32,
    /// The index of the shaded sample, if there is one.
    pub(super) shaded: u32,
    /// The weight of the tensor; for density, times the gradient of the sample's feature.
    pub(super) weight: T,
}

/// Pairs by tensor, then in the order in which samples were given. Reused.
#[derive(Debug, Default)]
pub(super) struct TensorPairs<T> {
    /// \[tensor\] its first pair, and the number of pairs.
    starts: Vec<u32>,
    pairs: Vec<TensorPair<T>>,
}

impl<T: Real> TensorPairs<T> {
    /// The pairs of `tensor`, counted over all scales.
    #[inline(always)]
    pub(super) fn of(&self, tensor: usize) -> &[TensorPair<T>] {
        &self.pairs[self.starts[tensor] as usize..self.starts[tensor + 1] as usize]
    }

    /// A stable counting sort of the pairs of those of `samples` that `sources` name by place, each with the index of the
    /// shaded sample and the factor of the weights of its pairs.
    pub(super) fn sort(
        &mut self,
        samples: &Samples<T>,
        scales: usize,
        tensors: usize,
        sources: impl Iterator<Item = (u32, u32, T)> + Clone,
    ) {
        let pairs_at = |place: u32| (0..scales).flat_map(move |s| samples.contributions_of(place as usize, s, scales));
        // `starts[n + 2]` counts the pairs of tensor n, then becomes the first index of those of n + 1; `starts[n + 1]`
        // moves from the first index of those of n to their end.
        self.starts.clear();
        self.starts.resize(tensors + 2, 0);
        // Counted first, so that pairs are written once, into memory of their exact size.
        for (place, ..) in sources.clone() {
            for pair in pairs_at(place) {
                self.starts[pair.tensor as usize + 2] += 1;
            }
        }
        for n in 2..self.starts.len() {
            self.starts[n] += self.starts[n - 1];
        }
        // All chunks keep their pairs, which are most of a step's memory: no reserve.
        let count = self.starts[tensors + 1] as usize;
        self.pairs.clear();
        self.pairs.reserve_exact(count);
        self.pairs.resize(count, TensorPair::default());
        for (place, shaded, factor) in sources {
            for pair in pairs_at(place) {
                let at = &mut self.starts[pair.tensor as usize + 1];
                self.pairs[*at as usize] = TensorPair { place, shaded, weight: pair.weight * factor };
                *at += 1;
            }
        }
        self.starts.pop();
    }
}

//! Positions stored by axis, for kernels that read a register of them at a time.

use super::Real;
use super::vector::MAX_LANES;

/// Positions by axis, relative to the field's origin; padded so that a whole register can be read at any of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Positions<T> {
    axes: [Vec<T>; 3],
    len: usize,
}

impl<T: Real> Positions<T> {
    pub(super) fn clear(&mut self) {
        self.axes.iter_mut().for_each(Vec::clear);
        self.len = 0;
    }

    pub(super) fn push(&mut self, position: [T; 3]) {
        for a in 0..3 {
            self.axes[a].push(position[a]);
        }
        self.len += 1;
    }

    /// Appends the padding; call after the last [`Self::push`].
    pub(super) fn pad(&mut self) {
        self.axes.iter_mut().for_each(|axis| axis.resize(self.len + MAX_LANES, T::zero()));
    }

    #[inline(always)]
    pub(super) fn get(&self, index: usize) -> [T; 3] {
        [self.axes[0][index], self.axes[1][index], self.axes[2][index]]
    }

    /// The coordinates on axis `a`, with padding.
    #[inline(always)]
    pub(super) fn axis(&self, a: usize) -> &[T] {
        &self.axes[a]
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }
}

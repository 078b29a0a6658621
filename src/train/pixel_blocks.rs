//! Square blocks of pixels.

/// Pixels along the sides of a block.
/// Blocks of 4×4 pixels are no better (docs/experiments/2026-11-26-rays-by-error.md).
const BLOCK_SIDE: u32 = 8;

/// The blocks of photographs.
#[derive(Clone, Debug, Default)]
pub(super) struct Blocks {
    /// \[view\] the index of its first block, and the number of blocks in a row of them.
    views: Vec<[u32; 2]>,
    count: usize,
}

impl Blocks {
    /// The blocks of photographs of these widths and heights, in pixels.
    pub(super) fn new(sizes: impl Iterator<Item = [u32; 2]>) -> Self {
        let mut blocks = Self::default();
        for size in sizes {
            let [across, down] = size.map(|pixels| pixels.div_ceil(BLOCK_SIDE));
            blocks.views.push([blocks.count as u32, across]);
            blocks.count += (across * down) as usize;
        }
        blocks
    }

    /// Number of blocks.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// The block of a pixel of photograph number `view`.
    pub(super) fn of(&self, view: usize, column: u32, row: u32) -> u32 {
        let [first, across] = self.views[view];
        first + row / BLOCK_SIDE * across + column / BLOCK_SIDE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_at_borders_may_be_smaller() {
        let blocks = Blocks::new([[17, 9], [8, 8], [1, 1]].into_iter());
        assert_eq!(blocks.count(), 6 + 1 + 1);
        assert_eq!([blocks.of(0, 0, 0), blocks.of(0, 16, 8), blocks.of(1, 7, 7), blocks.of(2, 0, 0)], [0, 5, 6, 7]);
    }
}

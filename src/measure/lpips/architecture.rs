//! The networks of LPIPS as lists of their layers, without weights.

use std::ops::Range;

/// A network whose features LPIPS compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LpipsNetwork {
    /// AlexNet (Krizhevsky, 2014), the default of the original package.
    Alex,
    /// VGG16 (Simonyan and Zisserman, 2015), the one of most papers about radiance fields.
    Vgg,
}

/// A convolution with bias, of a square kernel, followed by a rectifier.
#[derive(Clone, Copy, Debug)]
pub(super) struct Convolution {
    pub(super) edge: usize,
    pub(super) stride: usize,
    /// Zeros before and after each axis.
    pub(super) padding: usize,
    pub(super) inputs: usize,
    pub(super) outputs: usize,
}

/// The maximum over squares that lie wholly in the map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pool {
    pub(super) edge: usize,
    pub(super) stride: usize,
}

/// Convolutions whose last features are compared, and what leads to the next stage.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage {
    pub(super) convolutions: &'static [Convolution],
    pub(super) pool: Pool,
}

/// Pooling that changes nothing.
const NO_POOL: Pool = Pool { edge: 1, stride: 1 };

/// A convolution of 3×3 that keeps the size.
const fn of_three(inputs: usize, outputs: usize) -> Convolution {
    Convolution { edge: 3, stride: 1, padding: 1, inputs, outputs }
}

const ALEX_POOL: Pool = Pool { edge: 3, stride: 2 };
const ALEX: [Stage; 5] = [
    Stage { convolutions: &[Convolution { edge: 11, stride: 4, padding: 2, inputs: 3, outputs: 64 }], pool: ALEX_POOL },
    Stage {
        convolutions: &[Convolution { edge: 5, stride: 1, padding: 2, inputs: 64, outputs: 192 }],
        pool: ALEX_POOL,
    },
    Stage { convolutions: &[of_three(192, 384)], pool: NO_POOL },
    Stage { convolutions: &[of_three(384, 256)], pool: NO_POOL },
    Stage { convolutions: &[of_three(256, 256)], pool: NO_POOL },
];

const VGG_POOL: Pool = Pool { edge: 2, stride: 2 };
const VGG: [Stage; 5] = [
    Stage { convolutions: &[of_three(3, 64), of_three(64, 64)], pool: VGG_POOL },
    Stage { convolutions: &[of_three(64, 128), of_three(128, 128)], pool: VGG_POOL },
    Stage { convolutions: &[of_three(128, 256), of_three(256, 256), of_three(256, 256)], pool: VGG_POOL },
    Stage { convolutions: &[of_three(256, 512), of_three(512, 512), of_three(512, 512)], pool: VGG_POOL },
    Stage { convolutions: &[of_three(512, 512), of_three(512, 512), of_three(512, 512)], pool: NO_POOL },
];

impl LpipsNetwork {
    /// Both networks.
    pub const ALL: [Self; 2] = [Self::Alex, Self::Vgg];

    /// Its name in options, in files of weights and, after `lpips_`, in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Alex => "alex",
            Self::Vgg => "vgg",
        }
    }

    pub(super) fn stages(self) -> &'static [Stage; 5] {
        match self {
            Self::Alex => &ALEX,
            Self::Vgg => &VGG,
        }
    }

    /// The least number of rows and of columns that leaves a feature to each stage.
    pub fn smallest_extent(self) -> usize {
        let leaves_features = |extent: usize| {
            let after = |extent: usize, stage: &Stage| stage.tap_extent(extent).and_then(|tap| stage.pool.extent(tap));
            self.stages().iter().try_fold(extent, after).is_some()
        };
        (1..).find(|&extent| leaves_features(extent)).expect("large maps have features")
    }
}

impl Convolution {
    /// Terms of each sum.
    pub(super) fn terms(&self) -> usize {
        self.edge * self.edge * self.inputs
    }

    /// Rows of the result for `extent` rows; `None` for less than one. Columns alike.
    pub(super) fn extent(&self, extent: usize) -> Option<usize> {
        Some((extent + 2 * self.padding).checked_sub(self.edge)? / self.stride + 1)
    }

    /// The rows, of `extent`, on which the result's rows `rows` depend.
    pub(super) fn source(&self, rows: &Range<usize>, extent: usize) -> Range<usize> {
        let end = (rows.end - 1) * self.stride + self.edge - self.padding;
        (rows.start * self.stride).saturating_sub(self.padding)..end.min(extent)
    }
}

impl Pool {
    /// As [`Convolution::extent`].
    pub(super) fn extent(&self, extent: usize) -> Option<usize> {
        Some(extent.checked_sub(self.edge)? / self.stride + 1)
    }
}

impl Stage {
    /// Rows of the compared features for `extent` rows. Columns alike.
    pub(super) fn tap_extent(&self, extent: usize) -> Option<usize> {
        self.convolutions.iter().try_fold(extent, |extent, convolution| convolution.extent(extent))
    }

    /// Channels of the compared features.
    pub(super) fn channels(&self) -> usize {
        self.convolutions.last().map_or(0, |convolution| convolution.outputs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smallest_extents_are_those_of_the_layers() {
        // AlexNet: 31 → 7 → 3 → 1; VGG16: 16 → 8 → 4 → 2 → 1.
        assert_eq!(LpipsNetwork::ALL.map(LpipsNetwork::smallest_extent), [31, 16]);
    }

    #[test]
    fn channels_agree_from_layer_to_layer() {
        for network in LpipsNetwork::ALL {
            let layers: Vec<_> = network.stages().iter().flat_map(|stage| stage.convolutions).collect();
            assert_eq!(layers[0].inputs, 3);
            assert!(layers.windows(2).all(|pair| pair[0].outputs == pair[1].inputs), "{network:?}");
        }
    }
}

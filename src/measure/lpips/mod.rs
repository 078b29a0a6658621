//! LPIPS, the learned perceptual distance of two pictures (Zhang, Isola, Efros, Shechtman and Wang, "The unreasonable
//! effectiveness of deep features as a perceptual metric", CVPR 2018), version 0.1 with linear layers.
//!
//! A network turns each picture into five maps of features. At every position features are divided by their norm; the
//! squared differences, weighted by channel, are averaged over each map and summed over the maps. The weights are not
//! part of this crate; `tools/lpips/convert.py` makes a file of them.

mod architecture;
mod layers;
mod weights;

use std::ops::Range;

use rayon::prelude::*;

pub use architecture::LpipsNetwork;
pub use weights::LpipsWeightsError;

use super::Error;
use architecture::Stage;
use layers::{Rows, convolve, pool};
use weights::StageWeights;

/// Normalization of colors in \[-1, 1\] by channel, as the original package does it.
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];
/// Added to norms.
const EPSILON: f64 = 1e-10;
/// The most numbers in a map between two layers of a stage.
const BAND_VALUES: usize = 1 << 22;

/// A network with its weights.
///
/// ```
/// use strivec::measure::{Lpips, LpipsNetwork, LpipsWeightsError};
///
/// let refused = Lpips::from_safetensors(b"not a file of weights", LpipsNetwork::Vgg);
/// assert!(matches!(refused, Err(LpipsWeightsError::NotSafetensors(_))));
/// ```
#[derive(Debug)]
pub struct Lpips {
    network: LpipsNetwork,
    weights: Vec<StageWeights>,
}

impl Lpips {
    /// Reads `network` from the bytes of a safetensors file, as `tools/lpips/convert.py` makes it. The tensors, of 32-bit
    /// floats, are `NETWORK.conv.N.kernel` \[rows, columns, inputs, outputs\], `NETWORK.conv.N.bias` \[outputs\] and
    /// `NETWORK.linear.N` \[channels\].
    ///
    /// # Errors
    ///
    /// [`LpipsWeightsError`] names the first tensor that is missing or differs from the network's.
    pub fn from_safetensors(bytes: &[u8], network: LpipsNetwork) -> Result<Self, LpipsWeightsError> {
        Ok(Self { network, weights: weights::read(bytes, network)? })
    }

    /// The network.
    pub fn network(&self) -> LpipsNetwork {
        self.network
    }

    /// The distance of two pictures of `size` (columns, rows), sRGB in \[0, 1\]: 0 for identical ones, NaN if a color is not
    /// finite. The result does not depend on the number of threads. Needs about 200 bytes a pixel for VGG16.
    ///
    /// # Errors
    ///
    /// [`Error::Size`] if a list of colors does not have the length of `size`; [`Error::SmallerThanNetwork`].
    pub fn distance(&self, size: [u32; 2], a: &[[f32; 3]], b: &[[f32; 3]]) -> Result<f64, Error> {
        self.distance_in_bands(size, a, b, BAND_VALUES)
    }

    /// [`Lpips::distance`] with at most about `band_values` numbers in a map between two layers of a stage.
    fn distance_in_bands(
        &self,
        size: [u32; 2],
        a: &[[f32; 3]],
        b: &[[f32; 3]],
        band_values: usize,
    ) -> Result<f64, Error> {
        Error::unless_size(size, a.len())?;
        Error::unless_size(size, b.len())?;
        let (smallest, [columns, mut height]) = (self.network.smallest_extent(), size.map(|n| n as usize));
        if columns.min(height) < smallest {
            return Err(Error::SmallerThanNetwork { network: self.network.name(), smallest, found: size });
        }
        if [a, b].iter().any(|colors| !colors.as_flattened().iter().all(|value| value.is_finite())) {
            return Ok(f64::NAN);
        }
        let mut maps = [a, b].map(|colors| Rows { first: 0, columns, channels: 3, values: normalized(colors) });
        let mut distance = 0.0;
        for (stage, weights) in self.network.stages().iter().zip(&self.weights) {
            let staged = Staged::new(stage, weights, maps, height, band_values);
            distance += staged.distance;
            (maps, height) = (staged.pooled, staged.height);
        }
        Ok(distance)
    }
}

fn normalized(colors: &[[f32; 3]]) -> Vec<f32> {
    colors.iter().flat_map(|color| [0, 1, 2].map(|c| (2.0 * color[c] - 1.0 - SHIFT[c]) / SCALE[c])).collect()
}

/// The result of a stage for a pair of maps.
struct Staged {
    /// The stage's part of the distance.
    distance: f64,
    /// The next stage's maps.
    pooled: [Rows; 2],
    /// Their rows.
    height: usize,
}

impl Staged {
    /// Applies `stage` to `maps` of `height` rows in bands of rows, so that only the stage's ends are whole in memory.
    fn new(stage: &Stage, weights: &StageWeights, maps: [Rows; 2], height: usize, band_values: usize) -> Self {
        const LEFT: &str = "a size that leaves features";
        let tap_height = stage.tap_extent(height).expect(LEFT);
        let tap_columns = stage.tap_extent(maps[0].columns).expect(LEFT);
        let [height_after, columns_after] = [tap_height, tap_columns].map(|tap| stage.pool.extent(tap).expect(LEFT));
        let stride = stage.pool.stride;
        let rows_at_once = (band_values / (tap_columns * stage.channels()) / stride).max(1);
        let empty = || Rows {
            first: 0,
            columns: columns_after,
            channels: stage.channels(),
            values: Vec::with_capacity(height_after * columns_after * stage.channels()),
        };
        let (mut sum, mut pooled) = (0.0, [empty(), empty()]);
        for start in (0..height_after).step_by(rows_at_once) {
            let band = start..(start + rows_at_once).min(height_after);
            // The last band has the rows that no pooled row depends on.
            let counted = start * stride..if band.end == height_after { tap_height } else { band.end * stride };
            let needed = counted.start..counted.end.max((band.end - 1) * stride + stage.pool.edge);
            let taps = maps.each_ref().map(|map| features(stage, weights, map, height, &needed));
            sum += differences(&taps, counted, &weights.linear);
            for (pooled, tap) in pooled.iter_mut().zip(&taps) {
                pooled.values.extend(pool(tap, band.clone(), stage.pool).values);
            }
        }
        Self { distance: sum / (tap_height * tap_columns) as f64, pooled, height: height_after }
    }
}

/// Rows `rows` of the compared features of `stage`, of a `map` of `height` rows.
fn features(stage: &Stage, weights: &StageWeights, map: &Rows, height: usize, rows: &Range<usize>) -> Rows {
    // For each layer the height of its source, and the rows of its result.
    let mut heights = vec![height];
    for convolution in stage.convolutions {
        heights.extend(convolution.extent(heights[heights.len() - 1]));
    }
    let mut ranges = vec![rows.clone()];
    for (convolution, &height) in stage.convolutions.iter().zip(&heights).skip(1).rev() {
        ranges.push(convolution.source(&ranges[ranges.len() - 1], height));
    }
    ranges.reverse();
    let mut before: Option<Rows> = None;
    for (((convolution, kernel), height), range) in
        stage.convolutions.iter().zip(&weights.kernels).zip(heights).zip(ranges)
    {
        before = Some(convolve(before.as_ref().unwrap_or(map), height, range, convolution, kernel));
    }
    before.expect("a stage has a convolution")
}

/// The sum over the pixels of `rows` of the weighted squared differences of two maps of features, each divided by its norm.
fn differences(taps: &[Rows; 2], rows: Range<usize>, linear: &[f32]) -> f64 {
    let of_row = |row: usize| {
        let [a, b] = taps.each_ref().map(|tap| tap.row(row).chunks_exact(tap.channels));
        a.zip(b).map(|(a, b)| difference(a, b, linear)).sum::<f64>()
    };
    let sums: Vec<f64> = rows.into_par_iter().map(of_row).collect();
    sums.iter().sum()
}

fn difference(a: &[f32], b: &[f32], linear: &[f32]) -> f64 {
    let [of_a, of_b] = [a, b].map(|features| {
        let squares: f64 = features.iter().map(|&v| f64::from(v).powi(2)).sum();
        1.0 / (squares.sqrt() + EPSILON)
    });
    let squared = |(p, q): (&f32, &f32)| (f64::from(*p) * of_a - f64::from(*q) * of_b).powi(2);
    a.iter().zip(b).map(squared).zip(linear).map(|(squared, weight)| squared * f64::from(*weight)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use weights::Kernel;

    #[test]
    fn bands_of_any_height_give_the_same_distance() {
        let value = |i: usize, scale: f64| {
            let hash = (i as u32 + 1).wrapping_mul(2_654_435_761);
            (f64::from((hash ^ (hash >> 15)).wrapping_mul(2_246_822_519)) / f64::from(u32::MAX) - 0.5) * scale
        };
        for network in LpipsNetwork::ALL {
            let stage = |stage: &Stage| StageWeights {
                kernels: (stage.convolutions.iter())
                    .map(|convolution| Kernel {
                        values: (0..convolution.terms() * convolution.outputs)
                            .map(|i| value(i, 5.0 / (convolution.terms() as f64).sqrt()) as f32)
                            .collect(),
                        bias: vec![0.01; convolution.outputs],
                    })
                    .collect(),
                linear: (0..stage.channels()).map(|i| value(i, 1.0).abs() as f32).collect(),
            };
            let lpips = Lpips { network, weights: network.stages().iter().map(stage).collect() };
            let picture =
                |n: usize| (0..47 * 43).map(|i| [0, 1, 2].map(|c| value(3 * i + c + n, 1.0) as f32)).collect();
            let (a, b): (Vec<[f32; 3]>, Vec<[f32; 3]>) = (picture(0), picture(500));
            let in_bands = |values| lpips.distance_in_bands([47, 43], &a, &b, values).unwrap();
            let whole = in_bands(BAND_VALUES);
            for values in [0, 6000, 20_000] {
                let found = in_bands(values);
                assert!((found - whole).abs() < 1e-6 * whole, "{network:?}, {values}: {found} instead of {whole}");
            }
        }
    }
}

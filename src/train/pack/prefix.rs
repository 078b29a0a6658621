//! Fitting the correction for the coarse scales alone (spec 3.11): a sum over fewer scales is too weak to be opaque,
//! and its colors lack what the missing scales add.
//!
//! Factors stay as they are, so that all prefixes share the file's beginning. The gain and the offset of the density
//! feature and the appearance matrices are fitted, by Adam, to the pictures of the whole scene.

use super::ModelCameras;
use crate::{Adam, Backward, BatchRoulette, Moments, Target};
use strivec_field::Field;
use strivec_field::render::{CpuRenderer, Renderer};
use strivec_format::container::{Prefix, first_scales};
use strivec_format::geometry::Ray;
use strivec_format::model::Scene;
use strivec_format::random::Random;

/// Rays of a step.
const RAYS: usize = 4096;
/// Learning rates of the gain's logarithm and the offset, and of the matrices; they fall to a tenth.
const SHAPE_RATE: f64 = 0.05;
const MATRIX_RATE: f64 = 0.005;
/// Half the distance of the finite difference in the offset.
const OFFSET_DIFFERENCE: f64 = 0.1;

/// The correction for the first `scales` scales of `scene`, fitted in `steps` steps to the whole scene's colors along
/// rays of `views`.
pub fn fit_prefix(scene: &Scene, scales: usize, views: &ModelCameras, steps: usize, seed: u64) -> Prefix {
    let whole = CpuRenderer::<f32>::unlimited(scene);
    let mut field = Field::<f32>::unlimited(&first_scales(scene.clone(), &[], Some(scales as u32)));
    let mut backward = Backward::new(&field);
    let random = Random::new(seed, "prefix").substream(scales as u64);
    // The logarithm of the gain, and the offset.
    let mut shape = [0.0f32; 2];
    let mut shape_moments = Moments::zeros(2);
    let mut matrix_moments = Moments::zeros(field.decoder.appearance.len());
    for n in 1..=steps as u64 {
        let rays: Vec<Ray> = views.rays(RAYS, &random.substream(n));
        let background = scene.frame.background;
        let targets: Vec<Target> = whole
            .trace(&rays)
            .iter()
            .map(|pixel| Target { color: pixel.color, background, view: 0, distance: 0.0, weight: 1.0 })
            .collect();
        let all = BatchRoulette::default();
        let shift = field.rules.density_shift;
        let [above, below] = [OFFSET_DIFFERENCE, -OFFSET_DIFFERENCE].map(|by| {
            field.rules.density_shift = shift + by;
            backward.loss(&field, &rays, &targets, all)
        });
        field.rules.density_shift = shift;
        let gradients = backward.gradients(&field, &rays, &targets, all);
        let gain_gradient: f64 = first_factors(&field)
            .map(|(s, b, at)| {
                f64::from(field.scales[s].density[b].values()[at]) * f64::from(gradients.factors[s][b][at])
            })
            .sum();
        let shape_gradients = [gain_gradient as f32, ((above - below) / (2.0 * OFFSET_DIFFERENCE)) as f32];
        let decay = 0.1f64.powf((n - 1) as f64 / steps as f64);
        let before = shape;
        Adam::new(SHAPE_RATE * decay, 0.0, n).update::<false>(
            &mut shape,
            &mut shape_moments.first,
            &mut shape_moments.second,
            &shape_gradients,
        );
        let matrix_gradients = &gradients.networks[..field.decoder.appearance.len()];
        Adam::new(MATRIX_RATE * decay, 0.0, n).update::<false>(
            &mut field.decoder.appearance,
            &mut matrix_moments.first,
            &mut matrix_moments.second,
            matrix_gradients,
        );
        field.rules.density_shift += f64::from(shape[1] - before[1]);
        let ratio = (shape[0] - before[0]).exp();
        let entries: Vec<_> = first_factors(&field).collect();
        for (s, b, at) in entries {
            field.scales[s].density[b].values_mut()[at] *= ratio;
        }
    }
    let width = field.component_count();
    let mut first = 0;
    let matrices = field.scales.iter().map(|scale| {
        let rank = scale.appearance_rank();
        let rows = field.decoder.appearance.chunks_exact(width);
        let matrix = rows.flat_map(|row| row[first..first + rank].iter().copied()).collect();
        first += rank;
        matrix
    });
    let matrices = matrices.collect();
    Prefix { gain: f64::from(shape[0]).exp(), offset: f64::from(shape[1]), features: scene.features(), matrices }
}

/// Scale, block and index of each entry of the first factors of density components.
fn first_factors(field: &Field<f32>) -> impl Iterator<Item = (usize, usize, usize)> {
    field.scales.iter().enumerate().flat_map(|(s, scale)| {
        scale.density.iter().enumerate().flat_map(move |(b, block)| {
            let (held, rows) = (block.held(), block.first_factor_rows());
            (0..held.tensors()).flat_map(move |n| held.values(n).take(rows * held.count(n)).map(move |at| (s, b, at)))
        })
    })
}

//! The importance of single factor entries, estimated from a scene's own pictures.

use crate::field::Field;
use crate::geometry::Ray;
use crate::model::Scene;
use crate::random::Random;
use crate::train::Backward;

/// Rays of a batch.
const RAYS: usize = 8192;

/// Importance of each factor entry v, laid out as the scene's factors: the mean over rays and channels of (∂color/∂v)², the
/// diagonal of the Gauss-Newton matrix. A small error e of v adds e² times its importance to the mean squared error of
/// pictures.
#[derive(Clone, Debug)]
pub struct FactorImportance {
    /// \[scale\] importance of the density factors.
    pub density: Vec<Vec<f32>>,
    /// \[scale\] importance of the appearance factors.
    pub appearance: Vec<Vec<f32>>,
}

impl FactorImportance {
    /// Estimates the importance from `batches` batches of rays in the model's space. `rays` draws a number of them with
    /// a random stream.
    pub fn estimate(scene: &Scene, batches: usize, seed: u64, rays: impl Fn(usize, &Random) -> Vec<Ray>) -> Self {
        let field = Field::<f32>::new(scene);
        let mut backward = Backward::new(&field);
        let random = Random::new(seed, "sensitivity");
        let zeros = |values: &[f32]| vec![0.0; values.len()];
        let mut density: Vec<_> = field.scales.iter().map(|scale| zeros(scale.density.values())).collect();
        let mut appearance: Vec<_> = field.scales.iter().map(|scale| zeros(scale.appearance.values())).collect();
        for n in 0..batches as u64 {
            let rays = rays(RAYS, &random.substream(2 * n));
            let gradients = backward.picture_gradients(&field, &rays, &random.substream(2 * n + 1));
            let scale = 1.0 / batches as f32;
            for (total, gradients) in [(&mut density, &gradients.density), (&mut appearance, &gradients.appearance)] {
                for (total, g) in total.iter_mut().flatten().zip(gradients.iter().flatten()) {
                    *total += scale * g * g;
                }
            }
        }
        Self {
            density: field.scales.iter().zip(&density).map(|(s, sums)| s.density.held().dense(sums)).collect(),
            appearance: field.scales.iter().zip(&appearance).map(|(s, sums)| s.appearance.held().dense(sums)).collect(),
        }
    }
}

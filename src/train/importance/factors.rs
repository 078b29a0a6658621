//! The importance of single factor entries, estimated from a scene's own pictures.

use crate::field::Field;
use crate::geometry::Ray;
use crate::model::Scene;
use crate::random::Random;
use crate::train::Backward;

/// Rays of a batch.
const RAYS: usize = 8192;

/// Importance of each factor entry v, laid out as the factors: the mean over rays and channels of (∂color/∂v)², the
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
        let mut sums: Option<Self> = None;
        for n in 0..batches as u64 {
            let rays = rays(RAYS, &random.substream(2 * n));
            let gradients = backward.picture_gradients(&field, &rays, &random.substream(2 * n + 1));
            let total = sums.get_or_insert_with(|| Self {
                density: gradients.density.iter().map(|g| vec![0.0; g.len()]).collect(),
                appearance: gradients.appearance.iter().map(|g| vec![0.0; g.len()]).collect(),
            });
            let scale = 1.0 / batches as f32;
            for (total, gradients) in
                [(&mut total.density, &gradients.density), (&mut total.appearance, &gradients.appearance)]
            {
                for (total, g) in total.iter_mut().flatten().zip(gradients.iter().flatten()) {
                    *total += scale * g * g;
                }
            }
        }
        sums.unwrap_or(Self { density: Vec::new(), appearance: Vec::new() })
    }
}

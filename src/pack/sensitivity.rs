//! What each factor is worth: how much pictures change when it does.

use crate::field::Field;
use crate::model::Scene;
use crate::random::Random;
use crate::train::Backward;

use super::Views;

/// Rays of a batch.
const RAYS: usize = 8192;

/// \[scale\] for each factor v, laid out as the factors: the mean over rays and channels of (∂color/∂v)², so that a small
/// error e of v adds that times e² to the mean squared error of pictures (Gauss and Newton's diagonal).
#[derive(Clone, Debug)]
pub struct Sensitivity {
    /// Of density factors.
    pub density: Vec<Vec<f32>>,
    /// Of appearance factors.
    pub appearance: Vec<Vec<f32>>,
}

/// Estimates it from `batches` of rays of `views`.
pub fn sensitivity(scene: &Scene, views: &Views, batches: usize, seed: u64) -> Sensitivity {
    let field = Field::<f32>::new(scene);
    let mut backward = Backward::new(&field);
    let random = Random::new(seed, "sensitivity");
    let mut sums: Option<Sensitivity> = None;
    for n in 0..batches as u64 {
        let rays = views.rays(RAYS, &random.substream(2 * n));
        let gradients = backward.picture_gradients(&field, &rays, &random.substream(2 * n + 1));
        let total = sums.get_or_insert_with(|| Sensitivity {
            density: gradients.density.iter().map(|g| vec![0.0; g.len()]).collect(),
            appearance: gradients.appearance.iter().map(|g| vec![0.0; g.len()]).collect(),
        });
        let scale = 1.0 / batches as f32;
        for (total, found) in [(&mut total.density, &gradients.density), (&mut total.appearance, &gradients.appearance)]
        {
            for (total, found) in total.iter_mut().flatten().zip(found.iter().flatten()) {
                *total += scale * found * found;
            }
        }
    }
    sums.unwrap_or(Sensitivity { density: Vec::new(), appearance: Vec::new() })
}

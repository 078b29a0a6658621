//! The importance of single factor entries and of whole components, estimated from a scene's own pictures.

use crate::Backward;
use crate::lean::add_squares;
use strivec_field::{Field, FieldFactors, FieldScale};
use strivec_format::geometry::Ray;
use strivec_format::model::Scene;
use strivec_format::random::Random;

/// Rays of a batch.
const RAYS: usize = 8192;

/// Importance of the factors of a scene.
#[derive(Clone, Debug)]
pub struct FactorImportance {
    /// \[scale\]\[block\].
    pub scales: Vec<Vec<BlockImportance>>,
}

/// Importance of the factors of a block.
#[derive(Clone, Debug)]
pub struct BlockImportance {
    /// Importance of each entry v, laid out as the scene's factors: the mean over rays and channels of (∂color/∂v)², the
    /// diagonal of the Gauss-Newton matrix. A small error e of v, independent of others, adds e² times this to the mean squared error of
    /// pictures.
    pub entries: Vec<f32>,
    /// \[tensor\]\[component\] what the absence of a component adds to the mean squared error of pictures: the mean of (Σ
    /// v·∂color/∂v)² over the entries of one of its factors, which vanish together.
    pub components: Vec<f64>,
}

impl BlockImportance {
    /// Zeros, laid out as `factors` are held.
    fn zeros(factors: &FieldFactors<f32>) -> Self {
        Self { entries: vec![0.0; factors.values().len()], components: vec![0.0; factors.held().components()] }
    }

    /// Adds the squares of a batch's `gradients` of `factors`, whose first factor has `rows` rows.
    fn add(&mut self, factors: &FieldFactors<f32>, gradients: &[f32], rows: usize, share: f64) {
        for (sum, g) in self.entries.iter_mut().zip(gradients) {
            // Signs are random, so the square of the sum over rays is the sum of squares in expectation.
            *sum += share as f32 * g * g;
        }
        for (tensor, components) in factors.held().split_mut(&mut self.components).into_iter().enumerate() {
            let values = factors.held().values(tensor);
            add_squares(components, &factors.values()[values.clone()], &gradients[values], rows, share);
        }
    }

    /// These importances laid out as the scene's factors: also of components that the field does not hold, as 0.
    fn dense(&self, factors: &FieldFactors<f32>) -> Self {
        let held = factors.held();
        let mut components = vec![0.0; held.tensors() * held.rank()];
        let of_held = (0..held.tensors()).flat_map(|n| held.of(n).iter().map(move |&c| n * held.rank() + c as usize));
        of_held.zip(&self.components).for_each(|(at, &sum)| components[at] = sum);
        Self { entries: held.dense(&self.entries), components }
    }
}

impl FactorImportance {
    /// Estimates the importance from `batches` batches of rays in the model's space. `rays` draws a number of them with
    /// a random stream.
    pub fn estimate(scene: &Scene, batches: usize, seed: u64, rays: impl Fn(usize, &Random) -> Vec<Ray>) -> Self {
        let field = Field::<f32>::unlimited(scene);
        let mut backward = Backward::new(&field);
        let random = Random::new(seed, "sensitivity");
        let zeros = |scale: &FieldScale<f32>| scale.blocks().map(BlockImportance::zeros).collect();
        let mut scales: Vec<Vec<BlockImportance>> = field.scales.iter().map(zeros).collect();
        for n in 0..batches as u64 {
            let rays = rays(RAYS, &random.substream(2 * n));
            let gradients = backward.picture_gradients(&field, &rays, &random.substream(2 * n + 1));
            let share = 1.0 / batches as f64;
            for ((scale, sums), gradients) in field.scales.iter().zip(&mut scales).zip(&gradients.factors) {
                for ((block, sums), gradients) in scale.blocks().zip(sums).zip(gradients) {
                    sums.add(block, gradients, block.first_factor_rows(), share);
                }
            }
        }
        let dense = |(scale, sums): (&FieldScale<f32>, &Vec<BlockImportance>)| {
            scale.blocks().zip(sums).map(|(block, sums)| sums.dense(block)).collect()
        };
        Self { scales: field.scales.iter().zip(&scales).map(dense).collect() }
    }
}

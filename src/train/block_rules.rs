//! What a loss has of a block's factors alone: their size, and the differences between neighboring vertices.

use std::ops::Range;
use std::sync::Arc;

use strivec_field::FieldFactors;
use strivec_format::model::Form;

/// The rules of the optimizer for the factors of a block.
#[derive(Clone, Debug)]
pub(super) struct BlockRules(Arc<BlockTables>);

#[derive(Debug)]
struct BlockTables {
    first_factor_rows: usize,
    vectors: Vec<Range<usize>>,
    rows: usize,
    /// The rows of each factor, and the gradient of |v|.
    size: Vec<(Range<usize>, f32)>,
    /// Rows, how many rows later the next vertex along an axis of the factor is, and half the gradient of a squared difference
    /// of 1.
    variation: Vec<(Range<usize>, usize, f32)>,
}

impl BlockRules {
    /// For `block`, with the weights of the mean absolute number of each factor (paper, "Optimization and objectives") and of the
    /// mean squared difference between neighboring vertices along each axis of a factor (TensoRF, section 4.4).
    pub(super) fn new(block: &FieldFactors<f32>, size: f64, variation: f64) -> Self {
        let (form, resolution) = (block.form(), block.resolution());
        let (factors, components) = (form.factors(resolution), block.held().tensors() * block.held().rank());
        let share = |weight: f64, rows: usize| (weight / (components * rows).max(1) as f64) as f32;
        let mut end = 0;
        let vectors = form.vectors(resolution).into_iter().map(|len| {
            end += len;
            end - len..end
        });
        let vectors: Vec<Range<usize>> = vectors.collect();
        let mut rules = BlockTables {
            first_factor_rows: block.first_factor_rows(),
            rows: form.rows(resolution),
            size: Vec::new(),
            variation: Vec::new(),
            vectors,
        };
        if size > 0.0 {
            rules.size = factors.iter().map(|rows| (rows.clone(), share(size, rows.len()))).collect();
        }
        if variation > 0.0 {
            for factor in &factors {
                let of_factor = || rules.vectors.iter().filter(|vector| factor.contains(&vector.start));
                let pairs: usize = of_factor().map(|vector| vector.len() - 1).sum();
                let along = of_factor().map(|vector| (vector.start..vector.end - 1, 1, share(variation, pairs)));
                rules.variation.extend(along.collect::<Vec<_>>());
            }
            if let (Form::Vm(axis), [_, matrix]) = (form, &factors[..]) {
                let row_len = resolution[Form::matrix_axes(axis)[0]] as usize + 1;
                let rows = matrix.start..matrix.end - row_len;
                let weight = share(variation, rows.len());
                rules.variation.push((rows, row_len, weight));
            }
        }
        Self(Arc::new(rules))
    }

    /// The number of rows of the first factor.
    #[inline(always)]
    pub(super) fn first_factor_rows(&self) -> usize {
        self.0.first_factor_rows
    }

    /// The rows of each vector.
    #[inline(always)]
    pub(super) fn vectors(&self) -> &[Range<usize>] {
        &self.0.vectors
    }

    /// Adds the gradients of both to those of a tensor's `factors`.
    #[inline(always)]
    pub(super) fn add_gradients(&self, factors: &[f32], gradients: &mut [f32]) {
        let rank = factors.len() / self.0.rows;
        for (rows, weight) in &self.0.size {
            let at = rows.start * rank..rows.end * rank;
            for (g, &v) in gradients[at.clone()].iter_mut().zip(&factors[at]) {
                // 0 has no sign: its gradient is 0, so zeros stay zeros.
                let sign = if v > 0.0 { 1.0 } else { -1.0 };
                *g += if v == 0.0 { 0.0 } else { weight * sign };
            }
        }
        for (rows, step, weight) in &self.0.variation {
            let step = step * rank;
            for lower in rows.start * rank..rows.end * rank {
                let g = 2.0 * weight * (factors[lower] - factors[lower + step]);
                gradients[lower] += g;
                gradients[lower + step] -= g;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_field::Field;
    use strivec_format::model::Block;

    /// The loss whose gradients the rules add, of a block of one tensor.
    fn loss(block: &Block, resolution: [u32; 3], size: f64, variation: f64) -> f64 {
        let rank = block.rank as usize;
        let value = |row: usize, c: usize| f64::from(block.values[row * rank + c]);
        let mean = |terms: Vec<f64>| terms.iter().sum::<f64>() / terms.len() as f64;
        let squares = |pairs: &[[usize; 2]]| {
            mean(pairs.iter().flat_map(|p| (0..rank).map(|c| (value(p[0], c) - value(p[1], c)).powi(2))).collect())
        };
        let factors = block.form.factors(resolution);
        let mut sum = 0.0;
        for rows in &factors {
            let sizes = rows.clone().flat_map(|row| (0..rank).map(move |c| (row, c)));
            sum += size * mean(sizes.map(|(row, c)| value(row, c).abs()).collect());
        }
        let [x, y] = [resolution[0] as usize + 1, resolution[2] as usize + 1];
        let Form::Vm(1) = block.form else { panic!("a vector along y") };
        let first = factors[1].start;
        let at = |i: usize, j: usize| first + j * x + i;
        let line: Vec<[usize; 2]> = (1..factors[0].end).map(|n| [n - 1, n]).collect();
        let along: Vec<_> = (0..y).flat_map(|j| (1..x).map(move |i| [at(i - 1, j), at(i, j)])).collect();
        let across: Vec<_> = (1..y).flat_map(|j| (0..x).map(move |i| [at(i, j - 1), at(i, j)])).collect();
        sum + variation * (squares(&line) + squares(&along) + squares(&across))
    }

    #[test]
    fn gradients_are_those_of_size_and_variation() {
        let mut scene = strivec_format::container::decode(include_bytes!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../fixtures/v1/smallest.strivec"
        )))
        .unwrap();
        let resolution = [2, 3, 4];
        let form = Form::Vm(1);
        let numbers = strivec_format::random::Random::new(3, "block rules");
        // Not near 0, where the size has a kink.
        let number = |n| 0.1 + numbers.uniform(n);
        let values = (0..form.rows(resolution) as u64 * 2).map(|n| [1.0, -1.0][n as usize % 2] * number(n) as f32);
        let values = values.collect();
        let block = Block { form, rank: 2, values };
        scene.scales[0].cloud.resolution = resolution;
        (scene.scales[0].factors.density, scene.scales[0].factors.appearance) = (vec![block.clone()], vec![]);
        (scene.scales[0].factors.appearance, scene.scales[0].appearance_matrix.rank) = (vec![block.clone()], 2);
        scene.scales[0].appearance_matrix.weights = vec![0.0; 4];
        let field = Field::<f32>::unlimited(&scene);
        let rules = BlockRules::new(&field.scales[0].density[0], 0.7, 1.3);
        let mut gradients = vec![0.0; block.values.len()];
        rules.add_gradients(&block.values, &mut gradients);
        for n in 0..block.values.len() {
            let moved = |by: f32| {
                let mut block = block.clone();
                block.values[n] += by;
                loss(&block, resolution, 0.7, 1.3)
            };
            let expected = (moved(1e-3) - moved(-1e-3)) / 2e-3;
            assert!((f64::from(gradients[n]) - expected).abs() < 1e-4, "{n}: {} and {expected}", gradients[n]);
        }
    }
}

//! Lean training: components that pictures hardly depend on are given up as training goes.
//!
//! The worth of a component is the rise of the pictures' mean squared error if it is removed, relative to the error and per
//! parameter. It comes from the gradients that training computes anyway: along a component, the loss's derivative g of
//! a batch is a sum over its rays of error times derivative of color, and errors have about random signs, so the mean of g²
//! measures the mean squared derivative of the color.
//!
//! Density components are given up wherever they are. Appearance components have an order in which all tensors of the
//! scale give them up, so that a tensor always holds the first ones ([`strivec_field::FieldFactors`]).
//!
//! In some rounds a scale gives up cells instead, if that costs less than as many parameters in components. What it costs
//! is measured on rays, because it moves all factors at once.

use super::LeanConfig;
use strivec_field::{Field, FieldFactors, FieldScale, HeldComponents, Real};

/// dB of PSNR that a relative rise of the mean squared error costs.
const DECIBELS: f64 = 10.0 / std::f64::consts::LN_10;

/// While all components together are worth less than this, in dB, pictures do not show the scene yet, and none is given up
/// for its worth.
const LEAST_WORTH: f64 = 1.0;
/// The most of the parameters that a round gives up for their worth.
const MAX_SHARE: f64 = 0.1;
/// A scale may give up cells in every round of this many, and then keeps this share of them along each axis, but no fewer
/// than these.
const CELLS_EVERY: u32 = 4;
const CELLS_KEPT: f64 = 0.85;
const MIN_CELLS: u32 = 2;

/// Sums over steps, for the worth of components.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Worth {
    /// \[scale\]\[block\]\[component, over all tensors\] Σ over steps of the relative rise of the mean squared error.
    pub(super) rises: Vec<Vec<Vec<f64>>>,
    /// Number of steps.
    pub(super) steps: u64,
}

impl Worth {
    /// Sums over no steps.
    pub(super) fn none(field: &Field<f32>) -> Self {
        let zeros = |block: &FieldFactors<f32>| vec![0.0; block.held().components()];
        Self { rises: field.scales.iter().map(|s| s.blocks().map(zeros).collect()).collect(), steps: 0 }
    }

    /// Keeps the sums of the tensors of the numbers `kept` of scale `s`, which is `scale`.
    pub(super) fn keep_tensors(&mut self, s: usize, kept: &[usize], scale: &FieldScale<f32>) {
        for (rises, block) in self.rises[s].iter_mut().zip(scale.blocks()) {
            *rises = kept.iter().flat_map(|&n| &rises[block.held().range(n)]).copied().collect();
        }
    }
}

/// Adds a step's squared derivatives along the components of a tensor to `rises`. The first of their factors has `rows` rows in
/// `factors` and their `gradients`; squares count `weight` times.
///
/// A component is linear in each of its factors, so the derivative along the first is that of its magnitude.
#[inline(always)]
pub(super) fn add_squares<T: Real>(rises: &mut [f64], factors: &[T], gradients: &[T], rows: usize, weight: f64) {
    // Sums of a register's width, so that the loop over rows keeps them in registers.
    const BLOCK: usize = 16;
    let rank = rises.len();
    for (block, rises) in rises.chunks_mut(BLOCK).enumerate() {
        let mut sums = [T::zero(); BLOCK];
        for row in 0..rows {
            let at = row * rank + block * BLOCK;
            let (factors, gradients) = (&factors[at..][..rises.len()], &gradients[at..][..rises.len()]);
            for ((sum, &v), &g) in sums.iter_mut().zip(factors).zip(gradients) {
                *sum += v * g;
            }
        }
        rises.iter_mut().zip(sums).for_each(|(rise, sum)| *rise += weight * sum.f64() * sum.f64());
    }
}

/// The factor of squared derivatives of the loss that makes them relative rises of the mean squared error: with N rays
/// and random signs of the errors, E\[g²\] = 4·E/(3N)·(mean squared derivative of a channel). E is the mean over rays
/// of the squared error times the square of the ray's weight: `weighted`.
pub(super) fn square_weight(mean_squared_error: f64, weighted: f64, rays: usize) -> f64 {
    0.75 * rays as f64 / (mean_squared_error * weighted).max(f64::MIN_POSITIVE)
}

/// The components of a block that tensors keep.
pub(super) struct Kept {
    pub(super) held: HeldComponents,
    /// Component c of these was `order`\[c\].
    pub(super) order: Vec<u16>,
}

/// The components of a field by their worth.
pub(super) struct Ranking {
    /// \[scale\]\[block\] the new order of components.
    orders: Vec<Vec<Vec<u16>>>,
    /// The least worth first.
    candidates: Vec<ComponentCandidate>,
    /// Number of parameters.
    pub(super) total: u64,
}

/// A component that can be given up.
struct ComponentCandidate {
    /// Worth of the component, in dB of PSNR per parameter.
    worth: f64,
    /// Scale, block, tensor; and the component.
    index: [usize; 3],
    component: u16,
    /// Parameters at the last resolution.
    parameters: u64,
}

/// \[block\] the new order of the components of `scale`: component c was number `order`\[c\]. Only appearance components
/// change it, and only while all tensors hold all of them: those of the largest sum of `rises` come first.
fn orders(scale: &FieldScale<f32>, rises: &[Vec<f64>]) -> Vec<Vec<u16>> {
    let of_block = |(b, (block, rises)): (usize, (&FieldFactors<f32>, &Vec<f64>))| {
        let held = block.held();
        let mut order: Vec<u16> = (0..held.rank() as u16).collect();
        if b >= scale.density.len() && held.components() == held.tensors() * held.rank() {
            let mut totals = vec![0.0; held.rank()];
            for of_tensor in rises.chunks_exact(held.rank()) {
                totals.iter_mut().zip(of_tensor).for_each(|(total, rise)| *total += rise);
            }
            // One order for all tensors, so that each holds the first components and no zeros between; in any order,
            // memory was 70 % more.
            order.sort_by(|&a, &b| totals[b as usize].total_cmp(&totals[a as usize]));
        }
        order
    };
    scale.blocks().zip(rises).enumerate().map(of_block).collect()
}

/// True if a scale may give up cells in `round`.
pub(super) fn is_for_cells(round: u32) -> bool {
    round > 0 && round.is_multiple_of(CELLS_EVERY)
}

/// The number of cells along each axis of a scale that gives up some of its `cells`.
pub(super) fn fewer(cells: [u32; 3]) -> [u32; 3] {
    cells.map(|d| ((CELLS_KEPT * f64::from(d)).round() as u32).clamp(MIN_CELLS.min(d), d))
}

impl ComponentCandidate {
    /// The loss of PSNR if it is given up, in dB.
    fn loss(&self) -> f64 {
        self.worth * self.parameters as f64
    }
}

impl Ranking {
    /// The components of `field` by `worth`. \[scale\] `resolutions` are those at the end of training, and `shared` the
    /// parameters that are not factors.
    pub(super) fn new(field: &Field<f32>, worth: &Worth, resolutions: &[[u32; 3]], shared: u64) -> Self {
        let orders: Vec<_> = field.scales.iter().zip(&worth.rises).map(|(s, rises)| orders(s, rises)).collect();
        let mut candidates = candidates(field, worth, &orders, resolutions);
        // Components of a tensor with the same worth are given up from the last on.
        let place = |c: &ComponentCandidate| (c.index, std::cmp::Reverse(c.component));
        candidates.sort_by(|a, b| a.worth.total_cmp(&b.worth).then_with(|| place(a).cmp(&place(b))));
        let total = shared + candidates.iter().map(|c| c.parameters).sum::<u64>();
        Self { orders, candidates, total }
    }

    /// \[scale\]\[block\] the components of these that the tensors of `field` keep in `round`. What is given up for its
    /// worth costs at most `allowance`, in dB.
    pub(super) fn kept(self, lean: &LeanConfig, field: &Field<f32>, round: u32, allowance: f64) -> Vec<Vec<Kept>> {
        let Ranking { orders, candidates, total } = self;
        let (mut max_loss, most) = lean.goals(round, total);
        // A picture of fog depends on no component: all would go.
        if lean.max_drop.is_none() && candidates.iter().map(ComponentCandidate::loss).sum::<f64>() < LEAST_WORTH {
            max_loss = 0.0;
        }
        let least = ((1.0 - MAX_SHARE) * total as f64) as u64;
        let (mut left, mut spent) = (total, 0.0);
        let mut given_up = 0;
        for candidate in &candidates {
            let loss_of_one_percent = candidate.worth * left as f64 / 100.0;
            spent += candidate.loss();
            let loss = DECIBELS * (spent / DECIBELS).ln_1p();
            // The price of one percent, not of one parameter: fewer parameters left make each of them dearer, which
            // ends the giving up (docs/experiments/2026-11-26-adam.md).
            let is_worth_its_place = loss_of_one_percent >= max_loss || left <= least || loss > allowance;
            if is_worth_its_place && left <= most {
                break;
            }
            given_up += 1;
            left -= candidate.parameters;
        }
        let none = |block: &FieldFactors<f32>| vec![Vec::new(); block.held().tensors()];
        let mut kept: Vec<Vec<Vec<Vec<u16>>>> = field.scales.iter().map(|s| s.blocks().map(none).collect()).collect();
        for ComponentCandidate { index: [s, b, tensor], component, .. } in &candidates[given_up..] {
            kept[*s][*b][*tensor].push(*component);
        }
        kept.iter_mut().flatten().flatten().for_each(|components| components.sort_unstable());
        (field.scales.iter().zip(kept).zip(orders))
            .map(|((scale, kept), orders)| {
                (scale.blocks().zip(kept).zip(orders))
                    .map(|((block, components), order)| Kept { held: block.held().of_components(&components), order })
                    .collect()
            })
            .collect()
    }

    /// True if in `round` a change that saves `saved` parameters and raises the mean squared error by the factor `rise` at once
    /// is better than giving up as many in components, the first of these.
    pub(super) fn is_worse_than(&self, lean: &LeanConfig, round: u32, saved: u64, rise: f64) -> bool {
        // As the worth of components: linear in the rise.
        let loss = DECIBELS * (rise - 1.0);
        let (max_loss, most) = lean.goals(round, self.total);
        let loss_of_one_percent = loss * self.total as f64 / (100 * saved) as f64;
        (loss_of_one_percent < max_loss || self.total > most) && loss < self.loss_of(saved)
    }

    /// The loss of PSNR, in dB, if the first components with this many parameters are given up.
    fn loss_of(&self, parameters: u64) -> f64 {
        let mut left = parameters;
        let taken = self.candidates.iter().take_while(|candidate| {
            let is_needed = left > 0;
            left = left.saturating_sub(candidate.parameters);
            is_needed
        });
        taken.map(ComponentCandidate::loss).sum()
    }
}

/// All components of the tensors of `field`, in the new `orders`.
fn candidates(
    field: &Field<f32>,
    worth: &Worth,
    orders: &[Vec<Vec<u16>>],
    resolutions: &[[u32; 3]],
) -> Vec<ComponentCandidate> {
    let mut candidates = Vec::new();
    for (s, scale) in field.scales.iter().enumerate() {
        for (b, block) in scale.blocks().enumerate() {
            let rows = block.form().rows(resolutions[s]) as u64;
            let per_parameter = DECIBELS / (worth.steps.max(1) * rows) as f64;
            let held = block.held();
            for tensor in 0..held.tensors() {
                let rises = &worth.rises[s][b][held.range(tensor)];
                let (components, mut rises) = in_order(&orders[s][b], held.of(tensor), rises);
                // A later component cannot stay without an earlier one, so both count as their mean.
                if b >= scale.density.len() {
                    make_non_increasing(&mut rises);
                }
                candidates.extend(components.into_iter().zip(rises).map(|(component, rise)| ComponentCandidate {
                    worth: rise * per_parameter,
                    index: [s, b, tensor],
                    component,
                    parameters: rows,
                }));
            }
        }
    }
    candidates
}

/// The new numbers of a tensor's `components`, of which component c was `order`\[c\], and their `worths`.
fn in_order(order: &[u16], components: &[u16], worths: &[f64]) -> (Vec<u16>, Vec<f64>) {
    (order.iter().enumerate())
        .filter_map(|(c, old)| components.binary_search(old).ok().map(|place| (c as u16, worths[place])))
        .unzip()
}

/// Replaces the numbers of each run that increases by their mean, so that `values` never increase and keep their sum
/// (pool adjacent violators).
fn make_non_increasing(values: &mut [f64]) {
    // Sums and lengths of pools.
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for &value in values.iter() {
        let mut pool = (value, 1);
        while let Some(&(sum, count)) = pools.last()
            && sum * (pool.1 as f64) < pool.0 * count as f64
        {
            pool = (pool.0 + sum, pool.1 + count);
            pools.pop();
        }
        pools.push(pool);
    }
    let means = pools.into_iter().flat_map(|(sum, count)| std::iter::repeat_n(sum / count as f64, count));
    values.iter_mut().zip(means).for_each(|(value, mean)| *value = mean);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_that_increase_are_pooled() {
        let mut values = [5.0, 1.0, 3.0, 2.0, 4.0, 0.5];
        make_non_increasing(&mut values);
        assert_eq!(values, [5.0, 2.5, 2.5, 2.5, 2.5, 0.5]);
    }
}

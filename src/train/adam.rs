//! Adam (Kingma and Ba, 2015), with the option to leave entries alone whose gradient is zero.

use strivec_field::{HeldComponents, Real};

/// β₁, β₂ and ε.
/// The paper keeps 0.9 and 0.99; shorter memories gain 0.2 dB for no time (docs/experiments/2026-11-26-adam.md).
const BETAS: [f64; 2] = [0.8, 0.97];
const EPSILON: f64 = 1e-8;

/// First and second moments of a vector of parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moments<T> {
    /// Running mean of the gradient.
    pub first: Vec<T>,
    /// Running mean of its square.
    pub second: Vec<T>,
}

impl<T: Real> Moments<T> {
    /// Zero moments for `len` parameters.
    pub fn zeros(len: usize) -> Self {
        Self { first: vec![T::zero(); len], second: vec![T::zero(); len] }
    }

    /// Keeps the moments of the components `to`, of those that `held` describes; component c was `order`\[c\].
    pub(super) fn rearrange(&mut self, held: &HeldComponents, to: &HeldComponents, order: &[u16]) {
        for moments in [&mut self.first, &mut self.second] {
            *moments = held.rearranged(moments, to, order);
        }
    }

    /// Keeps the moments of the tensors of the numbers `kept`, of those that `held` describes.
    pub(super) fn keep_tensors(&mut self, kept: &[usize], held: &HeldComponents) {
        for moments in [&mut self.first, &mut self.second] {
            *moments = kept.iter().flat_map(|&n| &moments[held.values(n)]).copied().collect();
        }
    }
}

/// One step's constants.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Adam<T> {
    step_size: T,
    second_scale: T,
    /// The factor of a parameter, 1 less its decay.
    kept: T,
}

impl<T: Real> Adam<T> {
    /// Step number `step`, counted from 1 since the optimizer was last restarted. With weight decay, parameters lose
    /// `learning_rate`·`weight_decay` of themselves besides (Loshchilov and Hutter, 2019).
    pub(crate) fn new(learning_rate: f64, weight_decay: f64, step: u64) -> Self {
        let correction = |beta: f64| 1.0 - beta.powf(step as f64);
        Self {
            step_size: T::of(learning_rate / correction(BETAS[0])),
            second_scale: T::of(1.0 / correction(BETAS[1]).sqrt()),
            kept: T::of((1.0 - learning_rate * weight_decay).max(0.0)),
        }
    }

    /// Updates `parameters` and their moments. If `SKIP_ZEROS`, entries of zero gradient keep both.
    #[inline(always)]
    pub(crate) fn update<const SKIP_ZEROS: bool>(
        &self,
        parameters: &mut [T],
        first: &mut [T],
        second: &mut [T],
        gradients: &[T],
    ) {
        /// Few samples meet a tensor, so whole runs of its entries have no gradient: they are skipped without being
        /// read.
        const RUN: usize = 64;
        for (n, gradients) in gradients.chunks(RUN).enumerate() {
            // A fold without an early end, which compiles to vector operations.
            if SKIP_ZEROS && !gradients.iter().fold(false, |any, &g| any | (g != T::zero())) {
                continue;
            }
            let run = n * RUN..n * RUN + gradients.len();
            let (first, second) = (&mut first[run.clone()], &mut second[run.clone()]);
            self.update_run::<SKIP_ZEROS>(&mut parameters[run], first, second, gradients);
        }
    }

    #[inline(always)]
    fn update_run<const SKIP_ZEROS: bool>(
        &self,
        parameters: &mut [T],
        first: &mut [T],
        second: &mut [T],
        gradients: &[T],
    ) {
        let [beta1, beta2] = BETAS.map(T::of);
        let [rest1, rest2] = BETAS.map(|b| T::of(1.0 - b));
        let epsilon = T::of(EPSILON);
        let n = gradients.len();
        let (parameters, first, second) = (&mut parameters[..n], &mut first[..n], &mut second[..n]);
        for i in 0..n {
            let g = gradients[i];
            // Selects below instead of branches, so that the loop vectorizes.
            let m = beta1 * first[i] + rest1 * g;
            let v = beta2 * second[i] + rest2 * g * g;
            // √v·√c, not √(v·c): rounded otherwise, it would change every trained byte.
            let p = self.kept * parameters[i] - self.step_size * m / (v.sqrt() * self.second_scale + epsilon);
            let keep = SKIP_ZEROS && g == T::zero();
            first[i] = if keep { first[i] } else { m };
            second[i] = if keep { second[i] } else { v };
            parameters[i] = if keep { parameters[i] } else { p };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parameters of 1 after a step at a learning rate of 0.1, the second of them without a gradient.
    fn first_step(weight_decay: f64) -> ([f64; 2], Moments<f64>) {
        let (mut p, mut moments) = ([1.0, 1.0], Moments::zeros(2));
        let adam = Adam::new(0.1, weight_decay, 1);
        adam.update::<true>(&mut p, &mut moments.first, &mut moments.second, &[3.0, 0.0]);
        (p, moments)
    }

    #[test]
    fn first_step_moves_by_the_learning_rate_against_the_gradient() {
        let (p, moments) = first_step(0.0);
        assert!((p[0] - 0.9).abs() < 1e-8);
        assert_eq!(p[1], 1.0);
        assert_eq!(moments.first[1], 0.0);
    }

    #[test]
    fn weight_decay_is_in_learning_rates_and_spares_entries_without_a_gradient() {
        let (p, _) = first_step(0.01);
        assert!((p[0] - (0.9 - 0.001)).abs() < 1e-8);
        assert_eq!(p[1], 1.0);
    }
}

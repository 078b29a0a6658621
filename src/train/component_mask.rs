//! Masks of components of tensors: masked components become exact zeros, which files leave out.

use rayon::prelude::*;

use crate::field::{Field, FieldFactors, Holding};
use crate::model::{Factors, Scene};

/// Density and appearance of a scale, in this order.
pub(super) type Parts<V> = [V; 2];

/// The components of a scene to write zeros over.
#[derive(Clone, Debug)]
pub(super) struct ComponentMask {
    /// \[scale\] of density and appearance, \[tensor\]\[component\].
    pub(super) scales: Vec<Parts<Vec<bool>>>,
}

impl ComponentMask {
    /// A mask of no component.
    pub(super) fn none(scene: &Scene) -> Self {
        let none = |s: &crate::model::Scale| {
            [s.factors.density_rank, s.factors.appearance_rank].map(|rank| vec![false; s.cloud.len() * rank as usize])
        };
        Self { scales: scene.scales.iter().map(none).collect() }
    }

    /// Writes zeros over the masked components of `scene`.
    pub(super) fn apply(&self, scene: &mut Scene) {
        for (scale, [density, appearance]) in scene.scales.iter_mut().zip(&self.scales) {
            let rows = Factors::rows(scale.cloud.resolution);
            let factors = &mut scale.factors;
            write_zeros(&mut factors.density, rows, factors.density_rank as usize, density);
            write_zeros(&mut factors.appearance, rows, factors.appearance_rank as usize, appearance);
        }
    }

    /// Copies the factors of `scene` to `field`, without the masked components.
    pub(super) fn write_to(&self, scene: &Scene, field: &mut Field<f32>) {
        for ((scale, of_field), mask) in scene.scales.iter().zip(&mut field.scales).zip(&self.scales) {
            let rows = Factors::rows(scale.cloud.resolution);
            let factors = &scale.factors;
            let without = |holding, dense, rank: u32, mask: &[bool]| {
                let rank = rank as usize;
                FieldFactors::without(holding, dense, rows, rank, |n, c| mask[n * rank + c])
            };
            of_field.density = without(Holding::Nonzero, &factors.density, factors.density_rank, &mask[0]);
            of_field.appearance = without(Holding::UpToLast, &factors.appearance, factors.appearance_rank, &mask[1]);
        }
    }

    /// The numbers of tensors, of components and of parameters of `scene` that are not zero and would become zero.
    pub(super) fn count(&self, scene: &Scene) -> (u64, u64, u64) {
        let (mut tensors, mut components, mut numbers) = (0, 0, 0);
        for (scale, mask) in scene.scales.iter().zip(&self.scales) {
            let rows = Factors::rows(scale.cloud.resolution);
            let factors = &scale.factors;
            let ranks = [factors.density_rank as usize, factors.appearance_rank as usize];
            let nonzero = [(&factors.density, ranks[0]), (&factors.appearance, ranks[1])]
                .map(|(values, rank)| Factors::nonzero_components(values, rows, rank));
            for n in 0..scale.cloud.len() {
                let (mut dropped, mut left) = (0, 0);
                for ((nonzero, mask), rank) in nonzero.iter().zip(mask).zip(ranks) {
                    for c in (n * rank..(n + 1) * rank).filter(|&c| nonzero[c]) {
                        *(if mask[c] { &mut dropped } else { &mut left }) += 1;
                    }
                }
                tensors += u64::from(dropped > 0 && left == 0);
                components += dropped;
                numbers += dropped * rows as u64;
            }
        }
        (tensors, components, numbers)
    }

    /// Masks all components of the tensors for which `is_masked`, and none of the others, of density (part 0) or
    /// appearance (1). Tensors are counted over all scales.
    pub(super) fn set_tensors(&mut self, scene: &Scene, part: usize, is_masked: &[bool]) {
        let mut first = 0;
        for (scale, mask) in scene.scales.iter().zip(&mut self.scales) {
            let tensors = scale.cloud.len();
            let rank = mask[part].len() / tensors;
            for (of_tensor, &masked) in mask[part].chunks_exact_mut(rank).zip(&is_masked[first..first + tensors]) {
                of_tensor.fill(masked);
            }
            first += tensors;
        }
    }
}

/// Writes zeros over the masked components of `values`, of tensors of `rows` rows and `rank` components.
fn write_zeros(values: &mut [f32], rows: usize, rank: usize, mask: &[bool]) {
    (values.par_chunks_exact_mut(rows * rank).zip(mask.par_chunks_exact(rank))).for_each(|(values, mask)| {
        for (c, _) in mask.iter().enumerate().filter(|(_, masked)| **masked) {
            values.iter_mut().skip(c).step_by(rank).for_each(|v| *v = 0.0);
        }
    });
}

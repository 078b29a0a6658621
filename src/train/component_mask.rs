//! Which components of tensors are cleared: exact zeros, which files leave out.

use rayon::prelude::*;

use crate::field::Field;
use crate::model::{Factors, Scene};

/// Density and appearance, in this order, of a scale.
pub(super) type Parts<V> = [V; 2];

/// Which components are to be cleared.
#[derive(Clone)]
pub(super) struct ComponentMask {
    /// \[scale\] density and appearance, \[tensor\]\[component\].
    pub(super) scales: Vec<Parts<Vec<bool>>>,
}

impl ComponentMask {
    pub(super) fn nothing(scene: &Scene) -> Self {
        let none = |s: &crate::model::Scale| {
            [s.factors.density_rank, s.factors.appearance_rank].map(|rank| vec![false; s.cloud.len() * rank as usize])
        };
        Self { scales: scene.scales.iter().map(none).collect() }
    }

    /// Writes zeros in place of what is cleared.
    pub(super) fn clear(&self, scene: &mut Scene) {
        for (scale, [density, appearance]) in scene.scales.iter_mut().zip(&self.scales) {
            let rows = Factors::rows(scale.cloud.resolution);
            let factors = &mut scale.factors;
            write_zeros(&mut factors.density, rows, factors.density_rank as usize, density);
            write_zeros(&mut factors.appearance, rows, factors.appearance_rank as usize, appearance);
        }
    }

    /// Gives `field` the factors of `scene` without what is cleared.
    pub(super) fn write_to(&self, scene: &Scene, field: &mut Field<f32>) {
        for ((scale, of_field), cleared) in scene.scales.iter().zip(&mut field.scales).zip(&self.scales) {
            let rows = Factors::rows(scale.cloud.resolution);
            let parts = [
                (&mut of_field.density, &scale.factors.density, &cleared[0], scale.factors.density_rank),
                (&mut of_field.appearance, &scale.factors.appearance, &cleared[1], scale.factors.appearance_rank),
            ];
            for (to, from, cleared, rank) in parts {
                to.copy_from_slice(from);
                write_zeros(to, rows, rank as usize, cleared);
            }
        }
    }

    /// How many tensors, components and numbers of `scene` are cleared that were not zeros already.
    pub(super) fn count(&self, scene: &Scene) -> (u64, u64, u64) {
        let (mut tensors, mut components, mut numbers) = (0, 0, 0);
        for (scale, cleared) in scene.scales.iter().zip(&self.scales) {
            let rows = Factors::rows(scale.cloud.resolution);
            let factors = &scale.factors;
            let ranks = [factors.density_rank as usize, factors.appearance_rank as usize];
            let held = [(&factors.density, ranks[0]), (&factors.appearance, ranks[1])]
                .map(|(values, rank)| Factors::nonzero_components(values, rows, rank));
            for n in 0..scale.cloud.len() {
                let (mut dropped, mut left) = (0, 0);
                for ((held, cleared), rank) in held.iter().zip(cleared).zip(ranks) {
                    for c in (n * rank..(n + 1) * rank).filter(|&c| held[c]) {
                        *(if cleared[c] { &mut dropped } else { &mut left }) += 1;
                    }
                }
                tensors += u64::from(dropped > 0 && left == 0);
                components += dropped;
                numbers += dropped * rows as u64;
            }
        }
        (tensors, components, numbers)
    }

    /// Sets all components of the tensors, counted over all scales, for which `is_idle`, of density (0) or appearance (1).
    pub(super) fn set_tensors(&mut self, scene: &Scene, part: usize, is_idle: &[bool]) {
        let mut first = 0;
        for (scale, cleared) in scene.scales.iter().zip(&mut self.scales) {
            let tensors = scale.cloud.len();
            let rank = cleared[part].len() / tensors;
            for (of_tensor, &idle) in cleared[part].chunks_exact_mut(rank).zip(&is_idle[first..first + tensors]) {
                of_tensor.fill(idle);
            }
            first += tensors;
        }
    }
}

/// Writes zeros in place of the `cleared` components of `values`, of tensors of `rows` rows and `rank` components.
fn write_zeros(values: &mut [f32], rows: usize, rank: usize, cleared: &[bool]) {
    (values.par_chunks_exact_mut(rows * rank).zip(cleared.par_chunks_exact(rank))).for_each(|(values, cleared)| {
        for (c, _) in cleared.iter().enumerate().filter(|(_, cleared)| **cleared) {
            values.iter_mut().skip(c).step_by(rank).for_each(|v| *v = 0.0);
        }
    });
}

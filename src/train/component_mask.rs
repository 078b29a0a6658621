//! Masks of components of tensors: masked components become exact zeros, which files leave out.

use rayon::prelude::*;

use strivec_field::{Field, FieldFactors, Holding};
use strivec_format::model::{Block, Scene};

/// The components of a scene to write zeros over.
#[derive(Clone, Debug)]
pub(super) struct ComponentMask {
    /// \[scale\]\[block\]\[tensor\]\[component\].
    pub(super) scales: Vec<Vec<Vec<bool>>>,
}

impl ComponentMask {
    /// A mask of no component.
    pub(super) fn none(scene: &Scene) -> Self {
        let none = |s: &strivec_format::model::Scale| {
            s.factors.blocks().map(|block| vec![false; s.cloud.len() * block.rank as usize]).collect()
        };
        Self { scales: scene.scales.iter().map(none).collect() }
    }

    /// Writes zeros over the masked components of `scene`.
    pub(super) fn apply(&self, scene: &mut Scene) {
        for (scale, masks) in scene.scales.iter_mut().zip(&self.scales) {
            for (block, mask) in scale.factors.blocks_mut().zip(masks) {
                write_zeros(block, scale.cloud.resolution, mask);
            }
        }
    }

    /// Copies the factors of `scene` to `field`, without the masked components.
    pub(super) fn write_to(&self, scene: &Scene, field: &mut Field<f32>) {
        for ((scale, of_field), masks) in scene.scales.iter().zip(&mut field.scales).zip(&self.scales) {
            let without = |holding, blocks: &[Block], masks: &[Vec<bool>]| {
                let of_block = |(block, mask): (&Block, &Vec<bool>)| {
                    let rank = block.rank as usize;
                    FieldFactors::without(holding, block, scale.cloud.resolution, |n, c| mask[n * rank + c])
                };
                blocks.iter().zip(masks).map(of_block).collect()
            };
            let (of_density, of_appearance) = masks.split_at(scale.factors.density.len());
            of_field.density = without(Holding::Nonzero, &scale.factors.density, of_density);
            of_field.appearance = without(Holding::UpToLast, &scale.factors.appearance, of_appearance);
        }
    }

    /// The numbers of tensors, of components and of parameters of `scene` that are not zero and would become zero.
    pub(super) fn count(&self, scene: &Scene) -> (u64, u64, u64) {
        let (mut tensors, mut components, mut numbers) = (0, 0, 0);
        for (scale, masks) in scene.scales.iter().zip(&self.scales) {
            let resolution = scale.cloud.resolution;
            // \[tensor\] whether a component is dropped, and whether one is left.
            let mut changes = vec![[false; 2]; scale.cloud.len()];
            for (block, mask) in scale.factors.blocks().zip(masks) {
                let (rank, rows) = (block.rank as usize, block.form.rows(resolution) as u64);
                let nonzero = block.nonzero_components(resolution);
                for (n, (_, &masked)) in nonzero.iter().zip(mask).enumerate().filter(|(_, (nonzero, _))| **nonzero) {
                    changes[n / rank][usize::from(!masked)] = true;
                    components += u64::from(masked);
                    numbers += u64::from(masked) * rows;
                }
            }
            tensors += changes.iter().filter(|change| **change == [true, false]).count() as u64;
        }
        (tensors, components, numbers)
    }

    /// Masks all components of the tensors for which `is_masked`, and none of the others, of density or of appearance.
    /// Tensors are counted over all scales.
    pub(super) fn set_tensors(&mut self, scene: &Scene, of_density: bool, is_masked: &[bool]) {
        let mut first = 0;
        for (scale, masks) in scene.scales.iter().zip(&mut self.scales) {
            let tensors = scale.cloud.len();
            let (density, appearance) = masks.split_at_mut(scale.factors.density.len());
            for mask in if of_density { density } else { appearance } {
                let rank = mask.len() / tensors;
                for (of_tensor, &masked) in mask.chunks_exact_mut(rank).zip(&is_masked[first..first + tensors]) {
                    of_tensor.fill(masked);
                }
            }
            first += tensors;
        }
    }
}

/// Writes zeros over the masked components of `block`, of tensors of `resolution` cells.
fn write_zeros(block: &mut Block, resolution: [u32; 3], mask: &[bool]) {
    let (rank, len) = (block.rank as usize, block.tensor_len(resolution));
    (block.values.par_chunks_exact_mut(len).zip(mask.par_chunks_exact(rank))).for_each(|(values, mask)| {
        for (c, _) in mask.iter().enumerate().filter(|(_, masked)| **masked) {
            values.iter_mut().skip(c).step_by(rank).for_each(|v| *v = 0.0);
        }
    });
}

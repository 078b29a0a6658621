//! The rounds in which a run gives up components and cells; `lean.rs` chooses them.

use super::lean::{self, Kept, Ranking, Worth};
use super::{Checkpoint, RayBatch, Trainer, march_step, upsample};
use strivec_field::{Field, FieldFactors};
use strivec_format::model::Scene;
use strivec_format::random::Random;

/// The share of what may still be lost that a round may cost at once.
const ALLOWED_SHARE: f64 = 0.5;
/// The most rays that measure a picture's error.
const RAYS: usize = 1 << 15;

impl Trainer<'_> {
    /// PSNR of the current scene on rays of the photographs, in dB, with their exposures: the same rays on every call, while
    /// the same are active.
    pub fn psnr(&self) -> f64 {
        self.psnr_along(&self.measuring_rays(&self.field), &self.field)
    }

    /// PSNR of another `scene` on the rays of [`Trainer::psnr`], in dB.
    pub fn psnr_of(&self, scene: &Scene) -> f64 {
        let field = Field::unlimited(scene);
        self.psnr_along(&self.measuring_rays(&field), &field)
    }

    /// PSNR of `field` on `rays`, in dB, with the exposures of the photographs.
    fn psnr_along(&self, rays: &RayBatch, field: &Field<f32>) -> f64 {
        rays.psnr(field, self.checkpoint.exposures.maps())
    }

    fn measuring_rays(&self, field: &Field<f32>) -> RayBatch {
        let count = self.ray_count().min(RAYS);
        RayBatch::draw(&self.sampler, field, &Random::new(self.config.seed, "measured"), 0, count)
    }

    /// Gives up what is of the least worth, in `round`: cells of a scale, or components.
    pub(super) fn give_up(&mut self, round: u32) {
        let config = self.config.lean.clone();
        let has_last_resolution = self.config.schedule.upsample_at.iter().all(|&at| at < self.checkpoint.step);
        let resolutions: Vec<[u32; 3]> = (self.field.scales.iter().zip(&self.config.scales))
            .map(|(scale, config)| match config.resolutions.last() {
                Some(&last) if !has_last_resolution => last,
                _ => scale.resolution,
            })
            .collect();
        let shared = self.backward.layout.len() as u64;
        let ranking = Ranking::new(&self.field, &self.checkpoint.worth, &resolutions, shared);
        let allowance = match (config.max_drop, self.checkpoint.psnr_at_start) {
            // A loss is kept by giving up less as it is approached, not by undoing rounds: undoing would need a
            // second scene in memory and in each checkpoint.
            (Some(most), Some(before)) => ALLOWED_SHARE * (most - (before - self.psnr())).max(0.0),
            _ => f64::INFINITY,
        };
        let gives_up_cells = has_last_resolution && allowance > 0.0 && lean::is_for_cells(round);
        if !(gives_up_cells && self.give_up_cells(&ranking, round)) {
            self.give_up_components(ranking.kept(&config, &self.field, round, allowance));
        }
        self.checkpoint.worth = Worth::none(&self.field);
    }

    /// Lowers the resolution of the scale that loses least by it, if that is better than giving up components of `ranking`.
    /// If it is the coarsest scale, the march's step grows with its cells.
    fn give_up_cells(&mut self, ranking: &Ranking, round: u32) -> bool {
        let rays = self.measuring_rays(&self.field);
        let before = self.psnr_along(&rays, &self.field);
        let mut best: Option<(f64, usize)> = None;
        for s in 0..self.field.scales.len() {
            let scale = &self.field.scales[s];
            let (from, to) = (scale.resolution, lean::fewer(scale.resolution));
            let saved_of = |block: &FieldFactors<f32>| {
                let share = 1.0 - block.form().rows(to) as f64 / block.form().rows(from) as f64;
                share * block.values().len() as f64
            };
            let saved = scale.blocks().map(saved_of).sum::<f64>() as u64;
            if saved == 0 {
                continue;
            }
            // Tried and taken back: what a resolution costs does not follow from gradients, since it moves all
            // factors at once.
            let kept = (self.field.scales[s].clone(), self.field.rules.step);
            self.set_cells(s, to);
            let rise = 10f64.powf(0.1 * (before - self.psnr_along(&rays, &self.field)));
            (self.field.scales[s], self.field.rules.step) = kept;
            self.scene.scales[s].cloud.resolution = from;
            let per_parameter = (rise - 1.0) / saved as f64;
            if ranking.is_worse_than(&self.config.lean, round, saved, rise)
                && best.is_none_or(|(least, _)| per_parameter < least)
            {
                best = Some((per_parameter, s));
            }
        }
        let Some((_, s)) = best else { return false };
        let from = self.field.scales[s].resolution;
        let to = lean::fewer(from);
        let scale = &self.field.scales[s];
        for (moments, block) in self.checkpoint.factors[s].iter_mut().zip(scale.blocks()) {
            for moments in [&mut moments.first, &mut moments.second] {
                // Moments are resampled along, so that the optimizer does not start anew.
                let resample = |values: &[f32], rank| upsample(block.form(), values, rank, from, to);
                let resampled = block.held().resampled(moments, resample);
                *moments = resampled.flatten().collect();
            }
        }
        self.set_cells(s, to);
        self.scene.rules.step = self.field.rules.step;
        true
    }

    /// Gives the tensors of scale `s` the resolution `to`, with the march's step for it. The scene keeps its step.
    fn set_cells(&mut self, s: usize, to: [u32; 3]) {
        let cloud = &mut self.scene.scales[s].cloud;
        let step = |cloud: &_| march_step(cloud, self.config.model.step);
        let (from, before) = (cloud.resolution, step(cloud));
        cloud.resolution = to;
        if s == 0 {
            self.field.rules.step *= step(cloud) / before;
        }
        self.field.scales[s].set_resolution(cloud, |form, factors, rank| upsample(form, factors, rank, from, to));
    }

    /// Gives up all components but those of `kept`, \[scale\]\[block\].
    fn give_up_components(&mut self, kept: Vec<Vec<Kept>>) {
        let Checkpoint { factors, networks, .. } = &mut self.checkpoint;
        let width = self.field.component_count();
        let mut first = 0;
        for (s, kept) in kept.into_iter().enumerate() {
            let scale = &mut self.field.scales[s];
            let of_density = scale.density.len();
            for (b, ((block, moments), Kept { held, order })) in
                scale.blocks_mut().zip(&mut factors[s]).zip(kept).enumerate()
            {
                moments.rearrange(block.held(), &held, &order);
                block.rearrange(held, &order);
                // Density components are a sum, in any order. Appearance components are columns of the matrix, which
                // move along.
                if b < of_density {
                    continue;
                }
                let columns = first..first + order.len();
                first = columns.end;
                let matrices = &mut self.field.decoder.appearance;
                let end = matrices.len();
                for matrices in [&mut matrices[..], &mut networks.first[..end], &mut networks.second[..end]] {
                    for row in matrices.chunks_exact_mut(width) {
                        let old = row[columns.clone()].to_vec();
                        row[columns.clone()].iter_mut().zip(&order).for_each(|(new, &c)| *new = old[c as usize]);
                    }
                }
            }
        }
    }
}

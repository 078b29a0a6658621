//! The changes that the schedule has between steps.

use glam::DVec3;

use super::trainer::check_active_rays;
use super::{
    FinishConfig, TrainError, Trainer, estimate_occupancy, march_step, poses, prune_unoccupied, tight_occupancy,
    upsample,
};
use strivec_field::Field;
use strivec_format::geometry::Aabb;
use strivec_format::model::Occupancy;
use strivec_format::random::Random;

impl Trainer<'_> {
    /// Components, occupancy, bounds and resolution (paper, Implementation).
    pub(super) fn follow_schedule(&mut self) -> Result<(), TrainError> {
        let step = self.checkpoint.step;
        if let Some(round) = self.config.lean.round_after(step, self.config.schedule.steps) {
            self.give_up(round);
        }
        let cell = self.scene.scales[0].cloud.cell_size();
        let update = self.config.schedule.occupancy_at.iter().position(|&at| at == step);
        let from = self.config.finish.from;
        let is_late = from < 1.0 && step as f64 >= from * self.config.schedule.steps as f64;
        let is_finished = update.is_some() && is_late && self.finish(cell);
        // A run that has the march of the end from its start began with a trained scene, whose occupancy may be tight.
        let is_kept = from == 0.0 && self.scene.occupancy.is_some();
        if let Some(which) = update.filter(|_| !is_finished && !is_kept) {
            let occupancy = estimate_occupancy(&self.field, cell);
            let dense = extent(&occupancy);
            // In very short runs no cell is dense yet: they continue without an occupancy.
            if dense.is_solid() {
                // The bounds of contracted space are those of all space.
                if which == 0 && self.scene.rules.contraction.is_none() {
                    self.scene.bounds = dense;
                }
                self.set_occupancy(Some(occupancy));
                self.drop_unoccupied();
            }
        }
        let stage = self.config.schedule.upsample_at.iter().filter(|&&at| at <= step).count();
        if self.config.schedule.upsample_at.contains(&step) {
            for ((scale, config), trained) in
                self.scene.scales.iter_mut().zip(&self.config.scales).zip(&mut self.field.scales)
            {
                let (from, to) = (trained.resolution, config.resolutions[stage]);
                scale.cloud.resolution = to;
                trained.set_resolution(&scale.cloud, |form, factors, rank| upsample(form, factors, rank, from, to));
            }
            self.scene.rules.step = march_step(&self.scene.scales[0].cloud, self.config.model.step);
            self.field.rules.step = self.scene.rules.step;
            self.checkpoint.restart(&self.field);
        }
        if self.config.poses.is_on() && poses::is_due(step, self.config.schedule.steps) {
            let random = Random::new(self.config.seed, "poses").substream(step);
            let maps = self.checkpoint.exposures.maps();
            let distance = match self.scene.rules.contraction {
                None => 0.5 * (self.scene.frame.near + self.scene.frame.far),
                Some(_) => 1.0,
            };
            let growing = self.config.poses.refine_focal_length;
            let cameras = poses::refined(&self.field, &self.sampler, maps, distance, growing, &random);
            self.checkpoint.cameras = cameras.iter().map(|camera| (camera.pose(), camera.focal)).collect();
            self.sampler.set_cameras(cameras);
        }
        // At the first estimate a third of the drawn rays turn out to meet nothing: filtering anew gains 0.3 to 0.5
        // dB (docs/experiments/2026-11-21-training-settings.md, docs/experiments/2026-11-22-lego-800.md).
        if self.config.sampling.refilter_rays && update.is_some() {
            self.sampler.filter_rays(&self.field);
            check_active_rays(&self.sampler)?;
            self.checkpoint.active_rays = self.sampler.active_ray_mask();
        }
        Ok(())
    }

    /// Continues with another occupancy.
    fn set_occupancy(&mut self, occupancy: Option<Occupancy>) {
        self.scene.occupancy = occupancy;
        self.field.set_space(&self.scene);
    }

    /// Removes the tensors that meet no occupied cell, if the settings enable it.
    fn drop_unoccupied(&mut self) {
        if self.config.schedule.prune {
            let mut scene = self.scene();
            let kept = prune_unoccupied(&mut scene);
            self.checkpoint.keep_tensors(&kept, &self.field);
            self.field = Field::unlimited_from_scene(&mut scene);
            self.scene = scene;
        }
    }

    /// Continues with the march of the end, in cells of about `cell`, unless that costs too much. Returns true if there is
    /// another occupancy.
    fn finish(&mut self, cell: DVec3) -> bool {
        let FinishConfig { min_transmittance, min_weight, min_alpha, max_loss, .. } = self.config.finish;
        let (before, old) = (self.psnr(), (self.scene.rules.clone(), self.scene.occupancy.clone()));
        let rules = &mut self.scene.rules;
        (rules.min_transmittance, rules.min_weight) = (min_transmittance, min_weight);
        self.field.rules = rules.clone();
        let tight = (min_alpha > 0.0).then(|| tight_occupancy(&self.field, cell, min_alpha));
        let (has_occupancy, is_solid) = (tight.is_some(), tight.iter().all(|tight| extent(tight).is_solid()));
        if has_occupancy && is_solid {
            self.set_occupancy(tight);
        }
        // A scene that is still faint lost 0.7 dB without this check
        // (docs/experiments/2026-11-25-march-of-the-end.md).
        let is_affordable = is_solid && before - self.psnr() <= max_loss;
        if is_affordable {
            self.drop_unoccupied();
        } else {
            let (rules, occupancy) = old;
            (self.scene.rules, self.field.rules) = (rules.clone(), rules);
            self.set_occupancy(occupancy);
        }
        has_occupancy && is_affordable
    }
}

/// The box of the occupied vertices.
fn extent(occupancy: &Occupancy) -> Aabb {
    Aabb::from_points(occupancy.iter().map(|vertex| occupancy.position(vertex)))
}

//! The end of a run for a file that holds integers (`train/rounding.rs`).

use super::network_rounding::UnroundedNetworks;
use super::rounding::Unrounded;
use super::shrink::tuned;
use super::{Checkpoint, PoseConfig, Rounding, Trainer};
use strivec_field::FieldScale;
use strivec_format::container::NetworkSteps;
use strivec_format::model::Scene;

/// The share of the steps at the end over which learning rates fall to 0.
const COOLDOWN: f64 = 0.5;
/// The share of the steps after which matrices and decoder are rounded too.
/// From the first step on is no better (docs/experiments/2026-11-27-rounded-networks.md).
const NETWORKS_FROM: f64 = 0.5;

impl Checkpoint {
    /// True while matrices and decoder are rounded.
    pub(super) fn rounds_networks(&self) -> bool {
        self.rounding.is_some() && self.step as f64 >= NETWORKS_FROM * self.config.schedule.steps as f64
    }
}

impl Trainer<'_> {
    /// Continues with `scene`, of the same photographs, for `steps` more in which factors are rounded: \[scale\]\[block\] `codes`
    /// are those of the steps, \[tensor\]\[component\]. The loss of a `bit` may change on the way from
    /// the bytes at the `start` to the `goal`. Nothing is given up or refined any more.
    pub fn begin_rounding(
        &mut self,
        scene: Scene,
        codes: &[Vec<Vec<u8>>],
        bit: f64,
        [start, goal]: [u64; 2],
        steps: u64,
    ) {
        // Steps and components are chosen once: rounds that choose anew restart the optimizer, and lose more than
        // they gain (docs/experiments/2026-11-27-trained-for-size.md).
        self.config = tuned(&self.config, &scene, steps);
        (self.config.optimizer.cooldown, self.config.poses) = (COOLDOWN, PoseConfig::default());
        self.restart_from(scene, steps);
        let of_scale = |(scale, codes): (&FieldScale<f32>, &Vec<Vec<u8>>)| {
            scale.blocks().zip(codes).map(|(block, codes)| Rounding::of_held(block.held(), codes)).collect()
        };
        let codes: Vec<_> = self.field.scales.iter().zip(codes).map(of_scale).collect();
        self.unrounded = Some(Unrounded::from_field(&mut self.field, &codes));
        self.checkpoint.rounding = Some(Rounding { codes, bit, first_bit: bit, goal, start });
    }

    /// How factors are rounded, if they are.
    pub fn rounding(&self) -> Option<&Rounding> {
        self.checkpoint.rounding.as_ref()
    }

    /// How factors are rounded, if they are, to change the loss of a bit.
    pub fn rounding_mut(&mut self) -> Option<&mut Rounding> {
        self.checkpoint.rounding.as_mut()
    }

    /// \[scale\]\[block\] the codes of the steps, \[tensor\]\[component\]; empty if factors are not rounded.
    pub fn step_codes(&self) -> Vec<Vec<Vec<u8>>> {
        let codes = self.rounding().map_or(&[][..], |rounding| &rounding.codes);
        let of_scale = |(scale, codes): (&FieldScale<f32>, &Vec<Vec<u8>>)| {
            scale.blocks().zip(codes).map(|(block, codes)| Rounding::of_all(block.held(), codes)).collect()
        };
        self.field.scales.iter().zip(codes).map(of_scale).collect()
    }

    /// The codes of the steps of matrices and decoder; none if they are not rounded.
    pub fn network_steps(&self) -> NetworkSteps {
        self.unrounded_networks.as_ref().map(UnroundedNetworks::steps).unwrap_or_default()
    }

    /// The scene that a checkpoint holds: [`Trainer::scene`] before its factors, matrices and decoder are rounded.
    pub fn unrounded_scene(&self) -> Scene {
        let mut decoder = self.field.decoder.clone();
        if let Some(networks) = &self.unrounded_networks {
            networks.write(&mut decoder);
        }
        let mut scene = self.scene_with(&decoder);
        let factors = self.unrounded.iter().flat_map(|unrounded| unrounded.factors());
        for ((scale, trained), factors) in scene.scales.iter_mut().zip(&self.field.scales).zip(factors) {
            for ((block, trained), values) in scale.factors.blocks_mut().zip(trained.blocks()).zip(factors) {
                block.values = trained.held().dense(values);
            }
        }
        scene
    }
}

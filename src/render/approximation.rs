//! Named ways to trade a picture's exactness for speed. None is taken unless asked for.

use super::components::keep_components;
use crate::model::{DecoderMode, Scene};

/// What a renderer may leave out. The default leaves out nothing: the picture is the reference's, within tolerance.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Approximation {
    /// Neighbors that a point aggregates in a scale at most; those of the scene where there is none.
    pub neighbors: Option<u32>,
    /// How many scales are used, the coarsest first; all where there is none.
    pub scales: Option<u32>,
    /// The share of each tensor's components that are used, the largest; all where there is none.
    pub components: Option<f64>,
    /// Steps are longer than the scene's by this factor; each then stands for its longer interval.
    pub step_scale: f64,
    /// Samples of at most this weight add no color; the scene's where there is none.
    pub min_weight: Option<f64>,
    /// Rays end where their transmittance falls below this; the scene's where there is none.
    pub min_transmittance: Option<f64>,
    /// Where the decoder is called; as the scene was trained where there is none.
    pub decoder: Option<DecoderMode>,
    /// Density features are baked on a grid of so many cells along the longest edge of the bounds, and interpolated
    /// between its vertices.
    pub density_cache: Option<u32>,
}

impl Default for Approximation {
    fn default() -> Self {
        Self {
            neighbors: None,
            scales: None,
            components: None,
            step_scale: 1.0,
            min_weight: None,
            min_transmittance: None,
            decoder: None,
            density_cache: None,
        }
    }
}

/// The first option of an approximation that makes no sense for a scene.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("approximation {option}: expected {expected}, found {found}")]
pub struct ApproximationError {
    /// Which option.
    pub option: &'static str,
    /// What it should be.
    pub expected: String,
    /// What it is.
    pub found: String,
}

impl Approximation {
    /// Whether nothing is left out.
    pub fn is_exact(&self) -> bool {
        *self == Self::default()
    }

    /// Checks every option against `scene`.
    ///
    /// # Errors
    ///
    /// Names the first that is out of range.
    pub fn check(&self, scene: &Scene) -> Result<(), ApproximationError> {
        let most_neighbors = scene.scales.iter().map(|s| s.top_k).max().unwrap_or(0);
        for (option, value, [least, most]) in [
            ("neighbors", self.neighbors, [1, most_neighbors]),
            ("scales", self.scales, [1, scene.scales.len() as u32]),
            ("density_cache", self.density_cache, [8, 2048]),
        ] {
            if let Some(found) = value.filter(|v| !(least..=most).contains(v)) {
                let expected = format!("{least} to {most}");
                return Err(ApproximationError { option, expected, found: found.to_string() });
            }
        }
        if let Some(mode) = self.decoder.filter(|mode| scene.features() < mode.min_features()) {
            let expected = format!("another mode: {} needs {} features", mode.name(), mode.min_features());
            return Err(ApproximationError { option: "decoder", expected, found: scene.features().to_string() });
        }
        let fraction = |v: f64| (0.0..1.0).contains(&v);
        for (option, value, valid, expected) in [
            ("step_scale", Some(self.step_scale), (0.25..=64.0).contains(&self.step_scale), "0.25 to 64"),
            ("min_weight", self.min_weight, self.min_weight.is_none_or(fraction), "a number in [0, 1)"),
            (
                "components",
                self.components,
                self.components.is_none_or(|share| share > 0.0 && share <= 1.0),
                "a number in (0, 1]",
            ),
            (
                "min_transmittance",
                self.min_transmittance,
                self.min_transmittance.is_none_or(fraction),
                "a number in [0, 1)",
            ),
        ] {
            if let Some(found) = value.filter(|_| !valid) {
                return Err(ApproximationError { option, expected: expected.into(), found: found.to_string() });
            }
        }
        Ok(())
    }

    /// `scene`, which must have passed [`Scene::check`] and [`Self::check`], with everything left out that is a part of scenes: all but the
    /// density cache.
    pub fn applied(&self, mut scene: Scene) -> Scene {
        self.reduce(&mut scene);
        scene
    }

    /// `scene` with everything left out that is a part of scenes: all but the density cache.
    pub(super) fn reduce(&self, scene: &mut Scene) {
        if let Some(scales) = self.scales {
            scene.scales.truncate(scales as usize);
        }
        for scale in &mut scene.scales {
            scale.top_k = self.neighbors.map_or(scale.top_k, |n| n.min(scale.top_k));
            if let Some(share) = self.components {
                keep_components(scale, share);
            }
        }
        let rules = &mut scene.rules;
        rules.step *= self.step_scale;
        rules.min_weight = self.min_weight.unwrap_or(rules.min_weight);
        rules.min_transmittance = self.min_transmittance.unwrap_or(rules.min_transmittance);
        scene.decoder.mode = self.decoder.unwrap_or(scene.decoder.mode);
    }
}

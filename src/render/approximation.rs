//! Named ways to trade a picture's exactness for speed. None is taken unless asked for.

use serde::{Deserialize, Serialize};

use crate::model::{DecoderMode, Factors, Scene};

/// What a renderer may leave out. The default leaves out nothing: the picture is the reference's, within tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Approximation {
    /// Neighbours that a point aggregates in a scale at most; those of the scene where there is none.
    pub neighbours: Option<u32>,
    /// How many scales are used, the coarsest first; all where there is none.
    pub scales: Option<u32>,
    /// Steps are longer than the scene's by this factor; each then stands for its longer interval.
    pub step_scale: f64,
    /// Samples of at most this weight add no colour; the scene's where there is none.
    pub min_weight: Option<f64>,
    /// Rays end where their transmittance falls below this; the scene's where there is none.
    pub min_transmittance: Option<f64>,
    /// Whether the decoder is called once a ray, on composited features; as the scene was trained where there is none.
    pub per_ray: Option<bool>,
    /// Density components of each tensor at most, the strongest; all where there is none.
    pub density_components: Option<u32>,
    /// Density features are baked on a grid of so many cells along the longest edge of the bounds, and interpolated
    /// between its vertices.
    pub density_cache: Option<u32>,
}

impl Default for Approximation {
    fn default() -> Self {
        Self {
            neighbours: None,
            scales: None,
            step_scale: 1.0,
            min_weight: None,
            min_transmittance: None,
            per_ray: None,
            density_components: None,
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
        let most = |of: fn(&crate::model::Scale) -> u32| scene.scales.iter().map(of).max().unwrap_or(0);
        for (option, value, [least, most]) in [
            ("neighbours", self.neighbours, [1, most(|s| s.top_k)]),
            ("scales", self.scales, [1, scene.scales.len() as u32]),
            ("density_components", self.density_components, [1, most(|s| s.factors.density_rank)]),
            ("density_cache", self.density_cache, [8, 2048]),
        ] {
            if let Some(found) = value.filter(|v| !(least..=most).contains(v)) {
                let expected = format!("{least} to {most}");
                return Err(ApproximationError { option, expected, found: found.to_string() });
            }
        }
        let fraction = |v: f64| (0.0..1.0).contains(&v);
        for (option, value, valid, expected) in [
            ("step_scale", Some(self.step_scale), (0.25..=64.0).contains(&self.step_scale), "0.25 to 64"),
            ("min_weight", self.min_weight, self.min_weight.is_none_or(fraction), "a number in [0, 1)"),
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

    /// `scene` with everything left out that is a part of scenes: all but the density cache.
    pub(super) fn reduce(&self, scene: &mut Scene) {
        if let Some(scales) = self.scales {
            scene.scales.truncate(scales as usize);
        }
        for scale in &mut scene.scales {
            scale.top_k = self.neighbours.map_or(scale.top_k, |n| n.min(scale.top_k));
            if let Some(components) = self.density_components {
                keep_strongest(&mut scale.factors, scale.cloud.resolution, components);
            }
        }
        let rules = &mut scene.rules;
        rules.step *= self.step_scale;
        rules.min_weight = self.min_weight.unwrap_or(rules.min_weight);
        rules.min_transmittance = self.min_transmittance.unwrap_or(rules.min_transmittance);
        scene.decoder.mode = match self.per_ray {
            None => scene.decoder.mode,
            Some(true) => DecoderMode::PerRay,
            Some(false) => DecoderMode::PerSample,
        };
    }
}

/// Leaves each tensor the `count` density components whose products of the axes' norms are largest, in their order.
fn keep_strongest(factors: &mut Factors, resolution: [u32; 3], count: u32) {
    let (rank, count) = (factors.density_rank as usize, count as usize);
    if count >= rank {
        return;
    }
    let first_rows = Factors::axis_rows(resolution);
    let rows = Factors::rows(resolution);
    let axes = [0..first_rows[1], first_rows[1]..first_rows[2], first_rows[2]..rows];
    let mut kept = Vec::with_capacity(factors.density.len() / rank * count);
    for tensor in factors.density.chunks_exact(rows * rank) {
        let value = |row: usize, component: usize| f64::from(tensor[row * rank + component]);
        let norm = |axis: &std::ops::Range<usize>, c: usize| axis.clone().map(|row| value(row, c).powi(2)).sum::<f64>();
        let strength: Vec<f64> = (0..rank).map(|c| axes.iter().map(|axis| norm(axis, c)).product()).collect();
        let mut strongest: Vec<usize> = (0..rank).collect();
        strongest.sort_by(|&a, &b| strength[b].total_cmp(&strength[a]));
        strongest.truncate(count);
        strongest.sort_unstable();
        for row in tensor.chunks_exact(rank) {
            kept.extend(strongest.iter().map(|&component| row[component]));
        }
    }
    factors.density = kept;
    factors.density_rank = count as u32;
}

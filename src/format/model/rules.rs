//! The rules of the field and the march (spec 3.2).

use glam::DVec3;

use super::sky::Sky;
use crate::Invalid;
use crate::digits::number;
use crate::geometry::{Aabb, Contraction, MAX_SPACING};

/// Most samples of a ray: with a tiny step the march would take forever.
pub const MAX_STEPS: u64 = 1_048_576;

/// The condition for a point to be in the model (spec 4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Coverage {
    /// Every scale covers the point.
    All,
    /// At least one scale covers the point.
    Any,
}

/// The combination of the scales that cover a point (spec 4.5 and 4.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Reduction {
    /// Their sum, which reproduces the results of the paper.
    Sum,
    /// Their mean, as in the text of the paper (3.3).
    Mean,
}

/// The weights of the neighbors within a scale (spec 4.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Aggregation {
    /// 1/d over the sum of 1/d; at d = 0 that tensor alone.
    Normalized,
    /// 1/(d + 1e-6) over max(sum of 1/(d + 1e-6), 1): the authors' code.
    Clamped,
}

/// The rules of the field and the march (spec 3.2 and 4).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Rules {
    /// The condition for a point to be in the model.
    pub coverage: Coverage,
    /// The weights of neighbors.
    pub aggregation: Aggregation,
    /// The combination of the scales' density features.
    pub density_reduction: Reduction,
    /// The combination of the scales' appearance features.
    pub appearance_reduction: Reduction,
    /// Added to the density feature before the softplus (spec 4.5).
    pub density_shift: f64,
    /// Multiplies σ·δ in the opacity of a sample (spec 4.8); per model unit.
    pub distance_scale: f64,
    /// δ, the distance between samples, in model units.
    pub step: f64,
    /// The march ends after a sample that leaves the transmittance below this.
    pub min_transmittance: f64,
    /// Samples of at most this visibility weight are not shaded.
    pub min_weight: f64,
    /// The contraction of an unbounded scene (spec 4.9): tensors and occupancy are in the contracted space, cameras and
    /// distances are not. `None`: rays march straight through the bounds.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub contraction: Option<Contraction>,
    /// The color behind the scene by direction (spec 4.11). `None`: the background of the frame.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub sky: Option<Sky>,
}

impl Rules {
    /// The optical depth σ·δ·distance_scale of a sample of density `sigma` (spec 4.8).
    pub fn optical_depth(&self, sigma: f64) -> f64 {
        sigma * self.step * self.distance_scale
    }

    /// `point` as tensors and occupancy see it: contracted if the scene is (spec 4.9).
    #[inline(always)]
    pub fn contracted(&self, point: DVec3) -> DVec3 {
        self.contraction.map_or(point, |contraction| contraction.contract(point))
    }

    /// The smallest box of tensors' space that contains the box `within` of model space.
    pub fn contracted_box(&self, within: &Aabb) -> Aabb {
        self.contraction.map_or(*within, |contraction| contraction.contract_box(within))
    }

    /// `bounds` of a scene of which only the box `within` of model space is kept. Those of a contracted scene stay.
    pub fn cropped_bounds(&self, bounds: &Aabb, within: &Aabb) -> Aabb {
        if self.contraction.is_some() { *bounds } else { bounds.intersection(within) }
    }

    /// The most samples of a ray in a scene of these `bounds`, not rounded (spec 5).
    pub fn most_steps(&self, bounds: &Aabb) -> f64 {
        self.longest_path(bounds) / self.step
    }

    /// The largest difference of two samples' parameters on a ray, in a scene of these `bounds` (spec 4.8 and 4.9).
    fn longest_path(&self, bounds: &Aabb) -> f64 {
        if self.contraction.is_some() { 2.0 * MAX_SPACING } else { bounds.size().length() }
    }

    /// Checks every rule against its range in spec 5, for a scene of these `bounds`.
    ///
    /// # Errors
    ///
    /// The first rule that is out of range.
    pub fn check(&self, bounds: &Aabb) -> Result<(), Invalid> {
        if !bounds.is_solid() {
            return Err(Invalid::new("bounds", "a finite box of positive size", bounds));
        }
        if let Some(contraction) = self.contraction {
            if !(contraction.shell > 0.0 && contraction.shell <= 1.0) {
                let expected = "a number more than 0, at most 1";
                return Err(Invalid::new("rules contraction's shell", expected, number(contraction.shell)));
            }
            if *bounds != contraction.bounds() {
                return Err(Invalid::new("bounds", contraction.bounds(), bounds));
            }
        }
        self.sky.as_ref().map_or(Ok(()), Sky::check)?;
        let positive = |v: f64| v > 0.0 && v.is_finite();
        let fraction = |v: f64| (0.0..1.0).contains(&v);
        for (name, value, valid, expected) in [
            ("density_shift", self.density_shift, self.density_shift.is_finite(), "a finite number"),
            ("distance_scale", self.distance_scale, positive(self.distance_scale), "a positive number"),
            ("step", self.step, positive(self.step), "a positive number"),
            ("min_transmittance", self.min_transmittance, fraction(self.min_transmittance), "a number in [0, 1)"),
            ("min_weight", self.min_weight, fraction(self.min_weight), "a number in [0, 1)"),
        ] {
            if !valid {
                return Err(Invalid::new(format!("rules {name}"), expected, number(value)));
            }
        }
        Ok(())
    }
}

//! The choices that fix how a scene's numbers become a field and a field becomes a picture.

use super::BrokenInvariant;

/// Which points are in the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Coverage {
    /// Those that every scale covers.
    All,
    /// Those that at least one scale covers.
    Any,
}

/// How the scales that cover a point are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Reduction {
    /// Added up (what gave the paper's numbers).
    Sum,
    /// Averaged (the paper's text, section "Multi-scale tri-vector fields").
    Mean,
}

/// How the neighbors within a scale are weighed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Aggregation {
    /// 1/d over the sum of 1/d; at d = 0 that tensor alone.
    Normalized,
    /// 1/(d + 1e-6) over max(sum of 1/(d + 1e-6), 1): the authors' code.
    Clamped,
}

/// The field's and the march's rules (DESIGN, section 2).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Rules {
    /// Which points are in the model.
    pub coverage: Coverage,
    /// How neighbors are weighed.
    pub aggregation: Aggregation,
    /// How the scales' density features combine.
    pub density_reduction: Reduction,
    /// How the scales' appearance features combine.
    pub appearance_reduction: Reduction,
    /// Added to the density feature before the softplus.
    pub density_shift: f64,
    /// Multiplies σ·δ in α; per model unit.
    pub distance_scale: f64,
    /// δ, the march's step, in model units.
    pub step: f64,
    /// The march stops after the sample that takes the transmittance below this.
    pub min_transmittance: f64,
    /// Samples of at most this weight add no color.
    pub min_weight: f64,
}

impl Rules {
    pub(super) fn check(&self) -> Result<(), BrokenInvariant> {
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
                return Err(BrokenInvariant::new(format!("rules {name}"), expected, value));
            }
        }
        Ok(())
    }
}

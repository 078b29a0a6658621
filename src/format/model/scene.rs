//! The whole scene and its invariants.

use super::decoder::Decoder;
use super::frame::Frame;
use super::memory::MemoryLimit;
use super::occupancy::Occupancy;
use super::provenance::Provenance;
use super::rules::{MAX_STEPS, Rules};
use super::scale::Scale;
use crate::Invalid;
use crate::digits::number;
use crate::geometry::Aabb;

/// A trained scene, frozen.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The map from dataset space, near and far, background.
    pub frame: Frame,
    /// The box that rays march through, in model units (part of RULES in files, spec 3.2).
    pub bounds: Aabb,
    /// The rules of the field and the march.
    pub rules: Rules,
    /// Coarsest first, at least one.
    pub scales: Vec<Scale>,
    /// From appearance features to colors.
    pub decoder: Decoder,
    /// The region in which samples count; `None` if they count everywhere in the model.
    pub occupancy: Option<Occupancy>,
    /// The origin of the scene.
    pub provenance: Provenance,
    /// The most memory that a field of the scene may take; not part of files.
    pub memory: MemoryLimit,
}

impl Scene {
    /// P, the length of the appearance feature vector.
    pub fn features(&self) -> u32 {
        self.scales.first().map_or(0, |s| s.appearance_matrix.features)
    }

    /// Number of trained parameters: factors, appearance matrices, decoder, sky.
    pub fn parameter_count(&self) -> u64 {
        self.scales.iter().map(Scale::parameter_count).sum::<u64>() + self.shared_parameter_count()
    }

    /// Number of trained parameters without components that are zero, which files leave out.
    pub fn nonzero_parameter_count(&self) -> u64 {
        self.scales.iter().map(Scale::nonzero_parameter_count).sum::<u64>() + self.shared_parameter_count()
    }

    /// Number of trained parameters of the decoder and of the sky.
    fn shared_parameter_count(&self) -> u64 {
        self.decoder.parameter_count() + self.rules.sky.as_ref().map_or(0, |sky| sky.coefficients.len() as u64)
    }

    /// Bytes of memory that the scene takes, but for some hundreds.
    pub fn memory_bytes(&self) -> u64 {
        let of_scale = |scale: &Scale| 4 * scale.parameter_count() + 24 * scale.cloud.len() as u64;
        let occupancy = self.occupancy.as_ref().map_or(0, |occupancy| 8 * occupancy.words.len() as u64);
        self.scales.iter().map(of_scale).sum::<u64>() + 4 * self.decoder.parameter_count() + occupancy
    }

    /// Checks every invariant that readers, renderers and the trainer rely on.
    ///
    /// # Errors
    ///
    /// If an invariant does not hold. The error names the first one.
    ///
    /// # Examples
    ///
    /// ```
    /// let bytes = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/smallest.strivec"));
    /// let mut scene = strivec_format::container::decode(bytes)?;
    /// assert_eq!(scene.check(), Ok(()));
    ///
    /// scene.scales[0].top_k = 0;
    /// assert_eq!(scene.check().unwrap_err().place.to_string(), "scale 0 top_k");
    /// # Ok::<(), strivec_format::container::Error>(())
    /// ```
    pub fn check(&self) -> Result<(), Invalid> {
        self.check_given(false)
    }

    /// Checks the invariants like [`Scene::check`]. If `has_finite_factors` is true, the factors are not searched for
    /// numbers that are not finite, which takes long.
    pub fn check_given(&self, has_finite_factors: bool) -> Result<(), Invalid> {
        self.frame.check()?;
        self.rules.check(&self.bounds)?;
        let steps = self.rules.most_steps(&self.bounds);
        if steps > MAX_STEPS as f64 {
            let expected = format!("long enough for at most {MAX_STEPS} steps on a ray");
            return Err(Invalid::new("rules step", expected, format!("{} steps", number(steps))));
        }
        if self.scales.is_empty() {
            return Err(Invalid::new("number of scales", "at least 1", 0));
        }
        for (i, scale) in self.scales.iter().enumerate() {
            scale.check(&format!("scale {i}"), self.features(), has_finite_factors)?;
        }
        self.decoder.check(self.features())?;
        self.occupancy.as_ref().map_or(Ok(()), Occupancy::check)
    }
}

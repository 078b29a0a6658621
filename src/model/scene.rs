//! The whole scene and its invariants.

use std::fmt::Display;

use super::{Decoder, Frame, Occupancy, Provenance, Rules, Scale};
use crate::geometry::Aabb;

/// Samples that a ray may take at most: a step out of all proportion to the bounds would never end.
const MAX_SAMPLES: f64 = 1_048_576.0;

/// A trained scene, frozen.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// How it sits in the dataset's space.
    pub frame: Frame,
    /// Where rays march, in model units.
    pub bounds: Aabb,
    /// How numbers become a field and a picture.
    pub rules: Rules,
    /// Coarsest first, at least one.
    pub scales: Vec<Scale>,
    /// From features to color.
    pub decoder: Decoder,
    /// Where samples count; everywhere in the model where there is none.
    pub occupancy: Option<Occupancy>,
    /// What made it.
    pub provenance: Provenance,
}

/// The first invariant that a scene breaks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: expected {expected}, found {found}")]
pub struct BrokenInvariant {
    /// Which part of the scene.
    pub place: String,
    /// What it should be.
    pub expected: String,
    /// What it is.
    pub found: String,
}

impl BrokenInvariant {
    pub(super) fn new(place: impl Into<String>, expected: impl Display, found: impl Display) -> Self {
        Self { place: place.into(), expected: expected.to_string(), found: found.to_string() }
    }

    pub(super) fn unless_equal<T: PartialEq + Display>(
        place: impl FnOnce() -> String,
        expected: T,
        found: T,
    ) -> Result<(), Self> {
        if expected == found { Ok(()) } else { Err(Self::new(place(), expected, found)) }
    }

    pub(super) fn unless_finite(place: impl FnOnce() -> String, values: &[f32]) -> Result<(), Self> {
        match values.iter().position(|v| !v.is_finite()) {
            None => Ok(()),
            Some(i) => Err(Self::new(format!("{} entry {i}", place()), "a finite number", values[i])),
        }
    }
}

impl Scene {
    /// P, the length of the appearance feature vector.
    pub fn features(&self) -> u32 {
        self.scales.first().map_or(0, |s| s.appearance_matrix.features)
    }

    /// Number of trained parameters: factors, appearance matrices, decoder.
    pub fn parameter_count(&self) -> u64 {
        self.scales.iter().map(Scale::parameter_count).sum::<u64>() + self.decoder.parameter_count()
    }

    /// The same without components of tensors that are zeros, which files leave out.
    pub fn held_parameter_count(&self) -> u64 {
        self.scales.iter().map(Scale::held_parameter_count).sum::<u64>() + self.decoder.parameter_count()
    }

    /// Checks every invariant that readers, renderers and the trainer rely on.
    ///
    /// # Errors
    ///
    /// Names the first that does not hold.
    pub fn check(&self) -> Result<(), BrokenInvariant> {
        self.frame.check()?;
        if !self.bounds.is_solid() {
            let found = format!("{:?}", self.bounds);
            return Err(BrokenInvariant::new("bounds", "a finite box of positive size", found));
        }
        self.rules.check()?;
        let samples = self.bounds.size().length() / self.rules.step;
        if samples > MAX_SAMPLES {
            return Err(BrokenInvariant::new(
                "rules step",
                format!("at most {MAX_SAMPLES} steps across the bounds"),
                samples,
            ));
        }
        if self.scales.is_empty() {
            return Err(BrokenInvariant::new("scales", "at least one", "none"));
        }
        for (i, scale) in self.scales.iter().enumerate() {
            scale.check(&format!("scale {i}"), self.features())?;
        }
        self.decoder.check(self.features())?;
        self.occupancy.as_ref().map_or(Ok(()), Occupancy::check)
    }
}

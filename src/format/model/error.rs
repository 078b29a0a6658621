//! The error of [`Scene::check`](super::Scene::check).

use std::fmt::Display;

/// The first invariant that a scene breaks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place} must be {expected}; found {found}")]
pub struct BrokenInvariant {
    /// The part of the scene.
    pub place: String,
    /// The values that are allowed.
    pub expected: String,
    /// The value that was found.
    pub found: String,
}

impl BrokenInvariant {
    pub(super) fn new(place: impl Into<String>, expected: impl Display, found: impl Display) -> Self {
        Self { place: place.into(), expected: expected.to_string(), found: found.to_string() }
    }

    /// An error unless both are equal.
    pub(super) fn unless_equal<T: PartialEq + Display>(
        place: impl FnOnce() -> String,
        expected: T,
        found: T,
    ) -> Result<(), Self> {
        if expected == found { Ok(()) } else { Err(Self::new(place(), expected, found)) }
    }

    /// An error unless all `values` are finite.
    pub(super) fn unless_finite(place: impl FnOnce() -> String, values: &[f32]) -> Result<(), Self> {
        // In vector registers, which a search that may end at each value is not.
        if values.iter().fold(true, |all, v| all & v.is_finite()) {
            return Ok(());
        }
        match values.iter().position(|v| !v.is_finite()) {
            None => Ok(()),
            Some(i) => Err(Self::new(format!("{} entry {i}", place()), "a finite number", values[i])),
        }
    }
}

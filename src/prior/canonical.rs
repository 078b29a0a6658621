//! The map from any dataset's space to the model's canonical box.

use glam::DQuat;

use super::Error;
use crate::geometry::{Aabb, Similarity};

/// Half the largest extent of a mapped scene, in model units: that of the scenes the presets were made for.
pub const CANONICAL_HALF_EXTENT: f64 = 1.2;
/// A scene is left where it is if it already fits the canonical box within this factor.
pub const CANONICAL_TOLERANCE: f64 = 1.5;

/// The map that brings `bounds`, those of a prior in the dataset's space, to the canonical box: centre 0, largest half
/// extent 1.2. It scales all axes alike and never rotates, so lattices stay upright.
///
/// It is the identity exactly where `bounds` lies within ±1.8 (1.2·1.5) on every axis and its largest half extent is at
/// least 0.8 (1.2/1.5): pitches are per model unit, so a scene that was made for them keeps its own units. Outside
/// that band the model does not depend on the dataset's unit or origin.
///
/// # Errors
///
/// If `bounds` is empty, flat or not finite.
pub fn canonical_map(bounds: &Aabb) -> Result<Similarity, Error> {
    let half = 0.5 * bounds.size().max_element();
    if !bounds.is_solid() || !half.is_finite() {
        return Err(Error::option("bounds of the prior", "a finite box of positive size", bounds));
    }
    let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
    if reach <= CANONICAL_HALF_EXTENT * CANONICAL_TOLERANCE && half >= CANONICAL_HALF_EXTENT / CANONICAL_TOLERANCE {
        return Ok(Similarity::IDENTITY);
    }
    let scale = CANONICAL_HALF_EXTENT / half;
    Ok(Similarity { scale, rotation: DQuat::IDENTITY, translation: -scale * bounds.center() })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn scenes_of_the_canonical_size_stay_and_others_are_centred_and_scaled() {
        let near = Aabb { min: DVec3::new(-0.7, -1.2, -0.5), max: DVec3::new(0.7, 1.2, 1.1) };
        assert_eq!(canonical_map(&near).unwrap(), Similarity::IDENTITY);
        for factor in [1e-6, 0.6, 1.6, 1e6] {
            let far = Aabb { min: factor * near.min, max: factor * near.max };
            let map = canonical_map(&far).unwrap();
            let mapped = Aabb { min: map.point(far.min), max: map.point(far.max) };
            assert!(mapped.center().length() < 1e-12, "factor {factor}: {mapped:?}");
            assert!((mapped.size().max_element() - 2.4).abs() < 1e-12, "factor {factor}: {mapped:?}");
        }
        let aside = Aabb { min: near.min + 1.0, max: near.max + 1.0 };
        assert_ne!(canonical_map(&aside).unwrap(), Similarity::IDENTITY, "it reaches past 1.8");
    }

    #[test]
    fn bounds_without_extent_are_refused() {
        let flat = Aabb { min: DVec3::ZERO, max: DVec3::new(1.0, 1.0, 0.0) };
        for bounds in [Aabb::EMPTY, flat, Aabb { min: DVec3::NAN, max: DVec3::ONE }] {
            assert!(canonical_map(&bounds).is_err(), "{bounds:?}");
        }
    }
}

//! The map from any dataset's space to the model's canonical box.

use glam::DQuat;

use super::Error;
use strivec_format::geometry::{Aabb, Similarity};

/// Half the largest extent of a mapped scene, in model units. Most presets are made for this size.
pub const CANONICAL_HALF_EXTENT: f64 = 1.2;
/// A scene is not mapped if it fits the canonical box within this factor.
pub const CANONICAL_TOLERANCE: f64 = 1.5;

/// The map from `bounds`, those of a prior in the dataset's space, to the canonical box: center 0, largest half extent
/// `half_extent`. It scales all axes equally and never rotates, so lattices stay axis-aligned.
///
/// It is the identity exactly if `bounds` lies within ±1.5 `half_extent` on every axis and its largest half extent is
/// at least `half_extent`/1.5 (for 1.2: ±1.8 and 0.8): pitches are per model unit, so a scene that was made for them
/// keeps its own units. Outside that band the model does not depend on the dataset's unit or origin.
///
/// # Errors
///
/// If `bounds` is empty, flat or not finite, or `half_extent` is not positive.
pub fn canonical_map(bounds: &Aabb, half_extent: f64) -> Result<Similarity, Error> {
    if !(half_extent > 0.0 && half_extent.is_finite()) {
        return Err(Error::option("half_extent", "a positive number", half_extent));
    }
    let half = 0.5 * bounds.size().max_element();
    if !bounds.is_solid() || !half.is_finite() {
        return Err(Error::option("prior_bounds", "a finite box of positive size", bounds));
    }
    let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
    if reach <= half_extent * CANONICAL_TOLERANCE && half >= half_extent / CANONICAL_TOLERANCE {
        return Ok(Similarity::IDENTITY);
    }
    let scale = half_extent / half;
    Ok(Similarity { scale, rotation: DQuat::IDENTITY, translation: -scale * bounds.center() })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn scenes_of_the_canonical_size_stay_and_others_are_centered_and_scaled() {
        let near = Aabb { min: DVec3::new(-0.7, -1.2, -0.5), max: DVec3::new(0.7, 1.2, 1.1) };
        let canonical_map = |bounds: &Aabb| canonical_map(bounds, CANONICAL_HALF_EXTENT);
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
    fn the_caller_sets_the_canonical_size() {
        let room = Aabb::around(DVec3::ONE, DVec3::new(2.4, 2.0, 1.0));
        let map = canonical_map(&room, 4.8).unwrap();
        assert_eq!((map.scale, map.point(DVec3::ONE)), (2.0, DVec3::ZERO));
        let large = Aabb::around(DVec3::ONE, DVec3::new(4.0, 2.0, 1.0));
        assert_eq!(canonical_map(&large, 4.8).unwrap(), Similarity::IDENTITY);
    }

    #[test]
    fn bounds_without_extent_are_refused() {
        let flat = Aabb { min: DVec3::ZERO, max: DVec3::new(1.0, 1.0, 0.0) };
        for bounds in [Aabb::EMPTY, flat, Aabb { min: DVec3::NAN, max: DVec3::ONE }] {
            assert!(canonical_map(&bounds, 1.2).is_err(), "{bounds:?}");
        }
        assert!(canonical_map(&Aabb::around(DVec3::ZERO, DVec3::ONE), 0.0).is_err());
    }
}

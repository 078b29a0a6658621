//! The width of a pixel at what photographs show.

use glam::DVec3;

use strivec_format::geometry::Camera;

/// The most places, and cameras, that are looked at; of more, some at equal steps.
const PLACES: usize = 2000;
const CAMERAS: usize = 256;
/// The shares of the places whose footprints are told.
const SHARES: [f64; 3] = [0.1, 0.5, 0.9];

/// The widths of a pixel at the tenth, the half and the nine tenths of `places` where it is least wide, each by the median of
/// the `cameras` that have it in their pictures; `None` if no place is in any.
pub(super) fn footprints(cameras: &[Camera], places: &[DVec3]) -> Option<[f64; 3]> {
    let of_place = |place: &DVec3| {
        let cameras = cameras.iter().step_by(cameras.len().div_ceil(CAMERAS).max(1));
        let seeing = cameras.filter(|camera| camera.project(*place).is_some_and(|at| camera.is_inside(at)));
        middle(seeing.map(|camera| camera.position.distance(*place) / camera.focal[0]).collect(), 0.5)
    };
    let chosen = places.iter().step_by(places.len().div_ceil(PLACES).max(1));
    let widths: Vec<f64> = chosen.filter_map(of_place).collect();
    let [a, b, c] = SHARES.map(|share| middle(widths.clone(), share));
    Some([a?, b?, c?])
}

/// The value that this share of `values` is less than.
fn middle(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get((share * values.len() as f64) as usize).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_as_wide_as_its_distance_by_the_focal_length() {
        let camera = Camera::looking_at([64, 48], 50.0, DVec3::ZERO, DVec3::X, DVec3::Z);
        let places: Vec<DVec3> = (1..=100).map(|n| f64::from(n) * DVec3::X).collect();
        let found = footprints(&[camera], &places).unwrap();
        for (found, expected) in found.into_iter().zip([0.2, 1.0, 1.8]) {
            assert!((found - expected).abs() < 0.05, "{found}, expected {expected}");
        }
        assert_eq!(footprints(&[camera], &[DVec3::NEG_X]), None, "behind the camera");
    }
}

//! Where the cameras of a capture are, by medians: no single one decides anything.

use glam::DVec3;

use strivec_format::geometry::{Aabb, Camera};

/// A camera that is so many times farther from the middle of all than half of them contradicts the rest.
const ODD: f64 = 30.0;
/// Cameras whose positions differ by less than this share of their size are at one place.
const ONE_PLACE: f64 = 1e-9;

/// What the positions of cameras say.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CameraStatistics {
    /// \[camera\] true if its position contradicts the others'.
    pub(crate) odd: Vec<bool>,
    /// The median position, axis by axis, of those that are not odd.
    pub(crate) middle: DVec3,
    /// All cameras, of which there are several, are at one place.
    pub(crate) one_place: bool,
}

impl CameraStatistics {
    pub(crate) fn of(cameras: &[Camera]) -> Self {
        let middle = middle_of(cameras.iter());
        let reach = |camera: &Camera| camera.position.distance(middle);
        let typical = median(cameras.iter().map(reach));
        let odd: Vec<bool> = cameras.iter().map(|camera| reach(camera) > ODD * typical && typical > 0.0).collect();
        let usual = || cameras.iter().zip(&odd).filter(|(_, odd)| !**odd).map(|(camera, _)| camera);
        let middle = middle_of(usual());
        let farthest = cameras.iter().map(reach).fold(0.0, f64::max);
        let one_place = cameras.len() > 1 && farthest <= ONE_PLACE * (1.0 + middle.length());
        Self { odd, middle, one_place }
    }

    /// How many times camera number `n` of `cameras` is farther from the middle than half of those that are not odd.
    pub(crate) fn times(&self, cameras: &[Camera], n: usize) -> f64 {
        let reach = |camera: &Camera| camera.position.distance(self.middle);
        reach(&cameras[n]) / median(self.usual(cameras).map(reach))
    }

    /// The cameras of `cameras` that are not odd.
    pub(crate) fn usual<'a>(&'a self, cameras: &'a [Camera]) -> impl Iterator<Item = &'a Camera> + Clone {
        cameras.iter().zip(&self.odd).filter(|(_, odd)| !**odd).map(|(camera, _)| camera)
    }

    /// The box of the central `share` of the positions along each axis.
    pub(crate) fn central_box(&self, cameras: &[Camera], share: f64) -> Aabb {
        central_box(&self.usual(cameras).map(|camera| camera.position).collect::<Vec<_>>(), share)
    }
}

fn middle_of<'a>(cameras: impl Iterator<Item = &'a Camera> + Clone) -> DVec3 {
    [0, 1, 2].map(|axis| median(cameras.clone().map(|camera| camera.position[axis]))).into()
}

/// The middle one of `values`, the lower one of two; 0 without any.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    quantile(values.collect(), 0.5)
}

/// The smallest of `values` that at least this `share` of them do not exceed; 0 without any.
pub(crate) fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let before = (share * values.len() as f64).ceil() as usize;
    values.get(before.saturating_sub(1)).copied().unwrap_or(0.0)
}

/// The box of the central `share` of `points` along each axis.
pub(crate) fn central_box(points: &[DVec3], share: f64) -> Aabb {
    let end = |share: f64| -> DVec3 {
        [0, 1, 2].map(|axis| quantile(points.iter().map(|at| at[axis]).collect(), share)).into()
    };
    Aabb { min: end(0.5 - 0.5 * share), max: end(0.5 + 0.5 * share) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(count: u32) -> Vec<Camera> {
        (0..count)
            .map(|n| {
                let at = 4.0 * DVec3::new(f64::from(n).cos(), f64::from(n).sin(), 0.3);
                Camera::looking_at([8, 8], 8.0, at, DVec3::ZERO, DVec3::Z)
            })
            .collect()
    }

    #[test]
    fn one_camera_far_away_is_odd_and_changes_nothing() {
        let cameras = around(24);
        let clean = CameraStatistics::of(&cameras);
        let mut spoiled = cameras.clone();
        spoiled.push(Camera { position: DVec3::new(8000.0, 0.0, 0.0), ..cameras[0] });
        let found = CameraStatistics::of(&spoiled);
        assert_eq!(found.odd.iter().filter(|odd| **odd).count(), 1);
        assert!(found.odd[24] && !clean.odd.contains(&true));
        assert!(found.middle.distance(clean.middle) < 1e-9);
    }

    #[test]
    fn cameras_at_one_place_are_found() {
        let mut cameras = around(5);
        assert!(!CameraStatistics::of(&cameras).one_place);
        cameras.iter_mut().for_each(|camera| camera.position = DVec3::ONE);
        assert!(CameraStatistics::of(&cameras).one_place);
        assert!(!CameraStatistics::of(&cameras[..1]).one_place, "a single camera is at its place");
    }

    #[test]
    fn quantiles_are_among_the_values() {
        let values = vec![3.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0];
        assert_eq!([0.0, 0.2, 0.5, 0.9].map(|share| quantile(values.clone(), share)), [1.0, 2.0, 2.0, 3.0]);
        assert_eq!(quantile(Vec::new(), 0.5), 0.0);
    }
}

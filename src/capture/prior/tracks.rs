//! The points of a dataset as places that photographs show: the more photographs see one, the more often it counts.

use std::path::Path;

use glam::DVec3;

use super::BuildError;
use strivec_format::geometry::Aabb;
use strivec_import as geometry;
use strivec_import::{Fault, Point, ReadOptions, Visitor};

/// Photographs of a point, at most, that count.
const MOST_IMAGES: u64 = 64;
/// A point whose reprojection error is so many times the median one is not used.
const LARGE_ERROR: f64 = 3.0;
/// Places that are returned, about, at most.
const PLACES: usize = 200_000;

/// The points in the file `path`, each as often as photographs show it, if the file says so. Points that do not fit the
/// photographs are left out.
pub(crate) fn tracked_places(path: &Path) -> Result<Vec<DVec3>, BuildError> {
    let mut tracks = Tracks::default();
    geometry::read(path, &ReadOptions::default(), &mut tracks)?;
    let mut errors: Vec<f64> = tracks.0.iter().map(|track| track.error).collect();
    errors.sort_by(f64::total_cmp);
    let largest = errors.get(errors.len() / 2).map_or(0.0, |median| LARGE_ERROR * median.max(0.0));
    tracks.0.retain(|track| track.error <= largest);
    let sights: usize = tracks.0.iter().map(|track| track.images as usize).sum();
    let stride = sights.div_ceil(PLACES).max(1);
    let all = tracks.0.iter().flat_map(|track| (0..track.images).map(|_| track.at));
    Ok(all.step_by(stride).collect())
}

/// The mean distance of each point in the file `path` from its keypoints, in pixels, negative if it is not known.
///
/// # Errors
///
/// If the file cannot be read.
pub fn reprojection_errors(path: &Path) -> Result<Vec<f64>, BuildError> {
    let mut tracks = Tracks::default();
    geometry::read(path, &ReadOptions::default(), &mut tracks)?;
    Ok(tracks.0.iter().map(|track| track.error).collect())
}

struct Track {
    at: DVec3,
    images: u64,
    /// Mean distance from the keypoints in pixels; 0 or less if not known.
    error: f64,
}

#[derive(Default)]
struct Tracks(Vec<Track>);

impl Visitor for Tracks {
    fn point(&mut self, point: Point) -> Result<(), Fault> {
        self.tracked(point, 1, 0.0)
    }

    fn tracked(&mut self, point: Point, images: u64, error: f64) -> Result<(), Fault> {
        self.0.push(Track { at: point.position, images: images.clamp(1, MOST_IMAGES), error });
        Ok(())
    }

    /// Surfaces count by their corners.
    fn triangle(&mut self, corners: [Point; 3]) -> Result<(), Fault> {
        corners.into_iter().try_for_each(|corner| self.point(corner))
    }

    fn cell(&mut self, cell: &Aabb, color: Option<[u8; 3]>) -> Result<(), Fault> {
        self.point(Point { position: cell.center(), color })
    }

    fn not_finite(&mut self, _: Fault) -> Result<(), Fault> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_count_as_often_as_photographs_see_them_and_those_that_do_not_fit_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("points3D.txt");
        let text = "1 1 0 0 9 9 9 0.5 1 0 2 0 3 0\n2 2 0 0 9 9 9 0.6 1 1 2 1\n3 3 0 0 9 9 9 9.5 1 2 2 2 3 2\n";
        std::fs::write(&file, text).unwrap();
        let places = tracked_places(&file).unwrap();
        let x: Vec<f64> = places.iter().map(|at| at.x).collect();
        assert_eq!(x, [1.0, 1.0, 1.0, 2.0, 2.0]);

        let plain = folder.path().join("points.xyz");
        std::fs::write(&plain, "1 0 0\n2 0 0\n").unwrap();
        assert_eq!(tracked_places(&plain).unwrap().len(), 2);
    }
}

//! Where the scene of a dataset is: the one rule, for all commands that train or show a dataset.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use glam::{DVec3, IVec3};

use super::bounds::{ray_range, ray_range_of_surroundings};
use super::stereo::{Matches, matches};
use super::survey::Survey;
use super::voxels::boxes_of;
use super::{BuildError, BuildOptions, Built, Outliers, VoxelBoxes, build};
use crate::dataset::Photograph;
use strivec_format::geometry::{Aabb, Camera};

/// The rule for outliers among the sparse points of structure from motion.
const SPARSE_OUTLIERS: Outliers = Outliers { neighbors: 16, deviations: 2.0 };
/// The margin around the points' box, as a share of its size: surfaces without texture have no points.
const SPARSE_MARGIN: f64 = 0.1;

/// The photographs among which points are matched, at most: it takes a core about a second for each.
const MATCHED_VIEWS: usize = 200;

/// The place of a dataset's scene, in the dataset's space.
#[derive(Clone, Debug, PartialEq)]
pub struct Location {
    /// The distances at which rays begin and end.
    pub near_far: [f64; 2],
    /// The scene's box; `None` if only the cameras bound it.
    pub bounds: Option<Aabb>,
    /// The cells that hold the dataset's points, without outliers.
    pub points: Option<VoxelBoxes>,
    /// The cells that hold all of them.
    pub all_points: Option<VoxelBoxes>,
}

/// The place of the scene that `cameras` see, by the first that is known: the file `points` of points on its surfaces;
/// its box `bounds` if photographs are opaque; the cameras alone, farther behind their focus if photographs are opaque.
///
/// # Errors
///
/// The errors of [`build()`] for the file of points. A file whose points have no extent counts as none.
pub fn locate(
    points: Option<&Path>,
    bounds: Option<Aabb>,
    cameras: &[Camera],
    is_opaque: impl FnOnce() -> bool,
) -> Result<Location, BuildError> {
    let cells = |outliers| points.map(|path| cells_of(path.to_path_buf(), outliers)).transpose();
    let all_points = cells(None)?.flatten();
    let points = cells(Some(SPARSE_OUTLIERS))?.flatten();
    let around = |cells: &VoxelBoxes| {
        let bounds = cells.bounds();
        bounds.grown(SPARSE_MARGIN * bounds.size())
    };
    let near_far = match &points {
        Some(cells) => ray_range(cameras, Some(cells)),
        None if is_opaque() => ray_range_of_surroundings(cameras, bounds.as_ref()),
        None => ray_range(cameras, None),
    };
    Ok(Location { near_far, bounds: bounds.or_else(|| points.as_ref().map(around)), points, all_points })
}

/// Matches points between opaque photographs with known poses (`stereo.rs`), and sets the views' distances to them. Of
/// many photographs, some are compared with all. Returns the points, in the dataset's space, which may be far away in a
/// scene that `is_unbounded`.
pub fn match_points(views: &mut [Photograph], is_unbounded: bool) -> Vec<DVec3> {
    let Matches { points, distances } = matches(views, MATCHED_VIEWS, is_unbounded);
    views.iter_mut().zip(distances).for_each(|(view, distances)| view.distances = distances);
    points
}

/// The cells that hold `points`, about as many along the edges of their box as the coarse reconstruction has; `None` if
/// they have no extent.
pub fn cells_around(points: &[DVec3]) -> Option<VoxelBoxes> {
    let mut survey = Survey::new(None);
    points.iter().for_each(|&point| survey.point(point));
    let lattice = survey.lattice(&[]).ok()?;
    let cells: BTreeSet<_> = points.iter().map(|&point| lattice.cell_of(point)).map(|c| [c.z, c.y, c.x]).collect();
    boxes_of(&lattice, cells.iter().map(|&[z, y, x]| IVec3::new(x, y, z)))
}

/// The cells of the points in the file `path`, without `outliers`.
fn cells_of(path: PathBuf, outliers: Option<Outliers>) -> Result<Option<VoxelBoxes>, BuildError> {
    let options = BuildOptions { outliers, ..BuildOptions::default() };
    match build(&[path], &options, &mut |_| ControlFlow::Continue(())) {
        Ok(Built { boxes, .. }) => Ok(Some(boxes)),
        Err(BuildError::Nothing(_) | BuildError::OnePlace { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use glam::DVec3;

    use super::*;

    fn cameras() -> Vec<Camera> {
        (0..8)
            .map(|n| {
                let at = 4.0 * DVec3::new(f64::from(n).cos(), f64::from(n).sin(), 0.3);
                Camera::looking_at([8, 8], 8.0, at, DVec3::ZERO, DVec3::Z)
            })
            .collect()
    }

    #[test]
    fn points_precede_the_box_and_the_box_precedes_the_cameras() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("points.xyz");
        let grid = |n: i32| [n % 5, n / 5 % 5, n / 25].map(|v| 0.2 * f64::from(v) - 0.4);
        let lines: Vec<_> = (0..125).map(grid).map(|[x, y, z]| format!("{x} {y} {z}")).collect();
        fs::write(&file, lines.join("\n")).unwrap();
        let cameras = cameras();
        let bounds = Aabb::around(DVec3::ZERO, DVec3::ONE);
        let of = |points: Option<&Path>, bounds, opaque| locate(points, bounds, &cameras, || opaque).unwrap();

        let by_points = of(Some(&file), None, true);
        let [near, far] = by_points.near_far;
        assert!(near > 3.0 && far < 5.5, "{near} to {far}");
        let size = by_points.bounds.unwrap().size();
        assert!(size.min_element() > 0.8 && size.max_element() < 1.3, "{size}");
        assert_eq!(of(Some(&file), Some(bounds), true).bounds, Some(bounds));

        assert_eq!(of(None, Some(bounds), true).near_far, ray_range_of_surroundings(&cameras, Some(&bounds)));
        assert_eq!(of(None, Some(bounds), false).near_far, ray_range(&cameras, None));
        assert_eq!(of(None, None, true).near_far, ray_range_of_surroundings(&cameras, None));

        // Points in one place have no extent.
        fs::write(&file, "1 1 1\n1 1 1\n").unwrap();
        assert_eq!(
            of(Some(&file), None, false),
            Location { near_far: ray_range(&cameras, None), bounds: None, points: None, all_points: None }
        );
    }
}

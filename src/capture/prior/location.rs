//! Cells around points: those in the files of a dataset, and those matched between its photographs.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::Path;

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use super::extent::Extent;
use super::stereo::{MatchWatch, Matches, matches};
use super::voxels::boxes_of;
use super::{BuildError, BuildOptions, Built, CameraStatistics, Outliers, VoxelBoxes, build, is_open, open_share};
use crate::dataset::Photograph;
use strivec_format::geometry::Camera;

/// The rule for outliers among the sparse points of structure from motion.
pub(crate) const SPARSE_OUTLIERS: Outliers = Outliers { neighbors: 16, deviations: 2.0 };

/// The photographs among which points are matched, at most: each takes a core about a third of a second.
const MATCHED_VIEWS: usize = 200;

/// Matches points between opaque photographs with known poses (`stereo.rs`), and sets the views' distances to them. Of
/// many photographs, some are compared with all. Returns the points, in the dataset's space, which may be far away; `None`
/// if `watch` stops it.
///
/// Planes that match as well at other depths may be those of a sky. They are left out if many rays of the photographs meet no other
/// matched surface.
pub fn match_points(views: &mut [Photograph], watch: &mut dyn MatchWatch) -> Option<Vec<DVec3>> {
    let cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
    let usual: Vec<Camera> = CameraStatistics::of(&cameras).usual(&cameras).copied().collect();
    let sees_sky = |distances: &[Vec<f32>]| {
        let places = places_of(cameras.iter().zip(distances.iter().map(Vec::as_slice)).collect());
        is_open(open_share(&usual, &places))
    };
    let Matches { points, distances } = matches(views, MATCHED_VIEWS, sees_sky, watch)?;
    views.iter_mut().zip(distances).for_each(|(view, distances)| view.distances = distances);
    Some(points)
}

/// The most pixels whose places are taken.
const SHOWN: usize = 200_000;

/// Places of what `views` show, in the dataset's space, by their known distances: of pixels in equal steps, so that there are the
/// more of a surface, the more of the pictures it fills.
pub fn shown(views: &[Photograph]) -> Vec<DVec3> {
    places_of(views.iter().map(|view| (&view.camera, view.distances.as_slice())).collect())
}

/// Places that `pictures` show, cameras with the distances of their pixels, in equal steps of pixels.
fn places_of(pictures: Vec<(&Camera, &[f32])>) -> Vec<DVec3> {
    let pixels: usize = pictures.iter().map(|(_, distances)| distances.len()).sum();
    let stride = (pixels as f64 / SHOWN as f64).sqrt().ceil().max(1.0) as u32;
    let of_picture = |(camera, distances)| known_places(camera, distances, stride).map(|(_, place)| place);
    pictures.into_par_iter().flat_map_iter(of_picture).collect()
}

/// The pixels (column, row) of `camera` in steps of `stride` whose distance is known, and the places that they show.
pub(super) fn known_places(camera: &Camera, distances: &[f32], stride: u32) -> impl Iterator<Item = ([u32; 2], DVec3)> {
    let Camera { width, height, .. } = *camera;
    let steps = move |count: u32| (stride / 2..count).step_by(stride as usize);
    let pixels = steps(height).flat_map(move |row| steps(width).map(move |column| [column, row]));
    pixels.filter_map(move |[column, row]| {
        let distance = f64::from(*distances.get((row * width + column) as usize)?);
        (distance > 0.0).then(|| camera.ray(column, row).map(|ray| ([column, row], ray.at(distance))))?
    })
}

/// \[view\] the share of its pixels with a known distance; `None` of a view in which none was looked for.
pub fn known_shares(views: &[Photograph]) -> Vec<Option<f64>> {
    let share = |view: &Photograph| {
        let known = view.distances.iter().filter(|distance| **distance > 0.0).count();
        (!view.distances.is_empty()).then(|| known as f64 / view.distances.len() as f64)
    };
    views.par_iter().map(share).collect()
}

/// The cells that hold `points`, about as many along the edges of their box as the coarse reconstruction has; `None` if
/// they have no extent.
pub fn cells_around(points: &[DVec3]) -> Option<VoxelBoxes> {
    let mut extent = Extent::new(None);
    points.iter().for_each(|&point| extent.point(point));
    let lattice = extent.lattice(&[]).ok()?;
    let cells: BTreeSet<_> = points.iter().map(|&point| lattice.cell_of(point)).map(|c| [c.z, c.y, c.x]).collect();
    boxes_of(&lattice, cells.iter().map(|&[z, y, x]| IVec3::new(x, y, z)))
}

/// The cells of the points in the file `path`, without `outliers`; `None` if they have no extent.
///
/// # Errors
///
/// The errors of [`build()`].
pub(crate) fn points_in(path: &Path, outliers: Option<Outliers>) -> Result<Option<VoxelBoxes>, BuildError> {
    let options = BuildOptions { outliers, ..BuildOptions::default() };
    match build(&[path.to_path_buf()], &options, &mut |_| ControlFlow::Continue(())) {
        Ok(Built { boxes, .. }) => Ok(Some(boxes)),
        Err(BuildError::Nothing(_) | BuildError::OnePlace { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

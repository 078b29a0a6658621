//! Geometry priors: occupied space from photographs or files, and the placement of tensors there.
//!
//! In: posed photographs ([`coarse`]) or files of geometry ([`build()`]). Out: [`VoxelBoxes`] in the dataset's space,
//! the map to the model's canonical box ([`canonical_map`]), and tensor clouds without values ([`placement`]), which
//! training initializes.

mod alignment;
mod bad_shapes;
mod bounds;
mod build;
mod camera_statistics;
mod canonical;
pub mod coarse;
mod error;
mod exposures;
mod extent;
mod file;
mod free_space;
mod holes;
mod location;
mod mesh_distances;
mod morphology;
mod open_rays;
mod outliers;
mod overlap;
mod overlay;
pub mod placement;
mod sparse_voxel_tree;
mod stereo;
mod tracks;
mod unbounded;
mod voxel_boxes;
mod voxels;

pub use alignment::{AlignmentHint, PriorVisibility, check_alignment};
pub use bad_shapes::{not_finite_in, points_left_out};
pub(crate) use bounds::ray_range_of_surroundings;
pub use bounds::{CameraBounds, frusta_box, inner_box, ray_range};
pub use build::{BuildOptions, BuildProgress, Built, Counts, build};
pub(crate) use camera_statistics::{CameraStatistics, central_box, quantile};
pub use canonical::{CANONICAL_HALF_EXTENT, CANONICAL_TOLERANCE, canonical_map};
pub use coarse::{CoarseOptions, CoarseProgress};
pub use coarse::{check_views, frusta_within, near_and_far};
pub use error::{BuildError, Error, NoCells, Remedy};
pub use exposures::brightness;
pub use file::to_npz;
pub(crate) use location::{SPARSE_OUTLIERS, points_in};
pub use location::{cells_around, known_shares, match_points, shown};
pub use mesh_distances::{MAX_TRIANGLES, mesh_distances};
pub(crate) use open_rays::{OPEN, box_of_places, is_open, open_share, with_margin};
pub use outliers::Outliers;
pub use overlay::{Shading, distance_range, overlay};
pub use placement::{ScaleShape, place_on_boxes};
pub use sparse_voxel_tree::{FirstHit, SparseVoxelTree};
pub use stereo::MatchWatch;
pub use tracks::reprojection_errors;
pub(crate) use tracks::tracked_places;
pub use unbounded::Unbounded;
pub use voxel_boxes::VoxelBoxes;
pub use voxels::MAX_CELLS;
pub use voxels::boxes_of;

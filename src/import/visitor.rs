//! What readers hand over, and what they are told.

use glam::DVec3;

use super::Fault;
use crate::geometry::Aabb;

/// A place on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where, in the file's own space. Finite: readers see to it.
    pub position: DVec3,
    /// sRGB, where the file has colors.
    pub color: Option<[u8; 3]>,
}

impl Point {
    /// A point of the coordinates `position`, read at `place`.
    ///
    /// # Errors
    ///
    /// If they are not finite.
    pub fn new(position: DVec3, color: Option<[u8; 3]>, place: impl FnOnce() -> String) -> Result<Self, Fault> {
        if position.is_finite() {
            return Ok(Self { position, color });
        }
        Err(Fault::malformed(place(), "finite coordinates", position))
    }
}

/// Takes geometry as it is read. Every method may end the reading with an error.
pub trait Visitor {
    /// A point of a cloud.
    ///
    /// # Errors
    ///
    /// To end the reading.
    fn point(&mut self, point: Point) -> Result<(), Fault>;

    /// A triangle of a mesh; it may be degenerate.
    ///
    /// # Errors
    ///
    /// To end the reading.
    fn triangle(&mut self, corners: [Point; 3]) -> Result<(), Fault>;

    /// A cell of a grid or an octree that is occupied; its corners are finite. sRGB where it has a color.
    ///
    /// # Errors
    ///
    /// To end the reading.
    fn cell(&mut self, cell: &Aabb, color: Option<[u8; 3]>) -> Result<(), Fault>;

    /// Now and then: so many bytes of so many are read.
    ///
    /// # Errors
    ///
    /// To end the reading.
    fn progress(&mut self, done: u64, total: u64) -> Result<(), Fault>;
}

/// Which parts of a file count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// Of meshes, whether only their vertices count, as points (what the paper did).
    pub vertices: bool,
    /// Points of a smaller confidence are left out, where the file has confidences.
    pub min_confidence: f64,
    /// COLMAP: points seen in fewer pictures are left out.
    pub min_track: u64,
    /// COLMAP: points of a larger mean reprojection error, in pixels, are left out.
    pub max_reprojection_error: f64,
    /// Density grids: cells are occupied from this opacity over one voxel edge on (DVGO's first stage: 1e-3 for its bounds,
    /// 1e-4 here).
    pub min_alpha: f64,
    /// Other grids of numbers, and octrees of probabilities: cells are occupied above this.
    pub threshold: f64,
    /// What a grid spans that does not say so itself.
    pub bounds: Option<Aabb>,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            vertices: false,
            min_confidence: 0.0,
            min_track: 0,
            max_reprojection_error: f64::INFINITY,
            min_alpha: 1e-4,
            threshold: 0.5,
            bounds: None,
        }
    }
}

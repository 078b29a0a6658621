//! The receiver of geometry, and the options of readers.

use glam::DVec3;

use super::Fault;
use strivec_format::Invalid;
use strivec_format::geometry::Aabb;

/// A point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Position of the point in the file's space; finite.
    pub position: DVec3,
    /// sRGB; `None` if the file has no colors.
    pub color: Option<[u8; 3]>,
}

impl Point {
    /// A point at `position`; `place` names its origin in errors.
    ///
    /// # Errors
    ///
    /// If `position` is not finite.
    pub fn new(position: DVec3, color: Option<[u8; 3]>, place: impl FnOnce() -> String) -> Result<Self, Fault> {
        if position.is_finite() {
            return Ok(Self { position, color });
        }
        Err(Fault::NotFinite(Invalid::new(place(), "finite coordinates", position)))
    }

    /// Passes a point to `visitor`, or the fault that a coordinate is not finite.
    pub(super) fn pass(point: Result<Self, Fault>, visitor: &mut dyn Visitor) -> Result<(), Fault> {
        match point {
            Ok(point) => visitor.point(point),
            Err(fault) => fault.pass(visitor),
        }
    }

    /// Passes a tracked point to `visitor`, or the fault that a coordinate is not finite.
    pub(super) fn pass_tracked(
        point: Result<Self, Fault>,
        images: u64,
        error: f64,
        visitor: &mut dyn Visitor,
    ) -> Result<(), Fault> {
        match point {
            Ok(point) => visitor.tracked(point, images, error),
            Err(fault) => fault.pass(visitor),
        }
    }
}

impl Fault {
    /// Passes the fault to `visitor` if it is that a coordinate is not finite; else it is the error.
    pub(super) fn pass(self, visitor: &mut dyn Visitor) -> Result<(), Self> {
        match self {
            Self::NotFinite(_) => visitor.not_finite(self),
            other => Err(other),
        }
    }
}

/// A reader's reason to leave out a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeftOut {
    /// LAS: it is marked as withheld.
    Withheld,
    /// LAS: its class is noise, 7 or 18.
    Noise,
    /// A splat whose opacity is below [`ReadOptions::min_opacity`].
    Transparent,
    /// A coordinate is not finite.
    NotFinite,
}

/// Receives geometry while it is read. An error of any method ends the reading.
pub trait Visitor {
    /// A point of a cloud.
    ///
    /// # Errors
    ///
    /// Any error ends the reading.
    fn point(&mut self, point: Point) -> Result<(), Fault>;

    /// A point of structure from motion, that `images` photographs show, `error` pixels apart from where it is on average; a
    /// negative error is not known. A visitor that does not override this receives it as a point.
    ///
    /// # Errors
    ///
    /// Any error ends the reading.
    fn tracked(&mut self, point: Point, _images: u64, _error: f64) -> Result<(), Fault> {
        self.point(point)
    }

    /// A Gaussian splat: its center, and its three principal axes, each two standard deviations long. They are finite,
    /// and may be 0. A visitor that does not override this receives the center as a point.
    ///
    /// # Errors
    ///
    /// Any error ends the reading.
    fn splat(&mut self, center: Point, _axes: [DVec3; 3]) -> Result<(), Fault> {
        self.point(center)
    }

    /// A point is left out for `reason`.
    fn left_out(&mut self, _reason: LeftOut) {}

    /// A point, splat, vertex or triangle is left out, as a coordinate is not finite, if this method allows it: `fault` says
    /// which. The default refuses it.
    ///
    /// # Errors
    ///
    /// Any error ends the reading.
    fn not_finite(&mut self, fault: Fault) -> Result<(), Fault> {
        Err(fault)
    }

    /// A triangle of a mesh; it may be degenerate.
    ///
    /// # Errors
    ///
    /// Any error ends the reading.
    fn triangle(&mut self, corners: [Point; 3]) -> Result<(), Fault>;

    /// An occupied cell of a grid or octree, with finite corners, and its sRGB color if it has one.
    ///
    /// # Errors
    ///
    /// Any error ends the reading.
    fn cell(&mut self, cell: &Aabb, color: Option<[u8; 3]>) -> Result<(), Fault>;

    /// Reports progress: `done` of `total` bytes are read. Called at intervals.
    ///
    /// # Errors
    ///
    /// Any error ends the reading.
    fn progress(&mut self, _done: u64, _total: u64) -> Result<(), Fault> {
        Ok(())
    }
}

/// The parts of a file that are read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// Meshes: read only the vertices, as points, as the paper does. Splats: read only the centers.
    pub vertices: bool,
    /// Files with confidences: points of a smaller confidence are left out.
    pub min_confidence: f64,
    /// Gaussian splats: those of a smaller opacity are left out; 0 keeps all.
    pub min_opacity: f64,
    /// LAS: keep points that are marked as withheld or as noise (classes 7 and 18).
    pub keep_noise: bool,
    /// COLMAP: points seen in fewer images are left out.
    pub min_track: u64,
    /// COLMAP: points of a larger mean reprojection error, in pixels, are left out.
    pub max_reprojection_error: f64,
    /// Density grids: cells of at least this opacity over one voxel edge are occupied. DVGO's configuration has 1e-3
    /// (`bbox_thres` and `mask_cache_thres` in `configs/default.py`); the default of 1e-4 also keeps thin surfaces.
    pub min_alpha: f64,
    /// Other grids of numbers, and octrees of probabilities: cells above this are occupied.
    pub threshold: f64,
    /// Bounds of grids whose files have none.
    pub bounds: Option<Aabb>,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            vertices: false,
            min_confidence: 0.0,
            min_opacity: 0.1,
            keep_noise: false,
            min_track: 0,
            max_reprojection_error: f64::INFINITY,
            min_alpha: 1e-4,
            threshold: 0.5,
            bounds: None,
        }
    }
}

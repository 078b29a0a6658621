//! ScanNet's scenes: which mesh, and the map that aligns it.

use std::path::{Path, PathBuf};

use super::{Fault, ImportError, Point, Visitor};
use crate::geometry::Aabb;

/// A scan's mesh.
pub(super) struct Scan {
    /// `sceneXXXX_YY_vh_clean_2.ply`, or what there is of it.
    pub(super) mesh: PathBuf,
}

/// The scan that `path`, a folder or a mesh in one, belongs to, if it is one.
pub(super) fn scan_of(_path: &Path) -> Result<Option<Scan>, ImportError> {
    Ok(None)
}

impl Scan {
    /// Hands on to `visitor` what it is given, aligned.
    pub(super) fn aligned<'a>(&'a self, visitor: &'a mut dyn Visitor) -> impl Visitor + 'a {
        Aligned { visitor }
    }
}

struct Aligned<'a> {
    visitor: &'a mut dyn Visitor,
}

impl Visitor for Aligned<'_> {
    fn point(&mut self, point: Point) -> Result<(), Fault> {
        self.visitor.point(point)
    }

    fn triangle(&mut self, corners: [Point; 3]) -> Result<(), Fault> {
        self.visitor.triangle(corners)
    }

    fn cell(&mut self, cell: &Aabb) -> Result<(), Fault> {
        self.visitor.cell(cell)
    }

    fn progress(&mut self, done: u64, total: u64) -> Result<(), Fault> {
        self.visitor.progress(done, total)
    }
}

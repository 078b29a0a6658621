//! A visitor for readers' tests that records all geometry.

use glam::DVec3;

use super::{Fault, Input, LeftOut, Point, ReadOptions, Visitor};
use strivec_format::geometry::Aabb;

/// The recorded geometry.
#[derive(Debug, Default)]
pub struct Seen {
    pub points: Vec<Point>,
    pub triangles: Vec<[Point; 3]>,
    pub cells: Vec<Aabb>,
    pub splats: Vec<(Point, [DVec3; 3])>,
    pub left_out: Vec<LeftOut>,
}

impl Seen {
    pub fn positions(&self) -> Vec<[f64; 3]> {
        self.points.iter().map(|point| point.position.to_array()).collect()
    }
}

impl Visitor for Seen {
    fn point(&mut self, point: Point) -> Result<(), Fault> {
        self.points.push(point);
        Ok(())
    }

    fn triangle(&mut self, corners: [Point; 3]) -> Result<(), Fault> {
        self.triangles.push(corners);
        Ok(())
    }

    fn cell(&mut self, cell: &Aabb, _: Option<[u8; 3]>) -> Result<(), Fault> {
        self.cells.push(*cell);
        Ok(())
    }

    fn splat(&mut self, center: Point, axes: [DVec3; 3]) -> Result<(), Fault> {
        self.splats.push((center, axes));
        Ok(())
    }

    fn left_out(&mut self, reason: LeftOut) {
        self.left_out.push(reason);
    }
}

type Read = fn(&mut Input<'_>, &ReadOptions, &mut dyn Visitor) -> Result<(), Fault>;

/// The geometry that `read` finds in `bytes`.
pub fn seen_with(bytes: &[u8], options: &ReadOptions, read: Read) -> Result<Seen, Fault> {
    let mut seen = Seen::default();
    read(&mut Input::from_bytes(bytes), options, &mut seen)?;
    Ok(seen)
}

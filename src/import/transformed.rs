//! A visitor that moves geometry on its way to another one.

use glam::{DMat4, DVec3};

use super::{Fault, LeftOut, Point, Visitor};
use strivec_format::geometry::Aabb;

/// Passes points, splats and triangles on to `visitor`, transformed. Cells are refused: a rotated cell is no box.
#[expect(missing_debug_implementations, reason = "it borrows a visitor and a closure")]
pub struct Transformed<'a> {
    /// The receiver.
    pub visitor: &'a mut dyn Visitor,
    /// An affine map to the receiver's space.
    pub transform: DMat4,
    /// The name of a point in errors. The largest finite coordinates may become infinite.
    pub place: &'a dyn Fn() -> String,
}

impl Transformed<'_> {
    fn point_of(&self, point: Point) -> Result<Point, Fault> {
        Point::new(self.transform.transform_point3(point.position), point.color, self.place)
    }
}

impl Visitor for Transformed<'_> {
    fn point(&mut self, point: Point) -> Result<(), Fault> {
        let point = self.point_of(point)?;
        self.visitor.point(point)
    }

    fn splat(&mut self, center: Point, axes: [DVec3; 3]) -> Result<(), Fault> {
        let center = self.point_of(center)?;
        let axes = axes.map(|axis| self.transform.transform_vector3(axis));
        match axes.into_iter().find(|axis| !axis.is_finite()) {
            Some(endless) => Err(Fault::malformed((self.place)(), "finite axes", endless)),
            None => self.visitor.splat(center, axes),
        }
    }

    fn not_finite(&mut self, fault: Fault) -> Result<(), Fault> {
        self.visitor.not_finite(fault)
    }

    fn left_out(&mut self, reason: LeftOut) {
        self.visitor.left_out(reason);
    }

    fn triangle(&mut self, [a, b, c]: [Point; 3]) -> Result<(), Fault> {
        let corners = [self.point_of(a)?, self.point_of(b)?, self.point_of(c)?];
        self.visitor.triangle(corners)
    }

    fn cell(&mut self, _: &Aabb, _: Option<[u8; 3]>) -> Result<(), Fault> {
        Err(Fault::unsupported("a grid that is turned", "use a mesh or points"))
    }

    fn progress(&mut self, done: u64, total: u64) -> Result<(), Fault> {
        self.visitor.progress(done, total)
    }
}

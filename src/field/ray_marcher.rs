//! Walking one ray from sample to sample, over what is empty in strides (DESIGN, section 2.9).

use super::{Field, OccupancyCells, Real};
use crate::geometry::Ray;

/// Where a ray has come to.
#[derive(Clone, Copy, Debug)]
pub struct RayMarcher<T> {
    ray: Ray,
    /// Distances between which samples are.
    span: (f64, f64),
    /// The next sample.
    next: u32,
    /// How many samples from it on are known to count.
    known: u32,
    /// 1 over the direction; where that is 0, large.
    inverse: [T; 3],
}

/// What skipping keeps off the faces of cells: a share of a step, so that rounding never skips a sample.
const MARGIN: f64 = 0.01;

impl<T: Real> RayMarcher<T> {
    /// At the first sample of `ray` in `field`.
    #[inline(always)]
    pub fn new(field: &Field<T>, ray: &Ray) -> Self {
        let span = match field.bounds.intersect(ray) {
            Some((entry, exit)) => (entry.max(field.near_far[0]), exit.min(field.near_far[1])),
            None => (0.0, 0.0),
        };
        let inverse = ray.direction.to_array().map(|d| T::of(if d == 0.0 { 1e30 } else { 1.0 / d }));
        Self { ray: *ray, span, next: 0, known: 0, inverse }
    }

    /// The next sample that may count: its distance, and its position relative to the field's origin. Where the field
    /// has an occupancy, samples outside it are passed over; else most of those that nothing covers.
    #[inline(always)]
    pub fn advance(&mut self, field: &Field<T>) -> Option<(f64, [T; 3])> {
        loop {
            let t = self.span.0 + f64::from(self.next) * field.rules.step;
            if t >= self.span.1 {
                return None;
            }
            let position = field.relative(self.ray.at(t));
            if self.known == 0 {
                let Some(cells) = field.cells() else {
                    self.next += 1;
                    return Some((t, position));
                };
                if let Some(empty) = self.count_empty(field, cells, position) {
                    self.next = self.next.saturating_add(empty);
                    continue;
                }
            }
            self.known -= 1;
            self.next += 1;
            return Some((t, position));
        }
    }

    /// How many samples to pass over; or `None`, with `known` set, where samples count.
    #[inline(always)]
    fn count_empty(&mut self, field: &Field<T>, cells: &OccupancyCells<T>, position: [T; 3]) -> Option<u32> {
        let around = cells.empty_span(position, self.inverse);
        let margin = T::of(MARGIN * field.rules.step) + field.position_error;
        let steps = (around.distance - margin) * T::of(1.0 / field.rules.step);
        let alike = steps.max(T::zero()).min(T::of(1e6)).floor_i32() as u32 + 1;
        if around.occupied {
            self.known = alike;
            return None;
        }
        Some(alike)
    }
}

//! Marching one ray from sample to sample with empty-space skipping (spec 4.8). Twin: `shaders/ray_marcher.wgsl`.

use super::{Field, OccupancyCells, Real};
use crate::geometry::Ray;

/// The state of one ray's march.
#[derive(Clone, Copy, Debug)]
pub struct RayMarcher<T> {
    ray: Ray,
    /// Distances at which the ray enters and leaves the space of its samples.
    span: (f64, f64),
    /// The index k of the next sample.
    next: u32,
    /// The number of samples from `next` on that are known to be occupied.
    known: u32,
    /// 1 over the direction, per axis; 1e30 if the component is 0.
    inverse: [T; 3],
}

/// The distance that skipping keeps from the faces of cells, in steps, so that rounding skips no sample that counts.
const MARGIN: f64 = 0.01;

impl<T: Real> RayMarcher<T> {
    /// A marcher at the first sample of `ray` in `field`.
    #[inline(always)]
    pub fn new(field: &Field<T>, ray: &Ray) -> Self {
        let span = match field.bounds.intersect(ray) {
            Some((entry, exit)) => (entry.max(field.near_far[0]), exit.min(field.near_far[1])),
            None => (0.0, 0.0),
        };
        let inverse = ray.direction.to_array().map(|d| T::of(if d == 0.0 { 1e30 } else { 1.0 / d }));
        Self { ray: *ray, span, next: 0, known: 0, inverse }
    }

    /// The next sample that may count: its distance, and its position relative to the field's origin. Skips the samples
    /// outside the occupancy or, if there is none, most samples that no tensor covers.
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

    /// The number of samples to skip at `position`; `None`, with `known` set, if the sample there is occupied.
    #[inline(always)]
    fn count_empty(&mut self, field: &Field<T>, cells: &OccupancyCells<T>, position: [T; 3]) -> Option<u32> {
        let span = cells.empty_span(position, self.inverse);
        let margin = T::of(MARGIN * field.rules.step) + field.position_error;
        let steps = (span.distance - margin) * T::of(1.0 / field.rules.step);
        let alike = steps.max(T::zero()).min(T::of(1e6)).floor_i32() as u32 + 1;
        if span.occupied {
            self.known = alike;
            return None;
        }
        Some(alike)
    }
}

//! Marching one ray from sample to sample with empty-space skipping (spec 4.8). Twin: `shaders/ray_marcher.wgsl`.

use super::cells::Span;
use super::{Field, OccupancyCells, Real};
use crate::geometry::{Ray, RayPath};

/// The state of one ray's march.
#[derive(Clone, Copy, Debug)]
pub struct RayMarcher<T> {
    path: RayPath,
    /// The path's parameter at the first sample and where samples end.
    span: (f64, f64),
    /// The index k of the next sample.
    next: u32,
    /// The number of samples from `next` on that are known to be occupied.
    known: u32,
    /// 1 over the direction, per axis; 1e30 if the component is 0.
    inverse: [T; 3],
    /// 1 over the bound of the path's speed on an axis where it is not straight.
    slowness: T,
}

/// The distance that skipping keeps from the faces of cells, in steps, so that rounding skips no sample that counts.
const MARGIN: f64 = 0.01;

impl<T: Real> RayMarcher<T> {
    /// A marcher at the first sample of `ray` in `field`.
    #[inline(always)]
    pub fn new(field: &Field<T>, ray: &Ray) -> Self {
        let path = RayPath::new(ray, &field.bounds, field.rules.contraction, field.near_far);
        let span = path.span.unwrap_or((0.0, 0.0));
        let inverse = ray.direction.to_array().map(|d| T::of(if d == 0.0 { 1e30 } else { 1.0 / d }));
        let max_speed = path.contraction().map_or(1.0, |(contraction, spacing)| spacing.max_speed(contraction));
        Self { path, span, next: 0, known: 0, inverse, slowness: T::of(1.0 / max_speed) }
    }

    /// The next sample that may count: its distance, and its position relative to the field's origin. Skips the samples
    /// outside the occupancy or, if there is none, most samples that no tensor covers.
    #[inline(always)]
    pub fn advance(&mut self, field: &Field<T>) -> Option<(f64, [T; 3])> {
        loop {
            let u = self.span.0 + f64::from(self.next) * field.rules.step;
            if u >= self.span.1 {
                return None;
            }
            let position = field.relative(self.path.position(u));
            if self.known == 0 {
                let Some(cells) = field.cells() else {
                    self.next += 1;
                    return Some((self.path.distance(u), position));
                };
                if let Some(empty) = self.count_empty(field, cells, position) {
                    self.next = self.next.saturating_add(empty);
                    continue;
                }
            }
            self.known -= 1;
            self.next += 1;
            return Some((self.path.distance(u), position));
        }
    }

    /// The number of samples to skip at `position`; `None`, with `known` set, if the sample there is occupied.
    #[inline(always)]
    fn count_empty(&mut self, field: &Field<T>, cells: &OccupancyCells<T>, position: [T; 3]) -> Option<u32> {
        let span = if self.path.contraction().is_none() {
            cells.span(position, self.inverse)
        } else {
            self.contracted_span(cells, position)
        };
        let margin = T::of(MARGIN * field.rules.step) + field.position_error;
        let steps = (span.distance - margin) * T::of(1.0 / field.rules.step);
        let alike = steps.max(T::zero()).min(T::of(1e6)).floor_i32() as u32 + 1;
        if span.occupied {
            self.known = alike;
            return None;
        }
        Some(alike)
    }

    /// The span from `position` on in a contracted scene, in units of the path's parameter.
    #[inline(always)]
    fn contracted_span(&self, cells: &OccupancyCells<T>, position: [T; 3]) -> Span<T> {
        let norm = position[0].abs().max(position[1].abs()).max(position[2].abs());
        if norm >= T::one() {
            let around = cells.span_around(position);
            return Span { distance: around.distance * self.slowness, ..around };
        }
        // Straight up to the faces of the inner cube.
        let mut span = cells.span(position, self.inverse);
        for a in 0..3 {
            let face = if self.inverse[a] > T::zero() { T::one() } else { -T::one() };
            span.distance = span.distance.min((face - position[a]) * self.inverse[a]);
        }
        span
    }
}

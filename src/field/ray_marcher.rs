//! Marching one ray from sample to sample with empty-space skipping (spec 4.8). Twin: `shaders/ray_marcher.wgsl`.

use super::cells::{Line, Span};
use super::{Field, OccupancyCells, Real};
use strivec_format::geometry::{Ray, RayPath};

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
    /// None if those cells are not known, or the path is empty.
    course: Option<Course<T>>,
}

/// How a path goes through the cells outside of which no sample counts.
#[derive(Clone, Copy, Debug)]
enum Course<T> {
    Straight(Line<T>),
    Contracted {
        /// 1 over the direction, per axis; 1e30 if the component is 0.
        inverse: [T; 3],
        /// 1 over the bound of the path's speed on an axis where it is not straight.
        slowness: T,
    },
}

/// The distance that skipping keeps from the faces of cells, in steps, so that rounding skips no sample that counts.
const MARGIN: f64 = 0.01;

impl<T: Real> RayMarcher<T> {
    /// A marcher at the first sample of `ray` in `field`.
    #[inline(always)]
    pub fn new(field: &Field<T>, ray: &Ray) -> Self {
        let path = RayPath::new(ray, &field.bounds, field.rules.contraction, field.near_far);
        let span = path.span.unwrap_or((0.0, 0.0));
        // 1e30 and not infinity: at a face, 0 times infinity is NaN.
        let inverse = ray.direction.to_array().map(|d| T::of(if d == 0.0 { 1e30 } else { 1.0 / d }));
        let course = path.span.and(field.cells()).map(|cells| match path.contraction() {
            None => {
                let first = field.relative(path.position(span.0));
                Course::Straight(cells.line(first, ray.direction, inverse, field.rules.step))
            }
            Some((contraction, spacing)) => {
                Course::Contracted { inverse, slowness: T::of(1.0 / spacing.max_speed(contraction)) }
            }
        });
        Self { path, span, next: 0, known: 0, course }
    }

    /// The next sample that may count: its distance, and its position relative to the field's origin. Skips the samples
    /// outside the occupancy or, if there is none, most samples that no tensor covers.
    #[inline(always)]
    pub fn advance(&mut self, field: &Field<T>) -> Option<(f64, [T; 3])> {
        while self.skip(field) {}
        let u = self.parameter(field);
        if u >= self.span.1 {
            return None;
        }
        self.known -= 1;
        self.next += 1;
        // In f64 up to here, and relative to the field's origin before rounding: a scene's place in the world costs
        // no precision (docs/numerics.md).
        Some((self.path.distance(u), field.relative(self.path.position(u))))
    }

    /// Skips the next samples if they do not count; false if the next one may count or there is none. The samples
    /// skipped at once have a cube of empty cells in common, so there may be more.
    #[inline(always)]
    pub(super) fn skip(&mut self, field: &Field<T>) -> bool {
        let u = self.parameter(field);
        if self.known > 0 || u >= self.span.1 {
            return false;
        }
        let (Some(cells), Some(course)) = (field.cells(), &self.course) else {
            self.known = u32::MAX;
            return false;
        };
        let per_step = T::of(1.0 / field.rules.step);
        let span = match course {
            Course::Straight(line) => cells.span_of_line(line, self.next),
            Course::Contracted { inverse, slowness } => {
                let span = contracted_span(cells, field.relative(self.path.position(u)), *inverse, *slowness);
                Span { distance: span.distance * per_step, ..span }
            }
        };
        let margin = T::of(MARGIN) + field.position_error * per_step;
        // 1e6 is within the range of `floor_i32`. At least one sample is passed, so the march always ends.
        let alike = (span.distance - margin).max(T::zero()).min(T::of(1e6)).floor_i32() as u32 + 1;
        // Samples in occupied cells are counted off without another look at the grid.
        if span.occupied {
            self.known = alike;
        } else {
            self.next = self.next.saturating_add(alike);
        }
        !span.occupied
    }

    /// The path's parameter at the next sample.
    #[inline(always)]
    fn parameter(&self, field: &Field<T>) -> f64 {
        self.span.0 + f64::from(self.next) * field.rules.step
    }
}

/// The span from `position` on in a contracted scene, in units of the path's parameter, along a path whose direction has
/// the reciprocals `inverse`, and whose speed on an axis is at most 1 over `slowness` where it is not straight.
#[inline(always)]
fn contracted_span<T: Real>(cells: &OccupancyCells<T>, position: [T; 3], inverse: [T; 3], slowness: T) -> Span<T> {
    let norm = position[0].abs().max(position[1].abs()).max(position[2].abs());
    if norm >= T::one() {
        // The path bends here, so the span is bounded in all directions by the largest speed of its coordinates.
        let around = cells.span_around(position);
        return Span { distance: around.distance * slowness, ..around };
    }
    // Straight up to the faces of the inner cube.
    let mut span = cells.span(position, inverse);
    for a in 0..3 {
        let face = if inverse[a] > T::zero() { T::one() } else { -T::one() };
        span.distance = span.distance.min((face - position[a]) * inverse[a]);
    }
    span
}

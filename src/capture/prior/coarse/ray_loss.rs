//! One ray: samples, the composited color, the loss and its gradients (DVGO, sections 3 and 5).

use super::grid::{Channels, CoarseGrid, Live, Scalar};
use strivec_format::geometry::{Aabb, Ray, RayPath};

/// Constants of compositing and of the loss.
#[derive(Clone, Copy, Debug)]
pub(super) struct CompositingConstants<T> {
    /// Added to the raw density before the softplus.
    pub(super) shift: T,
    /// The length of a sample in voxels of the finest grid.
    pub(super) interval: T,
    /// Samples of less raw density are skipped.
    pub(super) min_density: T,
    /// Rays end where their transmittance falls below this.
    pub(super) min_transmittance: T,
    /// sRGB color of the background.
    pub(super) background: [T; 3],
    /// Weight of the background entropy.
    pub(super) entropy: T,
    /// Weight of the samples' own color errors.
    pub(super) point_color: T,
    /// One over the number of rays of a step.
    pub(super) per_ray: T,
}

/// The sampled part of a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    course: SampleCourse,
    /// The first sample and the one after the last, counted from the start of the course.
    samples: (u32, u32),
}

/// The places of a ray's samples.
#[derive(Clone, Copy, Debug)]
enum SampleCourse {
    /// Even steps in the grid's space from `begin` on.
    Straight { origin: [f64; 3], direction: [f64; 3], begin: f64 },
    /// Even steps of the path's parameter, `step` apart, from `begin` on.
    Contracted { path: RayPath, begin: f64, step: f64 },
}

impl Segment {
    /// The samples of `ray` that lie in both `grid` and `live` and between the distances `near` and `far`, all in the
    /// grid's space. Samples are `step` apart, counted from where the ray enters `grid`.
    pub(super) fn new(ray: &Ray, grid: &Aabb, live: &Aabb, (near, far): (f64, f64), step: f64) -> Option<Self> {
        if !live.is_solid() {
            return None;
        }
        let (entry, exit) = grid.intersect(ray)?;
        let (live_entry, live_exit) = live.intersect(ray)?;
        let begin = entry.max(near);
        let end = exit.min(far).min(live_exit);
        if end <= begin {
            return None;
        }
        let first = ((live_entry - begin) / step).ceil().max(0.0) as u32;
        let last = ((end - begin) / step).ceil() as u32;
        let course =
            SampleCourse::Straight { origin: ray.origin.to_array(), direction: ray.direction.to_array(), begin };
        (first < last).then_some(Self { course, samples: (first, last) })
    }

    /// The samples of `path`, `step` apart in its parameter.
    pub(super) fn along(path: RayPath, step: f64) -> Option<Self> {
        let (begin, end) = path.span?;
        let last = ((end - begin) / step).ceil().max(0.0) as u32;
        (last > 0).then_some(Self { course: SampleCourse::Contracted { path, begin, step }, samples: (0, last) })
    }
}

/// A sample of a ray, with the gradient of the loss there.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sample<T> {
    /// The number of the smallest vertex of its cell.
    pub(super) first: u32,
    /// Position in the cell, in \[0, 1\].
    pub(super) fraction: [T; 3],
    /// ∂loss/∂(interpolated channels).
    pub(super) gradient: Channels<T>,
}

/// Intermediate values of a sample, kept for the backward pass.
#[derive(Clone, Copy)]
pub(super) struct Shaded<T> {
    color: [T; 3],
    /// Visibility weight: transmittance times α.
    pub(super) weight: T,
    /// Transmittance behind the sample.
    pub(super) after: T,
    /// interval · sigmoid(density): dα/d(density) / (1 − α).
    slope: T,
}

/// One ray's loss.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RayLoss<T> {
    /// Mean over channels of the squared error.
    pub(super) squared: T,
    /// The squared error plus the weighted entropy and point color terms. The gradients are those of its mean over the
    /// rays, with the weights in the point color term held constant. Only the check of the gradients reads it.
    #[cfg_attr(not(test), expect(dead_code, reason = "read by tests"))]
    pub(super) total: T,
}

/// The volume that rays pass through.
#[derive(Clone, Copy)]
pub(super) struct Medium<'a, T> {
    /// Densities and colors.
    pub(super) grid: &'a CoarseGrid<T>,
    /// Cells to sample.
    pub(super) live: &'a Live,
    /// Constants of compositing and of the loss.
    pub(super) shading: &'a CompositingConstants<T>,
    /// The distance between samples, in voxels.
    pub(super) step: T,
}

/// Marches along `segment`, appends its samples with their gradients to `samples`, and returns the loss. `shaded` then
/// holds the intermediate values of these samples.
#[inline(always)]
pub(super) fn trace<T: Scalar>(
    medium: &Medium<T>,
    segment: &Segment,
    target: [T; 3],
    samples: &mut Vec<Sample<T>>,
    shaded: &mut Vec<Shaded<T>>,
) -> RayLoss<T> {
    let Medium { grid, live, shading, step } = *medium;
    let start = samples.len();
    shaded.clear();
    let row = grid.vertices.x as usize;
    let last = [grid.vertices.x as usize - 2, grid.vertices.y as usize - 2, grid.vertices.z as usize - 2];
    let plane = grid.plane();
    let (entry, direction) = match segment.course {
        SampleCourse::Straight { origin, direction, begin } => {
            (std::array::from_fn(|a| T::of(origin[a] + begin * direction[a])), direction.map(T::of))
        }
        SampleCourse::Contracted { .. } => ([T::zero(); 3], [T::zero(); 3]),
    };
    let mut transmittance = T::one();
    let mut color = [T::zero(); 3];
    let mut point_color = T::zero();
    for k in segment.samples.0..segment.samples.1 {
        let place: [T; 3] = match &segment.course {
            SampleCourse::Straight { .. } => {
                let t = T::of(f64::from(k)) * step;
                std::array::from_fn(|a| entry[a] + t * direction[a])
            }
            SampleCourse::Contracted { path, begin, step } => {
                let place = grid.local(path.position(begin + f64::from(k) * step));
                if place.min_element() < 0.0 || place.cmpgt(grid.vertices.as_dvec3() - 1.0).any() {
                    continue;
                }
                place.to_array().map(T::of)
            }
        };
        let mut cell = [0_usize; 3];
        let mut fraction = [T::zero(); 3];
        for a in 0..3 {
            let at = place[a].max(T::zero());
            // Rounding may put a sample on the last vertex or just beyond it.
            cell[a] = at.to_usize().unwrap_or(0).min(last[a]);
            fraction[a] = (at - T::of(cell[a] as f64)).min(T::one());
        }
        let first = cell[2] * plane + cell[1] * row + cell[0];
        if !live.cells[first] {
            continue;
        }
        let raw = grid.interpolate(first, fraction);
        if raw[0] < shading.min_density {
            continue;
        }
        let (alpha, sigmoid_density) = activate(raw[0] + shading.shift, shading.interval);
        let rgb = [sigmoid(raw[1]), sigmoid(raw[2]), sigmoid(raw[3])];
        let weight = transmittance * alpha;
        let mut error = T::zero();
        for c in 0..3 {
            color[c] = color[c] + weight * rgb[c];
            error = error + (rgb[c] - target[c]).powi(2);
        }
        point_color = point_color + weight * error;
        transmittance = transmittance * (T::one() - alpha);
        samples.push(Sample { first: first as u32, fraction, gradient: [T::zero(); 4] });
        let slope = shading.interval * sigmoid_density;
        shaded.push(Shaded { color: rgb, weight, after: transmittance, slope });
        if transmittance < shading.min_transmittance {
            break;
        }
    }
    let third = T::of(1.0 / 3.0);
    let two = T::of(2.0);
    let mut squared = T::zero();
    let mut gradient = [T::zero(); 3];
    for c in 0..3 {
        let difference = color[c] + transmittance * shading.background[c] - target[c];
        squared = squared + difference * difference * third;
        gradient[c] = two * third * shading.per_ray * difference;
    }
    let (entropy, entropy_slope) = binary_entropy(transmittance);
    // The contribution of everything behind a sample: ∂loss/∂transmittance times the transmittance.
    let mut behind =
        transmittance * (dot(gradient, shading.background) + shading.entropy * shading.per_ray * entropy_slope);
    let own = two * shading.point_color * shading.per_ray;
    for (sample, s) in samples[start..].iter_mut().zip(shaded.iter()).rev() {
        let here = dot(gradient, s.color);
        sample.gradient[0] = s.slope * (s.after * here - behind);
        for c in 0..3 {
            let of_color = s.weight * (gradient[c] + own * (s.color[c] - target[c]));
            sample.gradient[c + 1] = of_color * s.color[c] * (T::one() - s.color[c]);
        }
        behind = behind + s.weight * here;
    }
    RayLoss { squared, total: squared + shading.entropy * entropy + shading.point_color * point_color }
}

/// α = 1 − (1 + e^x)^(−interval) and sigmoid(x) for the shifted density x. dα/dx = interval · (1 − α) · sigmoid(x).
#[inline(always)]
pub(super) fn activate<T: Scalar>(x: T, interval: T) -> (T, T) {
    if x < T::of(-10.0) {
        // Most samples are almost empty: e^x < 5e-5, where the error of these series is below f32's rounding.
        let e = x.exp();
        let thickness = interval * e * (T::one() - T::of(0.5) * e);
        let alpha = thickness * (T::one() - T::of(0.5) * thickness * (T::one() - T::of(1.0 / 3.0) * thickness));
        return (alpha, e * (T::one() - e * (T::one() - e)));
    }
    let e = (-x.abs()).exp();
    let softplus = x.max(T::zero()) + e.ln_1p();
    let small = T::one() / (T::one() + e);
    (-(-interval * softplus).exp_m1(), if x < T::zero() { e * small } else { small })
}

/// The raw density at which [`activate`] gives `alpha`, without the shift.
pub(super) fn density_of_alpha(alpha: f64, interval: f64) -> f64 {
    // e^x = (1 − α)^(−1/interval) − 1
    (-(-alpha).ln_1p() / interval).exp_m1().ln()
}

#[inline(always)]
fn sigmoid<T: Scalar>(x: T) -> T {
    T::one() / (T::one() + (-x).exp())
}

#[inline(always)]
fn dot<T: Scalar>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// −p·ln p − (1 − p)·ln(1 − p) with p clamped to \[1e-6, 1 − 1e-6\], and its derivative, which is 0 if p was clamped.
#[inline(always)]
fn binary_entropy<T: Scalar>(p: T) -> (T, T) {
    let (low, high) = (T::of(1e-6), T::of(1.0 - 1e-6));
    let kept = p.max(low).min(high);
    let (ln_p, ln_rest) = (kept.ln(), (T::one() - kept).ln());
    let slope = if p == kept { ln_rest - ln_p } else { T::zero() };
    (-(kept * ln_p + (T::one() - kept) * ln_rest), slope)
}

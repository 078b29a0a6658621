//! The point that cameras look at.

use glam::{DMat3, DVec3};

use super::Ray;

/// Optical axes count as parallel if the point nearest to all of them is ill-conditioned: a bound on the smallest
/// eigenvalue of the mean of I − a·aᵀ, which is the mean squared sine to the best common direction (about 0.6°).
const PARALLEL: f64 = 1e-4;

/// The point nearest, in the least squares sense, to all optical `axes`, if it is determined and lies in front of most
/// cameras. Directions must have length 1.
pub fn focus_of_axes(axes: impl Iterator<Item = Ray> + Clone) -> Option<DVec3> {
    let count = axes.clone().count() as f64;
    // Relative to the mean position, to avoid cancellation far from the origin.
    let center = axes.clone().map(|axis| axis.origin).sum::<DVec3>() / count;
    let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for axis in axes.clone() {
        let a = axis.direction;
        let across = DMat3::IDENTITY - DMat3::from_cols(a * a.x, a * a.y, a * a.z);
        normal += across * (1.0 / count);
        right += across * (axis.origin - center) / count;
    }
    // The eigenvalues lie in [0, 1] and add up to 2, so if the smallest is ε the others are at least 1 − ε and the
    // determinant is ε within a factor (1 − ε)².
    let determinant = normal.determinant();
    if determinant.is_nan() || determinant <= PARALLEL {
        return None;
    }
    let focus = center + normal.inverse() * right;
    let depths = axes.map(|axis| (focus - axis.origin).dot(axis.direction));
    let in_front = depths.clone().filter(|&d| d > 0.0).count() as f64;
    let mean_depth = depths.sum::<f64>() / count;
    (focus.is_finite() && mean_depth > 0.0 && in_front > 0.5 * count).then_some(focus)
}

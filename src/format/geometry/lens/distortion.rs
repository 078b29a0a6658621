//! Lens distortion in the picture plane, and its inverse.

use glam::{DMat2, DVec2};

/// The distortion of OpenCV's and COLMAP's camera models: a point p at distance r from the axis, both in units of the
/// focal length, goes to
///
///   p·(1 + a₁r² + a₂r⁴ + a₃r⁶ + a₄r⁸) / (1 + b₁r² + b₂r⁴ + b₃r⁶)
///     + (2·t₁·x·y + t₂·(r² + 2x²) + s₁·r², t₁·(r² + 2y²) + 2·t₂·x·y + s₂·r²)
///
/// with x to the right and y down. Its inverse is unique up to [`Distortion::max_radius`]; beyond it the picture
/// folds over itself, and points have no inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(into = "Coefficients", try_from = "Coefficients")
)]
pub struct Distortion {
    radial: [f64; 4],
    divisor: [f64; 3],
    tangential: [f64; 2],
    prism: [f64; 2],
    max_radius: f64,
}

/// The coefficients of a [`Distortion`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Coefficients {
    /// a₁ to a₄.
    pub radial: [f64; 4],
    /// b₁ to b₃.
    pub divisor: [f64; 3],
    /// t₁ and t₂.
    pub tangential: [f64; 2],
    /// s₁ and s₂.
    pub prism: [f64; 2],
}

impl From<Distortion> for Coefficients {
    fn from(Distortion { radial, divisor, tangential, prism, .. }: Distortion) -> Self {
        Self { radial, divisor, tangential, prism }
    }
}

impl TryFrom<Coefficients> for Distortion {
    type Error = &'static str;

    fn try_from(Coefficients { radial, divisor, tangential, prism }: Coefficients) -> Result<Self, Self::Error> {
        Self::new(radial, divisor, tangential, prism).ok_or("the coefficients of a distortion must be finite numbers")
    }
}

/// Points farther from the axis than this, in focal lengths, have no inverse.
const MAX_RADIUS: f64 = 1e3;
/// The inverse has converged if its distorted point is this close, relative to the point's size or 1.
const TOLERANCE: f64 = 1e-13;
/// Newton steps; those from a radial start that converge take five or fewer.
const MAX_STEPS: usize = 30;

impl Distortion {
    /// No distortion.
    pub const NONE: Self =
        Self { radial: [0.0; 4], divisor: [0.0; 3], tangential: [0.0; 2], prism: [0.0; 2], max_radius: MAX_RADIUS };

    /// The distortion of these coefficients: `radial` a₁ to a₄, `divisor` b₁ to b₃, `tangential` t₁ and t₂ (OpenCV's p₁
    /// and p₂), `prism` s₁ and s₂. `None` if one is not finite.
    pub fn new(radial: [f64; 4], divisor: [f64; 3], tangential: [f64; 2], prism: [f64; 2]) -> Option<Self> {
        let all = [&radial[..], &divisor, &tangential, &prism].concat();
        all.iter().all(|v| v.is_finite()).then(|| {
            let max_radius = fold(&radial, &divisor);
            Self { radial, divisor, tangential, prism, max_radius }
        })
    }

    /// True if points stay where they are.
    pub fn is_none(&self) -> bool {
        Self { max_radius: MAX_RADIUS, ..*self } == Self::NONE
    }

    /// The distance from the axis, before distortion, up to which the radial part is increasing and so has an inverse.
    pub fn max_radius(&self) -> f64 {
        self.max_radius
    }

    /// The image of `point` under the distortion, in normalized coordinates.
    pub fn distorted(&self, point: DVec2) -> DVec2 {
        self.with_jacobian(point).0
    }

    /// The point that goes to `distorted`. `None` if there is none on this side of the fold.
    pub fn undistorted(&self, distorted: DVec2) -> Option<DVec2> {
        if self.is_none() {
            return Some(distorted);
        }
        let mut point = self.radial_inverse(distorted);
        let scale = distorted.length().max(1.0);
        for _ in 0..MAX_STEPS {
            let (value, jacobian) = self.with_jacobian(point);
            let residual = value - distorted;
            let determinant = jacobian.determinant();
            // Where the picture folds, the determinant changes its sign.
            if determinant <= 0.0 || !residual.is_finite() || point.length() > self.max_radius * (1.0 + 1e-9) {
                return None;
            }
            if residual.length() <= TOLERANCE * scale {
                return Some(point);
            }
            point -= jacobian.inverse() * residual;
        }
        None
    }

    /// The image of `point` under the distortion, and the derivative by `point`.
    fn with_jacobian(&self, point: DVec2) -> (DVec2, DMat2) {
        let DVec2 { x, y } = point;
        let s = point.length_squared();
        let [n, dn] = polynomial(&self.radial, s);
        let [d, dd] = polynomial(&self.divisor, s);
        let radial = n / d;
        // The derivative of `radial` by s. The gradient of s is 2·(x, y).
        let slope = (dn * d - n * dd) / (d * d);
        let [t1, t2] = self.tangential;
        let [s1, s2] = self.prism;
        let value = point * radial
            + DVec2::new(
                2.0 * t1 * x * y + t2 * (s + 2.0 * x * x) + s1 * s,
                t1 * (s + 2.0 * y * y) + 2.0 * t2 * x * y + s2 * s,
            );
        let by_x = DVec2::new(
            radial + 2.0 * x * x * slope + 2.0 * t1 * y + 6.0 * t2 * x + 2.0 * s1 * x,
            2.0 * x * y * slope + 2.0 * t1 * x + 2.0 * t2 * y + 2.0 * s2 * x,
        );
        let by_y = DVec2::new(
            2.0 * x * y * slope + 2.0 * t1 * x + 2.0 * t2 * y + 2.0 * s1 * y,
            radial + 2.0 * y * y * slope + 6.0 * t1 * y + 2.0 * t2 * x + 2.0 * s2 * y,
        );
        (value, DMat2::from_cols(by_x, by_y))
    }

    /// The inverse of the radial part alone by bisection, which cannot diverge as the part is increasing.
    fn radial_inverse(&self, distorted: DVec2) -> DVec2 {
        let wanted = distorted.length();
        if wanted == 0.0 {
            return distorted;
        }
        let at = |r: f64| r * polynomial(&self.radial, r * r)[0] / polynomial(&self.divisor, r * r)[0];
        let (mut low, mut high) = (0.0, self.max_radius);
        // As near as Newton's method needs it to double its digits.
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if at(middle) < wanted { low = middle } else { high = middle }
        }
        distorted / wanted * (0.5 * (low + high))
    }
}

/// 1 + c₁s + c₂s² + …, and its derivative.
fn polynomial(coefficients: &[f64], s: f64) -> [f64; 2] {
    let (mut value, mut slope) = (0.0, 0.0);
    for &c in coefficients.iter().rev() {
        slope = slope * s + value;
        value = value * s + c;
    }
    // value is c₁ + c₂s + …, slope its derivative.
    [1.0 + s * value, value + s * slope]
}

/// The smallest r > 0 at which the radial part stops increasing or its divisor is zero; at most [`MAX_RADIUS`].
fn fold(radial: &[f64; 4], divisor: &[f64; 3]) -> f64 {
    let n: Vec<f64> = std::iter::once(1.0).chain(*radial).collect();
    let d: Vec<f64> = std::iter::once(1.0).chain(*divisor).collect();
    // d/dr of r·n(r²)/d(r²) is (n·d + 2s·(n'·d − n·d'))/d² with s = r².
    let slope = |p: &[f64]| (1..p.len()).map(|k| k as f64 * p[k]).collect::<Vec<_>>();
    let product = |a: &[f64], b: &[f64]| {
        let mut all = vec![0.0; a.len() + b.len() - 1];
        a.iter().enumerate().for_each(|(i, a)| b.iter().enumerate().for_each(|(j, b)| all[i + j] += a * b));
        all
    };
    let mut increase = product(&n, &d);
    let difference = product(&slope(&n), &d).into_iter().zip(product(&n, &slope(&d)).into_iter().chain([0.0]));
    for (k, (a, b)) in difference.enumerate() {
        if k + 1 < increase.len() {
            increase[k + 1] += 2.0 * (a - b);
        }
    }
    let most = MAX_RADIUS * MAX_RADIUS;
    let first = |p: &[f64]| roots(p, most).first().copied().unwrap_or(most);
    first(&increase).min(first(&d)).sqrt()
}

/// The roots of Σ c_k·sᵏ in (0, `most`] at which it changes its sign, ascending. Between two roots of its derivative a
/// polynomial is monotone, so that each interval holds at most one.
fn roots(coefficients: &[f64], most: f64) -> Vec<f64> {
    if coefficients.len() < 2 {
        return Vec::new();
    }
    let value = |s: f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * s + c);
    let slope: Vec<f64> = (1..coefficients.len()).map(|k| k as f64 * coefficients[k]).collect();
    let mut ends = vec![0.0];
    ends.extend(roots(&slope, most));
    ends.push(most);
    let mut found = Vec::new();
    for pair in ends.windows(2) {
        let [mut low, mut high] = [pair[0], pair[1]];
        let is_positive = value(low) > 0.0;
        if is_positive == (value(high) > 0.0) {
            continue;
        }
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if (value(middle) > 0.0) == is_positive { low = middle } else { high = middle }
        }
        found.push(high);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some() -> Vec<Distortion> {
        vec![
            Distortion::new([0.0578421, -0.0805099, 0.0, 0.0], [0.0; 3], [-0.000980296, 0.00015575], [0.0; 2]).unwrap(),
            Distortion::new([-0.35, 0.12, 0.01, 0.0], [0.02, -0.01, 0.003], [0.001, -0.002], [0.0; 2]).unwrap(),
            Distortion::new([-0.04, 0.003, -0.001, 0.0002], [0.0; 3], [1e-3, 2e-3], [1e-3, -5e-4]).unwrap(),
            Distortion::new([-0.3, 0.0, 0.0, 0.0], [0.0; 3], [0.0; 2], [0.0; 2]).unwrap(),
        ]
    }

    #[test]
    fn inverse_comes_back_up_to_the_fold() {
        for distortion in some() {
            let reach = 0.98 * distortion.max_radius().min(1.5);
            for i in 0..400 {
                let (r, angle) = (reach * f64::from(i % 20) / 20.0, f64::from(i) * 0.7);
                let point = r * DVec2::from_angle(angle);
                let back = distortion.undistorted(distortion.distorted(point));
                let error = back.map_or(f64::INFINITY, |back| (back - point).length());
                assert!(error < 1e-10, "{distortion:?} at {point}: {back:?}");
            }
        }
    }

    #[test]
    fn jacobian_is_the_derivative() {
        let h = 1e-6;
        for distortion in some() {
            for at in [DVec2::new(0.3, -0.2), DVec2::new(-0.5, 0.4), DVec2::ZERO] {
                let (_, jacobian) = distortion.with_jacobian(at);
                let by = |d: DVec2| (distortion.distorted(at + h * d) - distortion.distorted(at - h * d)) / (2.0 * h);
                assert!((jacobian.x_axis - by(DVec2::X)).length() < 1e-9, "{distortion:?}");
                assert!((jacobian.y_axis - by(DVec2::Y)).length() < 1e-9, "{distortion:?}");
            }
        }
    }

    #[test]
    fn beyond_the_fold_there_is_no_inverse() {
        // r − 0.3r³ is largest at r = 1/√0.9.
        let distortion = some()[3];
        assert!((distortion.max_radius() - 1.0 / 0.9f64.sqrt()).abs() < 1e-12);
        let largest = distortion.distorted(DVec2::X * distortion.max_radius()).x;
        assert!(distortion.undistorted(DVec2::Y * (largest - 1e-6)).is_some());
        assert!(distortion.undistorted(DVec2::Y * (largest + 1e-6)).is_none());
        assert!(distortion.undistorted(DVec2::splat(f64::NAN)).is_none());
        assert!(Distortion::new([f64::NAN, 0.0, 0.0, 0.0], [0.0; 3], [0.0; 2], [0.0; 2]).is_none());
        // A divisor that reaches zero at r = 2.
        let pole = Distortion::new([0.0; 4], [-0.25, 0.0, 0.0], [0.0; 2], [0.0; 2]).unwrap();
        assert!((pole.max_radius() - 2.0).abs() < 1e-12, "{}", pole.max_radius());
    }
}

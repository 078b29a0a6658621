//! The sky: the color behind the scene by direction, and the gradients of its coefficients (spec 4.11). Twin:
//! `shaders/sky.wgsl`.

use glam::DVec3;

use super::Real;
use strivec_format::model::{SKY_NORMS, Sky};

/// Coefficients are clamped to this magnitude, so that sums of them are finite in f32.
const MAX_COEFFICIENT: f32 = 1e30;

/// A scene's sky in the field's precision.
#[derive(Clone, Debug)]
pub struct FieldSky<T> {
    /// L, 1 to 4.
    pub degree: u32,
    /// \[channel\]\[(L + 1)²\] coefficients.
    pub coefficients: Vec<T>,
}

/// The basis functions without their factors N, in the order of l² + l + m.
#[inline(always)]
fn polynomials<T: Real>([x, y, z]: [T; 3]) -> [T; Sky::MAX_TERMS] {
    let number = |v: f64| T::of(v);
    let (x2, y2, z2) = (x * x, y * y, z * z);
    let (difference, product) = (x2 - y2, x * y);
    let (sine3, cosine3) = (y * (number(3.0) * x2 - y2), x * (x2 - number(3.0) * y2));
    let (five, seven) = (number(5.0) * z2, number(7.0) * z2);
    let one = T::one();
    [
        one,
        y,
        z,
        x,
        product,
        y * z,
        number(3.0) * z2 - one,
        x * z,
        difference,
        sine3,
        product * z,
        y * (five - one),
        z * (five - number(3.0)),
        x * (five - one),
        z * difference,
        cosine3,
        product * difference,
        z * sine3,
        product * (seven - one),
        y * z * (seven - number(3.0)),
        z2 * (number(35.0) * z2 - number(30.0)) + number(3.0),
        x * z * (seven - number(3.0)),
        difference * (seven - one),
        z * cosine3,
        difference * difference - number(4.0) * product * product,
    ]
}

impl<T: Real> FieldSky<T> {
    /// Prepares `sky`.
    pub fn new(sky: &Sky) -> Self {
        let number = |c: &f32| T::of_f32(c.clamp(-MAX_COEFFICIENT, MAX_COEFFICIENT));
        Self { degree: sky.degree, coefficients: sky.coefficients.iter().map(number).collect() }
    }

    /// The basis functions at the unit vector `direction`, in model space.
    #[inline(always)]
    fn basis(direction: DVec3) -> [T; Sky::MAX_TERMS] {
        let mut basis = polynomials(direction.to_array().map(T::of));
        basis.iter_mut().zip(SKY_NORMS).for_each(|(y, norm)| *y *= T::of(norm));
        basis
    }

    /// The color in `direction`, a unit vector in model space.
    #[inline(always)]
    pub fn color(&self, direction: DVec3) -> [T; 3] {
        let basis = Self::basis(direction);
        let mut color = [T::zero(); 3];
        for (channel, row) in color.iter_mut().zip(self.coefficients.chunks_exact(Sky::terms(self.degree))) {
            let mut sum = T::zero();
            for (&c, y) in row.iter().zip(basis) {
                sum += c * y;
            }
            // A sigmoid and no clamp, whose gradient is zero.
            *channel = T::one() / (T::one() + (-sum).exp());
        }
        color
    }

    /// Adds the gradients of the coefficients to `gradients`, which are laid out like them: those by way of `color`,
    /// [`FieldSky::color`] in `direction`, whose gradient is `color_gradient`.
    #[inline(always)]
    pub fn add_gradients(&self, direction: DVec3, color: [T; 3], color_gradient: [T; 3], gradients: &mut [T]) {
        let basis = Self::basis(direction);
        for (channel, row) in gradients.chunks_exact_mut(Sky::terms(self.degree)).enumerate() {
            // c·(1 − c) is the derivative of the sigmoid.
            let slope = color_gradient[channel] * color[channel] * (T::one() - color[channel]);
            row.iter_mut().zip(basis).for_each(|(sum, y)| *sum += slope * y);
        }
    }

    /// \[term\] red, green and blue coefficients times the factor N of the term, so that the color is the sigmoid of a
    /// sum over polynomials.
    #[cfg(feature = "gpu")]
    pub fn polynomial_coefficients(&self) -> Vec<[f32; 3]> {
        let terms = Sky::terms(self.degree);
        let of_term = |k: usize| [0, 1, 2].map(|c| (self.coefficients[c * terms + k].f64() * SKY_NORMS[k]) as f32);
        (0..terms).map(of_term).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::random::Random;

    fn directions() -> impl Iterator<Item = DVec3> {
        let random = Random::new(3, "sky");
        let drawn = move |n: u64| DVec3::from_array([0, 1, 2].map(|a| random.normal(3 * n + a))).normalize();
        (0..200).map(drawn).chain(DVec3::AXES).chain(DVec3::AXES.map(|axis| -axis))
    }

    fn sky(degree: u32, size: f64) -> Sky {
        let random = Random::new(u64::from(degree), "coefficients");
        let draw = |k| (size * random.normal(k)) as f32;
        Sky { degree, coefficients: (0..3 * Sky::terms(degree) as u64).map(draw).collect() }
    }

    /// The largest difference of `found` to `sky` in units of the condition.
    fn apart<T: Real>(sky: &Sky, found: &FieldSky<T>) -> f64 {
        let of_direction = |direction: DVec3| {
            let (expected, found) = (sky.color(direction), found.color(direction));
            let difference = (0..3).map(|c| (expected[c] - found[c].f64()).abs()).fold(0.0, f64::max);
            difference / (sky.condition(direction) + 1.0)
        };
        directions().map(of_direction).fold(0.0, f64::max)
    }

    #[test]
    fn colors_are_the_models_in_both_precisions() {
        for degree in 1..=Sky::MAX_DEGREE {
            for size in [0.1, 3.0, 100.0] {
                let mut sky = sky(degree, size);
                let (single, double) = (FieldSky::<f32>::new(&sky), FieldSky::<f64>::new(&sky));
                let found = [apart(&sky, &single), apart(&sky, &double)];
                assert!(found[0] < 8.0 * f64::from(f32::EPSILON) && found[1] < 1e-14, "{degree}, {size}: {found:?}");
                // The last coefficient counts.
                *sky.coefficients.last_mut().unwrap() += 1e-3;
                assert!(apart(&sky, &single) > 1e-5 || size > 10.0, "{degree}, {size}");
            }
        }
    }

    #[test]
    fn the_largest_coefficients_give_finite_colors() {
        let mut sky = sky(4, 1.0);
        sky.coefficients.iter_mut().for_each(|c| *c = f32::MAX.copysign(*c));
        let single = FieldSky::<f32>::new(&sky);
        for color in directions().map(|direction| single.color(direction)) {
            assert!(color.iter().all(|c| (0.0..=1.0).contains(c)), "{color:?}");
        }
    }
}

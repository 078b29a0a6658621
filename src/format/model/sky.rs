//! The sky: a color behind the scene that depends on the direction alone (spec 4.11).

use glam::DVec3;

use crate::Invalid;

/// N of each basis function Y = N·polynomial (spec 4.11), in the order of l² + l + m.
pub const SKY_NORMS: [f64; Sky::MAX_TERMS] = [
    // √(1/π)/2
    0.282_094_791_773_878_14,
    // √(3/π)/2
    0.488_602_511_902_919_9,
    0.488_602_511_902_919_9,
    0.488_602_511_902_919_9,
    // √(15/π)/2, √(5/π)/4, √(15/π)/4
    1.092_548_430_592_079_2,
    1.092_548_430_592_079_2,
    0.315_391_565_252_520_05,
    1.092_548_430_592_079_2,
    0.546_274_215_296_039_6,
    // √(35/2π)/4, √(105/π)/2, √(21/2π)/4, √(7/π)/4, √(105/π)/4
    0.590_043_589_926_643_5,
    2.890_611_442_640_554,
    0.457_045_799_464_465_8,
    0.373_176_332_590_115_4,
    0.457_045_799_464_465_8,
    1.445_305_721_320_277,
    0.590_043_589_926_643_5,
    // 3√(35/π)/4, 3√(35/2π)/4, 3√(5/π)/4, 3√(5/2π)/4, 3√(1/π)/16, 3√(5/π)/8, 3√(35/π)/16
    2.503_342_941_796_704_6,
    1.770_130_769_779_930_5,
    0.946_174_695_757_560_1,
    0.669_046_543_557_289_2,
    0.105_785_546_915_204_3,
    0.669_046_543_557_289_2,
    0.473_087_347_878_780_05,
    1.770_130_769_779_930_5,
    0.625_835_735_449_176_2,
];

/// The color behind the scene, by real spherical harmonics: sigmoid(Σ c·Y(d)) for each channel (spec 4.11).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Sky {
    /// L, the largest degree of the basis, 1 to [`Sky::MAX_DEGREE`].
    pub degree: u32,
    /// \[channel\]\[(L + 1)²\] coefficients, basis functions in the order of l² + l + m.
    pub coefficients: Vec<f32>,
}

impl Sky {
    /// The largest degree.
    pub const MAX_DEGREE: u32 = 4;
    /// The basis functions of the largest degree.
    pub const MAX_TERMS: usize = Self::terms(Self::MAX_DEGREE);

    /// The sky of this degree whose coefficients are 0: gray in every direction.
    pub fn gray(degree: u32) -> Self {
        Self { degree, coefficients: vec![0.0; 3 * Self::terms(degree)] }
    }

    /// The sky of this degree whose color is `color`, limited to 0.1 to 0.9, in every direction.
    pub fn of_color(degree: u32, color: [f32; 3]) -> Self {
        let mut sky = Self::gray(degree);
        for (row, channel) in sky.coefficients.chunks_exact_mut(Self::terms(degree)).zip(color) {
            let channel = channel.clamp(0.1, 0.9);
            row[0] = (channel / (1.0 - channel)).ln() / SKY_NORMS[0] as f32;
        }
        sky
    }

    /// (L + 1)², the number of basis functions of a sky of degree L.
    pub const fn terms(degree: u32) -> usize {
        (degree as usize + 1).pow(2)
    }

    /// All basis functions at the unit vector `direction`, in model space (spec 4.11).
    pub fn basis(direction: DVec3) -> [f64; Self::MAX_TERMS] {
        let [x, y, z] = direction.to_array();
        let polynomials = [
            1.0,
            // l = 1
            y,
            z,
            x,
            // l = 2
            x * y,
            y * z,
            3.0 * z * z - 1.0,
            x * z,
            x * x - y * y,
            // l = 3
            y * (3.0 * x * x - y * y),
            x * y * z,
            y * (5.0 * z * z - 1.0),
            z * (5.0 * z * z - 3.0),
            x * (5.0 * z * z - 1.0),
            z * (x * x - y * y),
            x * (x * x - 3.0 * y * y),
            // l = 4
            x * y * (x * x - y * y),
            y * z * (3.0 * x * x - y * y),
            x * y * (7.0 * z * z - 1.0),
            y * z * (7.0 * z * z - 3.0),
            35.0 * z.powi(4) - 30.0 * z * z + 3.0,
            x * z * (7.0 * z * z - 3.0),
            (x * x - y * y) * (7.0 * z * z - 1.0),
            x * z * (x * x - 3.0 * y * y),
            x.powi(4) - 6.0 * x * x * y * y + y.powi(4),
        ];
        std::array::from_fn(|k| SKY_NORMS[k] * polynomials[k])
    }

    /// The color, sRGB in \[0, 1\], in the direction of the unit vector `direction` from the camera, in model space.
    ///
    /// # Examples
    ///
    /// ```
    /// use glam::DVec3;
    /// use strivec_format::model::Sky;
    ///
    /// let mut sky = Sky::gray(1);
    /// assert_eq!(sky.color(DVec3::Z), [0.5; 3]);
    /// assert!((Sky::of_color(2, [0.2, 0.5, 0.8]).color(DVec3::X)[2] - 0.8).abs() < 1e-6);
    /// // The blue channel's coefficient of z.
    /// sky.coefficients[2 * Sky::terms(1) + 2] = 3.0;
    /// assert!(sky.color(DVec3::Z)[2] > 0.8 && sky.color(DVec3::NEG_Z)[2] < 0.2);
    /// ```
    pub fn color(&self, direction: DVec3) -> [f64; 3] {
        let basis = Self::basis(direction);
        let rows = self.coefficients.chunks_exact(Self::terms(self.degree));
        let mut color = [0.0; 3];
        for (channel, row) in color.iter_mut().zip(rows) {
            let sum: f64 = row.iter().zip(basis).map(|(&c, y)| f64::from(c) * y).sum();
            *channel = 1.0 / (1.0 + (-sum).exp());
        }
        color
    }

    /// The largest change of a channel of the color in `direction`, to first order and in units of ε, if every product
    /// c·Y has a relative error of ε.
    pub fn condition(&self, direction: DVec3) -> f64 {
        let basis = Self::basis(direction);
        let rows = self.coefficients.chunks_exact(Self::terms(self.degree));
        let of_channel = |(color, row): (f64, &[f32])| {
            color * (1.0 - color) * row.iter().zip(basis).map(|(&c, y)| (f64::from(c) * y).abs()).sum::<f64>()
        };
        self.color(direction).into_iter().zip(rows).map(of_channel).fold(0.0, f64::max)
    }

    pub(super) fn check(&self) -> Result<(), Invalid> {
        if !(1..=Self::MAX_DEGREE).contains(&self.degree) {
            let expected = format!("1 to {}", Self::MAX_DEGREE);
            return Err(Invalid::new("rules sky's degree", expected, self.degree));
        }
        let count = 3 * Self::terms(self.degree);
        Invalid::unless_equal(|| "rules sky's number of coefficients".into(), count, self.coefficients.len())?;
        Invalid::unless_finite(|| "rules sky's coefficients".into(), &self.coefficients)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of Y_i·Y_j over the sphere times 4π, by midpoints in longitude and Gauss-Legendre nodes in z, which
    /// integrate these polynomials exactly.
    fn products() -> Vec<Vec<f64>> {
        // Five nodes: exact up to degree 9.
        let root = 2.0 * (10.0_f64 / 7.0).sqrt();
        let (inner, outer) = ((5.0 - root).sqrt() / 3.0, (5.0 + root).sqrt() / 3.0);
        let (of_inner, of_outer) = ((322.0 + 13.0 * 70.0_f64.sqrt()) / 900.0, (322.0 - 13.0 * 70.0_f64.sqrt()) / 900.0);
        let nodes =
            [(0.0, 128.0 / 225.0), (inner, of_inner), (-inner, of_inner), (outer, of_outer), (-outer, of_outer)];
        let mut sums = vec![vec![0.0; Sky::MAX_TERMS]; Sky::MAX_TERMS];
        const TURN: u32 = 16;
        for (z, weight) in nodes {
            for n in 0..TURN {
                let angle = std::f64::consts::TAU * (f64::from(n) + 0.3) / f64::from(TURN);
                let radius = (1.0 - z * z).sqrt();
                let basis = Sky::basis(DVec3::new(radius * angle.cos(), radius * angle.sin(), z));
                for (row, a) in sums.iter_mut().zip(basis) {
                    for (sum, b) in row.iter_mut().zip(basis) {
                        *sum += std::f64::consts::TAU * weight * a * b / f64::from(TURN);
                    }
                }
            }
        }
        sums
    }

    #[test]
    fn the_basis_is_orthonormal() {
        for (i, row) in products().iter().enumerate() {
            for (j, product) in row.iter().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 1e-14, "{i}, {j}: {product}");
            }
        }
    }

    #[test]
    fn functions_are_in_the_order_of_the_specification() {
        // The zonal functions of m = 0 are at l² + l, and positive along z.
        let up = Sky::basis(DVec3::Z);
        for l in 0..=4usize {
            let expected = ((2 * l + 1) as f64 / (4.0 * std::f64::consts::PI)).sqrt();
            assert!((up[l * l + l] - expected).abs() < 1e-15, "{l}");
            let others = (l * l..(l + 1) * (l + 1)).filter(|&k| k != l * l + l);
            assert!(others.map(|k| up[k]).all(|y| y == 0.0), "{l}");
        }
        // Degree 1 is y, z, x.
        for (k, axis) in [(1, DVec3::Y), (2, DVec3::Z), (3, DVec3::X)] {
            assert!(Sky::basis(axis)[k] > 0.4 && Sky::basis(-axis)[k] < -0.4);
        }
    }

    #[test]
    fn the_condition_is_the_change_by_a_relative_error_of_the_terms() {
        let mut sky = Sky::gray(2);
        sky.coefficients.iter_mut().enumerate().for_each(|(k, c)| *c = if k % 2 == 0 { 2.0 } else { -1.5 });
        let direction = DVec3::new(0.48, -0.6, 0.64);
        let basis = Sky::basis(direction);
        let mut worst = sky.clone();
        for (k, c) in worst.coefficients.iter_mut().enumerate() {
            let sign = f64::from(*c) * basis[k % 9];
            *c *= 1.0 + 1e-4 * sign.signum() as f32;
        }
        let [one, other] = [&sky, &worst].map(|sky| sky.color(direction));
        let found = (0..3).map(|c| (one[c] - other[c]).abs()).fold(0.0, f64::max);
        let expected = 1e-4 * sky.condition(direction);
        assert!((found / expected - 1.0).abs() < 1e-2, "{found:e}, {expected:e}");
    }
}

//! Affine maps of colors: what exposure and white balance make of a picture, and their fit in closed form.

use glam::{DMat3, DMat4, DVec3, DVec4};

/// The affine map of a color.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorMap {
    /// The linear part.
    pub matrix: DMat3,
    /// The image of black.
    pub offset: DVec3,
}

impl ColorMap {
    /// The map that changes nothing.
    pub const IDENTITY: Self = Self { matrix: DMat3::IDENTITY, offset: DVec3::ZERO };

    /// The image of `color`, which may be outside \[0, 1\].
    #[inline]
    pub fn apply(&self, color: [f64; 3]) -> [f64; 3] {
        (self.matrix * DVec3::from(color) + self.offset).into()
    }

    /// The gradient of a function of the image, `gradient`, as one of the color.
    #[inline]
    pub fn pull_back(&self, gradient: [f64; 3]) -> [f64; 3] {
        (self.matrix.transpose() * DVec3::from(gradient)).into()
    }
}

/// Sums over pairs of colors, from which the affine map of least squares between them follows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ColorFit {
    /// Σ x·xᵀ, with x the first color of a pair and a 1.
    inputs: [DVec4; 4],
    /// \[channel\] Σ y·x, with y the channel of the second color.
    products: [DVec4; 3],
    /// Σ |y|².
    squares: f64,
}

impl ColorFit {
    /// Numbers of [`ColorFit::to_numbers`].
    pub const NUMBERS: usize = 29;

    /// Adds a pair, which counts `weight` times.
    pub fn add(&mut self, from: [f32; 3], to: [f32; 3], weight: f64) {
        let x = DVec3::from(from.map(f64::from)).extend(1.0);
        let y = to.map(f64::from);
        for i in 0..4 {
            self.inputs[i] += weight * x[i] * x;
        }
        for (sum, y) in self.products.iter_mut().zip(y) {
            *sum += weight * y * x;
        }
        self.squares += weight * y.iter().map(|v| v * v).sum::<f64>();
    }

    /// Counts all pairs so far `factor` times.
    pub fn scale(&mut self, factor: f64) {
        self.inputs.iter_mut().chain(&mut self.products).for_each(|sum| *sum *= factor);
        self.squares *= factor;
    }

    /// The pairs, as far as they count.
    pub fn count(&self) -> f64 {
        self.inputs[3].w
    }

    /// The map that minimizes Σ |map(x) − y|² plus `ridge` times the squared difference to the identity: of its entries,
    /// Frobenius' norm.
    pub fn map(&self, ridge: f64) -> ColorMap {
        let sums = DMat4::from_cols(self.inputs[0], self.inputs[1], self.inputs[2], self.inputs[3]);
        let inverse = (sums + DMat4::from_diagonal(DVec4::splat(ridge))).inverse();
        let identity = [DVec4::X, DVec4::Y, DVec4::Z];
        let rows = [0, 1, 2].map(|c| inverse * (self.products[c] + ridge * identity[c]));
        let matrix = DMat3::from_cols(rows[0].truncate(), rows[1].truncate(), rows[2].truncate()).transpose();
        let map = ColorMap { matrix, offset: DVec3::from(rows.map(|row| row.w)) };
        if map.matrix.is_finite() && map.offset.is_finite() { map } else { ColorMap::IDENTITY }
    }

    /// Σ |map(x) − y|².
    pub fn squared_error(&self, map: &ColorMap) -> f64 {
        let sums = DMat4::from_cols(self.inputs[0], self.inputs[1], self.inputs[2], self.inputs[3]);
        let of_channel = |c: usize| {
            let row = map.matrix.row(c).extend(map.offset[c]);
            row.dot(sums * row) - 2.0 * row.dot(self.products[c])
        };
        (self.squares + (0..3).map(of_channel).sum::<f64>()).max(0.0)
    }

    /// All sums, for [`ColorFit::from_numbers`].
    pub fn to_numbers(&self) -> [f64; Self::NUMBERS] {
        let mut numbers = [self.squares; Self::NUMBERS];
        let vectors = self.inputs.iter().chain(&self.products);
        numbers.chunks_exact_mut(4).zip(vectors).for_each(|(to, from)| to.copy_from_slice(&from.to_array()));
        numbers
    }

    /// The sums of [`ColorFit::to_numbers`].
    pub fn from_numbers(numbers: &[f64; Self::NUMBERS]) -> Self {
        let vector = |n: usize| DVec4::from_slice(&numbers[4 * n..]);
        let inputs = [0, 1, 2, 3].map(vector);
        Self { inputs, products: [4, 5, 6].map(vector), squares: numbers[Self::NUMBERS - 1] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made() -> ColorMap {
        let matrix =
            DMat3::from_cols(DVec3::new(1.2, 0.05, 0.0), DVec3::new(0.0, 0.9, 0.1), DVec3::new(-0.1, 0.0, 0.8));
        ColorMap { matrix, offset: DVec3::new(0.02, -0.03, 0.05) }
    }

    fn colors() -> impl Iterator<Item = [f32; 3]> {
        (0..200_u8).map(|n| [0.618_034, 0.754_878, 0.569_840].map(|step| (f32::from(n) * step).fract()))
    }

    fn fit_of(map: &ColorMap) -> ColorFit {
        let mut fit = ColorFit::default();
        for color in colors() {
            fit.add(color, map.apply(color.map(f64::from)).map(|v| v as f32), 1.0);
        }
        fit
    }

    #[test]
    fn the_map_that_made_the_pairs_is_found() {
        let (map, fit) = (made(), fit_of(&made()));
        let found = fit.map(1e-9);
        assert!((found.matrix - map.matrix).to_cols_array().iter().all(|d| d.abs() < 1e-6), "{found:?}");
        assert!((found.offset - map.offset).length() < 1e-6);
        assert!(fit.squared_error(&found) < 1e-9 && fit.squared_error(&ColorMap::IDENTITY) > 0.5);
        assert_eq!((fit.count(), ColorFit::from_numbers(&fit.to_numbers())), (200.0, fit));
    }

    #[test]
    fn pairs_that_say_nothing_leave_the_identity() {
        assert_eq!(ColorFit::default().map(1.0), ColorMap::IDENTITY);
        assert_eq!(ColorFit::default().map(0.0), ColorMap::IDENTITY, "no inverse");
        let weak = fit_of(&made()).map(1e9);
        assert!((weak.matrix - DMat3::IDENTITY).to_cols_array().iter().all(|d| d.abs() < 1e-6));
        let mut faded = fit_of(&made());
        faded.scale(1e-6);
        assert!((faded.count() - 2e-4).abs() < 1e-12);
    }

    #[test]
    fn gradients_are_those_of_finite_differences() {
        let (map, at, along) = (made(), [0.3, 0.6, 0.1], [0.7, -0.2, 0.4]);
        let value = |color: [f64; 3]| map.apply(color).iter().zip(along).map(|(v, a)| v * a).sum::<f64>();
        let gradient = map.pull_back(along);
        for c in 0..3 {
            let moved = |by: f64| {
                let mut color = at;
                color[c] += by;
                value(color)
            };
            assert!((gradient[c] - (moved(0.5) - moved(-0.5))).abs() < 1e-12);
        }
    }
}

//! Regular grids of numbers over a box, and the box of each number.

use glam::DVec3;

use super::{Fault, ReadOptions};
use strivec_format::geometry::Aabb;

/// Where the numbers of a grid are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum At {
    /// At cells: n cells fill the box.
    Cells,
    /// At vertices, the first and last on the faces of the box ("aligned corners"). A vertex's box reaches half a cell
    /// to each side, so that the boxes of the outermost vertices reach beyond the grid.
    Vertices,
}

/// Order of the axes, slowest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// \[x\]\[y\]\[z\]: DVGO's grids.
    Xyz,
    /// \[z\]\[y\]\[x\]: this project's grids and TensoRF's masks.
    Zyx,
}

/// A grid over a box.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Lengths of the axes, the slowest first.
    pub shape: [u64; 3],
    order: Order,
    origin: DVec3,
    pitch: DVec3,
    /// True if the numbers are stored with the first axis fastest.
    fortran: bool,
}

impl Grid {
    /// A grid of `shape` over `bounds`.
    ///
    /// # Errors
    ///
    /// If the box is not finite and solid, or an axis is too short.
    pub fn new(shape: [u64; 3], order: Order, at: At, bounds: &Aabb) -> Result<Self, Fault> {
        if !bounds.is_solid() || !bounds.size().is_finite() {
            return Err(Fault::malformed("the grid's bounds", "finite corners with min < max", format!("{bounds:?}")));
        }
        let fewest = if at == At::Vertices { 2 } else { 1 };
        if shape.iter().any(|&n| n < fewest) {
            return Err(Fault::malformed(
                "the grid's shape",
                format!("axes of length {fewest} or more"),
                format!("{shape:?}"),
            ));
        }
        let [a, b, c] = shape.map(|n| n as f64);
        let counts = if order == Order::Xyz { DVec3::new(a, b, c) } else { DVec3::new(c, b, a) };
        let pitch = bounds.size() / if at == At::Vertices { counts - 1.0 } else { counts };
        let origin = if at == At::Vertices { bounds.min - 0.5 * pitch } else { bounds.min };
        Ok(Self { shape, order, origin, pitch, fortran: false })
    }

    /// This grid, stored with the first axis fastest if `fortran`, else with the last.
    pub fn fortran(self, fortran: bool) -> Self {
        Self { fortran, ..self }
    }

    /// (x, y, z) of number `n`.
    pub fn index(&self, n: u64) -> [u64; 3] {
        let [a, b, c] = self.shape;
        let index = if self.fortran { [n % a, n / a % b, n / (a * b)] } else { [n / (b * c), n / c % b, n % c] };
        match self.order {
            Order::Xyz => index,
            Order::Zyx => [index[2], index[1], index[0]],
        }
    }

    /// The box of number `n`.
    pub fn cell(&self, n: u64) -> Aabb {
        let index = DVec3::from_array(self.index(n).map(|i| i as f64));
        Aabb { min: self.origin + index * self.pitch, max: self.origin + (index + 1.0) * self.pitch }
    }

    /// The center of [`Grid::cell`].
    pub fn center(&self, n: u64) -> DVec3 {
        let index = DVec3::from_array(self.index(n).map(|i| i as f64));
        self.origin + (index + 0.5) * self.pitch
    }
}

/// The three axes of a grid; further axes before or after them must have length 1.
///
/// # Errors
///
/// If there are fewer axes, or others of another length.
pub fn three_axes(shape: &[u64]) -> Result<[u64; 3], Fault> {
    let mut axes = shape;
    while axes.len() > 3 && axes[0] == 1 {
        axes = &axes[1..];
    }
    while axes.len() > 3 && axes[axes.len() - 1] == 1 {
        axes = &axes[..axes.len() - 1];
    }
    axes.try_into().map_err(|_| Fault::malformed("the grid's shape", "three axes", format!("{shape:?}")))
}

/// The bounds of a grid whose file has none.
///
/// # Errors
///
/// If `options` has none either.
pub fn bounds_given(options: &ReadOptions) -> Result<Aabb, Fault> {
    options.bounds.ok_or(Fault::NoBounds)
}

/// The map from DVGO's densities to opacities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Density {
    shift: f64,
    interval: f64,
}

impl Density {
    /// Densities to which `shift` is added, over steps of `interval` base voxels (DVGO's `voxel_size_ratio`).
    ///
    /// # Errors
    ///
    /// If `shift` is not finite or `interval` not positive.
    pub fn new(shift: f64, interval: f64) -> Result<Self, Fault> {
        if !shift.is_finite() {
            return Err(Fault::malformed("act_shift", "a finite number", shift));
        }
        if !(interval.is_finite() && interval > 0.0) {
            return Err(Fault::malformed("voxel_size_ratio", "a finite number above 0", interval));
        }
        Ok(Self { shift, interval })
    }

    /// The shift at which a density of 0 has the opacity `alpha`: DVGO's `act_shift` of `alpha_init`.
    ///
    /// # Errors
    ///
    /// If `alpha` is not between 0 and 1.
    pub fn shift_of(alpha: f64) -> Result<f64, Fault> {
        if !(alpha > 0.0 && alpha < 1.0) {
            return Err(Fault::malformed("alpha_init", "a number between 0 and 1", alpha));
        }
        Ok((1.0 / (1.0 - alpha) - 1.0).ln())
    }

    /// DVGO's post-activated opacity, 1 − (1 + exp(density + shift))^(−interval), computed without cancellation if it
    /// is small.
    pub fn alpha(&self, density: f64) -> f64 {
        let x = density + self.shift;
        let softplus = x.max(0.0) + (-x.abs()).exp().ln_1p();
        -(-self.interval * softplus).exp_m1()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: Aabb = Aabb { min: DVec3::NEG_ONE, max: DVec3::ONE };

    #[test]
    fn cells_fill_the_box_and_vertices_reach_out_of_it() {
        let cells = Grid::new([2, 4, 8], Order::Zyx, At::Cells, &BOX).unwrap();
        assert_eq!(cells.index(1), [1, 0, 0]);
        assert_eq!(cells.cell(0), Aabb { min: BOX.min, max: DVec3::new(-0.75, -0.5, 0.0) });
        assert_eq!(cells.cell(63), Aabb { min: DVec3::new(0.75, 0.5, 0.0), max: BOX.max });
        let vertices = Grid::new([2, 3, 5], Order::Xyz, At::Vertices, &BOX).unwrap();
        assert_eq!(vertices.index(1), [0, 0, 1]);
        assert_eq!(vertices.center(29), DVec3::ONE);
        assert_eq!(vertices.cell(0), Aabb { min: DVec3::new(-2.0, -1.5, -1.25), max: DVec3::new(0.0, -0.5, -0.75) });
        assert_eq!(cells.fortran(true).index(1), [0, 0, 1]);
    }

    #[test]
    fn opacity_is_dvgos() {
        let shift = Density::shift_of(1e-6).unwrap();
        let density = Density::new(shift, 1.0).unwrap();
        assert!((density.alpha(0.0) / 1e-6 - 1.0).abs() < 1e-9, "{}", density.alpha(0.0));
        assert_eq!(density.alpha(-1000.0), 0.0);
        assert_eq!(density.alpha(1000.0), 1.0);
        let half = Density::new(0.0, 0.5).unwrap();
        assert!((half.alpha(0.3) - (1.0 - (1.0 + 0.3_f64.exp()).powf(-0.5))).abs() < 1e-15);
        assert!(
            Density::shift_of(1.0).is_err() && Density::new(f64::NAN, 1.0).is_err() && Density::new(0.0, 0.0).is_err()
        );
    }

    #[test]
    fn grids_that_are_none_are_refused() {
        assert!(Grid::new([1, 2, 2], Order::Xyz, At::Vertices, &BOX).is_err());
        assert!(Grid::new([0, 2, 2], Order::Xyz, At::Cells, &BOX).is_err());
        assert!(Grid::new([2, 2, 2], Order::Xyz, At::Cells, &Aabb::EMPTY).is_err());
        assert_eq!(three_axes(&[1, 1, 2, 3, 1, 1]).unwrap(), [2, 3, 1]);
        let error = three_axes(&[2, 2, 3, 4]).unwrap_err().to_string();
        assert_eq!(error, "the grid's shape: expected three axes, found [2, 2, 3, 4]");
    }
}

//! The trained grid: raw densities and colors at vertices.

use glam::{DVec3, UVec3};
use num_traits::Float;

use strivec_format::geometry::{Aabb, cell_at};

/// f32 for training, f64 for the check of the gradients. `field::Real` is not used because captures must not depend on
/// the crate of the field; it also requires vector types that are not needed here.
pub(super) trait Scalar: Float + Default + Send + Sync + 'static {
    /// `value`, rounded to the nearest number.
    #[inline(always)]
    fn of(value: f64) -> Self {
        // Every f64 has a nearest f32, so that the conversion cannot fail.
        <Self as num_traits::NumCast>::from(value).unwrap_or_else(Self::nan)
    }
}

impl Scalar for f32 {}
impl Scalar for f64 {}

/// Channels of a vertex: raw density, raw red, green and blue.
pub(super) type Channels<T> = [T; 4];

/// A regular grid of vertices with their channels. The unit of its own space is the voxel, its origin the first vertex.
#[derive(Clone, Debug)]
pub(super) struct CoarseGrid<T> {
    /// The position of vertex (0, 0, 0), in dataset units.
    pub(super) origin: DVec3,
    /// The distance between vertices, in dataset units.
    pub(super) voxel: f64,
    /// Vertices along x, y and z, at least 2 each.
    pub(super) vertices: UVec3,
    /// \[z\]\[y\]\[x\] channels before activation.
    pub(super) values: Vec<Channels<T>>,
}

impl<T: Scalar> CoarseGrid<T> {
    /// A grid of zeros whose vertices span at least `bounds`, about `count` of them, cubic voxels.
    pub(super) fn new(bounds: &Aabb, count: f64) -> Self {
        let size = bounds.size();
        Self::with_voxel(bounds, (size.x * size.y * size.z / count).cbrt())
    }

    /// A grid of zeros whose vertices, `voxel` apart, span at least `bounds`.
    pub(super) fn with_voxel(bounds: &Aabb, voxel: f64) -> Self {
        let vertices = (bounds.size() / voxel).ceil().as_uvec3().max(UVec3::ONE) + 1;
        let origin = bounds.center() - 0.5 * voxel * (vertices.as_dvec3() - 1.0);
        let count = vertices.to_array().iter().map(|&n| n as usize).product();
        Self { origin, voxel, vertices, values: vec![[T::zero(); 4]; count] }
    }

    /// The box of the vertices, in dataset units.
    pub(super) fn bounds(&self) -> Aabb {
        let last = self.vertices - 1;
        Aabb { min: self.origin, max: self.position(last.x as usize, last.y as usize, last.z as usize) }
    }

    /// Vertices in a plane of equal z.
    pub(super) fn plane(&self) -> usize {
        self.vertices.x as usize * self.vertices.y as usize
    }

    /// The position of vertex (x, y, z) in dataset units.
    pub(super) fn position(&self, x: usize, y: usize, z: usize) -> DVec3 {
        self.origin + self.voxel * DVec3::new(x as f64, y as f64, z as f64)
    }

    /// The position of vertex number `n`, in dataset units.
    pub(super) fn vertex(&self, n: usize) -> DVec3 {
        let vertex = cell_at(n as u64, self.vertices);
        self.position(vertex.x as usize, vertex.y as usize, vertex.z as usize)
    }

    /// `point`, in dataset units, in the grid's space.
    pub(super) fn local(&self, point: DVec3) -> DVec3 {
        (point - self.origin) / self.voxel
    }

    /// The trilinear interpolation in the cell whose smallest vertex is number `first`; `fraction` is the position in
    /// the cell.
    #[inline(always)]
    pub(super) fn interpolate(&self, first: usize, fraction: [T; 3]) -> Channels<T> {
        let (row, plane) = (self.vertices.x as usize, self.plane());
        let mut sum = [T::zero(); 4];
        for (from, wz) in [(first, T::one() - fraction[2]), (first + plane, fraction[2])] {
            for (pair, w) in [(from, wz * (T::one() - fraction[1])), (from + row, wz * fraction[1])] {
                let [near, far] = [&self.values[pair], &self.values[pair + 1]];
                let (wn, wf) = (w * (T::one() - fraction[0]), w * fraction[0]);
                for c in 0..4 {
                    sum[c] = sum[c] + (wn * near[c] + wf * far[c]);
                }
            }
        }
        sum
    }

    /// A grid over `bounds` with voxels half as large, its values interpolated from this one.
    pub(super) fn refined(&self, bounds: &Aabb) -> Self {
        let mut fine = Self::with_voxel(bounds, 0.5 * self.voxel);
        let limit = self.vertices.as_dvec3() - 1.0;
        let [nx, ny, _] = fine.vertices.to_array().map(|n| n as usize);
        for n in 0..fine.values.len() {
            let position = fine.position(n % nx, n / nx % ny, n / (nx * ny));
            let local = self.local(position).clamp(DVec3::ZERO, limit);
            let first = local.floor().as_uvec3().min(self.vertices - 2);
            let fraction = (local - first.as_dvec3()).to_array().map(T::of);
            fine.values[n] = self.interpolate(self.index(first), fraction);
        }
        fine
    }

    /// The number of `vertex`.
    pub(super) fn index(&self, vertex: UVec3) -> usize {
        (vertex.z as usize * self.vertices.y as usize + vertex.y as usize) * self.vertices.x as usize
            + vertex.x as usize
    }
}

/// The live cells: those that rays must sample.
pub(super) struct Live {
    /// \[z\]\[y\]\[x\], numbered as the cell's smallest vertex; cells past the last vertices are dead.
    pub(super) cells: Vec<bool>,
    /// The box of the live cells in the grid's space; [`Aabb::EMPTY`] for none.
    pub(super) bounds: Aabb,
}

impl Live {
    /// The cells in which the interpolated raw density may reach `threshold`: those with a vertex of at least that
    /// density whose learning rate is not 0.
    pub(super) fn of<T: Scalar>(grid: &CoarseGrid<T>, rates: &[T], threshold: T) -> Self {
        let [nx, ny, nz] = grid.vertices.to_array().map(|n| n as usize);
        // A maximum along x, then y, then z.
        let mut cells: Vec<bool> =
            grid.values.iter().zip(rates).map(|(v, &r)| r > T::zero() && v[0] >= threshold).collect();
        for n in 0..cells.len() {
            cells[n] = n % nx + 1 < nx && (cells[n] | cells[n + 1]);
        }
        for n in 0..cells.len() {
            cells[n] = n / nx % ny + 1 < ny && (cells[n] | cells[n + nx]);
        }
        let mut bounds = Aabb::EMPTY;
        for n in 0..cells.len() {
            let z = n / (nx * ny);
            cells[n] = z + 1 < nz && (cells[n] | cells[n + nx * ny]);
            if cells[n] {
                let cell = DVec3::new((n % nx) as f64, (n / nx % ny) as f64, z as f64);
                bounds = bounds.union(&Aabb { min: cell, max: cell + 1.0 });
            }
        }
        Self { cells, bounds }
    }
}

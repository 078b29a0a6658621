//! One scale's tensors, and the mapping from positions to rows of their factors (spec 4.3).

use glam::DVec3;

use pulp::Simd;

use super::real::floor;
use super::{CellIndex, FieldFactors, Real};
use strivec_format::model::{Form, Scale, TensorCloud};

/// The tensors of a scale.
#[derive(Clone, Debug)]
pub struct FieldScale<T> {
    /// The index of this scale's first tensor over all scales.
    pub first_tensor: u32,
    /// \[tensor\] centers, relative to the field's origin.
    pub centers: Vec<[T; 3]>,
    /// Half edges of the tensors' boxes, in model units.
    pub half_edge: [T; 3],
    /// Cells along each axis.
    pub resolution: [u32; 3],
    /// Density factors, as the blocks of [`strivec_format::model::Factors`].
    pub density: Vec<FieldFactors<T>>,
    /// Appearance factors, alike.
    pub appearance: Vec<FieldFactors<T>>,
    top_k: usize,
    index: CellIndex<T>,
    vertices: TensorVertices<T>,
}

/// The mapping from a position within a tensor to vertices of its factors.
#[derive(Clone, Copy, Debug)]
pub struct TensorVertices<T> {
    half_edge: [T; 3],
    /// Cells between vertices per model unit, per axis.
    pub cells_per_unit: [T; 3],
    /// Index of the last cell, per axis.
    pub last_cell: [i32; 3],
}

/// The lower of two vertices and the fraction of the way to the next, per axis. Used by training only.
#[derive(Clone, Copy, Debug)]
pub struct Interpolation<T> {
    /// Lower vertex, per axis.
    pub lower: [usize; 3],
    /// Fraction of the way from the lower vertex to the next, in \[0, 1\], per axis.
    pub fractions: [T; 3],
}

impl<T: Real> TensorVertices<T> {
    fn new(half_edge: DVec3, resolution: [u32; 3]) -> Self {
        Self {
            half_edge: half_edge.to_array().map(T::of),
            cells_per_unit: [0, 1, 2].map(|a| T::of(f64::from(resolution[a]) / (2.0 * half_edge[a]))),
            last_cell: resolution.map(|d| d as i32 - 1),
        }
    }

    /// Vertices and fractions at `offset` from a tensor's center.
    #[inline(always)]
    pub fn at(&self, offset: [T; 3]) -> Interpolation<T> {
        let (x, y, z) = (self.on_axis(0, offset[0]), self.on_axis(1, offset[1]), self.on_axis(2, offset[2]));
        Interpolation { lower: [x.0 as usize, y.0 as usize, z.0 as usize], fractions: [x.1, y.1, z.1] }
    }

    /// The lower of two vertices on axis `a`, and the fraction, for a register of offsets. Both are meaningless
    /// in lanes whose tensor does not cover the position.
    #[inline(always)]
    pub(super) fn on_axis_of_many<S: Simd>(
        &self,
        simd: S,
        a: usize,
        offset: T::Register<S>,
    ) -> (T::Register<S>, T::Register<S>) {
        let half_edge = T::splat(simd, self.half_edge[a]);
        let u = T::times(simd, T::plus(simd, offset, half_edge), T::splat(simd, self.cells_per_unit[a]));
        // On the upper face, the last cell with a fraction of 1.
        let lower = T::smaller(simd, floor::<T, S>(simd, u), T::splat(simd, T::of_i32(self.last_cell[a])));
        (lower, T::minus(simd, u, lower))
    }

    /// The lower of two vertices on axis `a`, and the fraction.
    #[inline(always)]
    pub(super) fn on_axis(&self, a: usize, offset: T) -> (u32, T) {
        let u = (offset + self.half_edge[a]) * self.cells_per_unit[a];
        let lower = u.floor_i32().clamp(0, self.last_cell[a]);
        (lower as u32, u - T::of_i32(lower))
    }
}

/// `position` relative to a tensor's `center`, in model units.
#[inline(always)]
pub fn offset<T: Real>(position: [T; 3], center: [T; 3]) -> [T; 3] {
    [position[0] - center[0], position[1] - center[1], position[2] - center[2]]
}

impl<T: Real> FieldScale<T> {
    /// Prepares `scale`, whose factors are `density` and `appearance`, for positions relative to `origin`;
    /// `first_tensor` is the number of tensors before it.
    ///
    /// # Errors
    ///
    /// The least bytes of memory that its index needs, if they are more than `memory`.
    pub(super) fn new(
        scale: &Scale,
        [density, appearance]: [Vec<FieldFactors<T>>; 2],
        origin: DVec3,
        first_tensor: u32,
        memory: u64,
    ) -> Result<Self, u64> {
        Ok(Self {
            first_tensor,
            // Relative in f64, then rounded: a scene's place in the world costs no precision (docs/numerics.md).
            centers: scale.cloud.centers().map(|c| (c - origin).to_array().map(T::of)).collect(),
            half_edge: scale.cloud.half_edge.to_array().map(T::of),
            resolution: scale.cloud.resolution,
            density,
            appearance,
            top_k: scale.top_k as usize,
            index: CellIndex::new(&scale.cloud, origin, memory)?,
            vertices: TensorVertices::new(scale.cloud.half_edge, scale.cloud.resolution),
        })
    }

    /// Number of tensors.
    pub fn len(&self) -> usize {
        self.centers.len()
    }

    /// True if there are no tensors.
    pub fn is_empty(&self) -> bool {
        self.centers.is_empty()
    }

    /// The mapping from positions to vertices.
    pub fn vertices(&self) -> &TensorVertices<T> {
        &self.vertices
    }

    /// The blocks of density, then those of appearance.
    pub fn blocks(&self) -> impl Iterator<Item = &FieldFactors<T>> {
        self.density.iter().chain(&self.appearance)
    }

    /// The blocks of density, then those of appearance, to change.
    pub fn blocks_mut(&mut self) -> impl Iterator<Item = &mut FieldFactors<T>> {
        self.density.iter_mut().chain(&mut self.appearance)
    }

    /// Number of factors of all tensors.
    pub fn value_count(&self) -> usize {
        self.blocks().map(|block| block.held().value_count()).sum()
    }

    /// Appearance components, as many as the scale's columns of the appearance matrix.
    pub fn appearance_rank(&self) -> usize {
        self.appearance.iter().map(|block| block.held().rank()).sum()
    }

    /// Gives the tensors the resolution of `cloud`, which is theirs, when training upsamples: `resampled` returns a tensor's
    /// new factors from their form, the old ones and their number of components.
    ///
    /// # Panics
    ///
    /// If the new factors do not fit the resolution.
    pub fn set_resolution(&mut self, cloud: &TensorCloud, resampled: impl Fn(Form, &[T], usize) -> Vec<T>) {
        self.vertices = TensorVertices::new(cloud.half_edge, cloud.resolution);
        self.resolution = cloud.resolution;
        self.blocks_mut().for_each(|block| block.resample(cloud.resolution, &resampled));
    }

    /// The most neighbors of a point.
    pub fn top_k(&self) -> usize {
        self.top_k
    }

    /// The candidate lists of the tensors.
    pub fn index(&self) -> &CellIndex<T> {
        &self.index
    }
}

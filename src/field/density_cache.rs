//! Density features on a grid: an approximation for rendering that reads eight values per sample instead of
//! interpolating the factors of all its neighbors.

use super::Real;

/// Cells along a brick's edge.
pub(super) const BRICK: usize = 8;
/// Vertices along a brick's edge. Bricks share no vertices, so a sample reads from one brick only.
pub(super) const ROW: usize = BRICK + 1;
pub(super) const BRICK_VERTICES: usize = ROW * ROW * ROW;
/// The index of a brick that was not baked.
pub(super) const NO_BRICK: u32 = u32::MAX;

/// Density features at the vertices of a regular grid over the field's bounds, in bricks of 8³ cells. Only bricks in
/// which samples may count are stored.
#[derive(Clone, Debug)]
pub struct DensityCache<T> {
    pub(super) min: [T; 3],
    pub(super) cells_per_unit: T,
    /// Bricks along x, y and z.
    pub(super) bricks: [i32; 3],
    /// \[z\]\[y\]\[x\] the brick's index in `values`, or [`NO_BRICK`].
    pub(super) brick_indices: Vec<u32>,
    /// \[brick\]\[z\]\[y\]\[x\] density features; NaN outside the model.
    pub(super) values: Vec<T>,
}

impl<T: Real> DensityCache<T> {
    /// Bytes of the cache.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&*self.brick_indices) + size_of_val(&*self.values)) as u64
    }

    /// The density feature at `position`, interpolated between the vertices of its cell that are in the model; `None`
    /// if no vertex is.
    #[inline(always)]
    pub(super) fn feature(&self, position: [T; 3]) -> Option<T> {
        let (mut brick_index, mut vertex) = (0, 0);
        let mut fractions = [T::zero(); 3];
        for a in [2, 1, 0] {
            let at = (position[a] - self.min[a]) * self.cells_per_unit;
            // Rounding may move a sample on a face of the bounds out of them.
            let cell = at.floor_i32().clamp(0, self.bricks[a] * BRICK as i32 - 1);
            fractions[a] = at - T::of_i32(cell);
            brick_index = brick_index * self.bricks[a] as usize + cell as usize / BRICK;
            vertex = vertex * ROW + cell as usize % BRICK;
        }
        let brick = self.brick_indices[brick_index];
        if brick == NO_BRICK {
            return None;
        }
        let values = &self.values[brick as usize * BRICK_VERTICES..][..BRICK_VERTICES];
        let (mut sum, mut weights) = (T::zero(), T::zero());
        for corner in 0..8 {
            let value = values[vertex + (corner & 1) + ROW * (corner >> 1 & 1) + ROW * ROW * (corner >> 2)];
            let along = |a: usize| if corner >> a & 1 == 1 { fractions[a] } else { T::one() - fractions[a] };
            let weight = along(0) * along(1) * along(2);
            if !value.is_nan() {
                sum += weight * value;
                weights += weight;
            }
        }
        (weights > T::zero()).then(|| sum / weights)
    }
}

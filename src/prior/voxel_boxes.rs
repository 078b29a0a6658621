//! Occupied boxes on a lattice: what a prior is.

use glam::{DQuat, UVec3};

use crate::geometry::{Aabb, Lattice, Similarity};

/// Occupied space as whole cells of a lattice.
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelBoxes {
    /// The lattice, in the dataset's space until [`VoxelBoxes::mapped`].
    pub lattice: Lattice,
    /// Occupied cells, strictly ascending by (z, y, x).
    pub cells: Vec<UVec3>,
}

impl VoxelBoxes {
    /// The closed box of cell number `n`.
    pub fn cell_box(&self, n: usize) -> Aabb {
        let cell = self.cells[n].as_dvec3();
        Aabb {
            min: self.lattice.origin + cell * self.lattice.pitch,
            max: self.lattice.origin + (cell + 1.0) * self.lattice.pitch,
        }
    }

    /// All boxes, in order.
    pub fn boxes(&self) -> impl Iterator<Item = Aabb> + Clone + '_ {
        (0..self.cells.len()).map(|n| self.cell_box(n))
    }

    /// The smallest box that contains all of them; [`Aabb::EMPTY`] for none.
    pub fn bounds(&self) -> Aabb {
        self.boxes().fold(Aabb::EMPTY, |bounds, b| bounds.union(&b))
    }

    /// The same boxes in the space that `map` leads to.
    ///
    /// # Panics
    ///
    /// If `map` rotates: turned boxes are not cells of an upright lattice. [`super::canonical_map`] never does.
    pub fn mapped(&self, map: &Similarity) -> Self {
        assert_eq!(map.rotation, DQuat::IDENTITY, "voxel boxes can be scaled and moved, not turned");
        let lattice = Lattice { origin: map.point(self.lattice.origin), pitch: map.scale * self.lattice.pitch };
        Self { lattice, cells: self.cells.clone() }
    }
}

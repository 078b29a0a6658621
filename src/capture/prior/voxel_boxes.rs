//! Occupied boxes on a lattice, the form of every prior.

use glam::{DQuat, UVec3};

use strivec_format::geometry::{Aabb, Lattice, Similarity};

/// Occupied space as whole cells of a lattice.
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelBoxes {
    /// The lattice, in the dataset's space unless mapped by [`VoxelBoxes::mapped`].
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

    /// The boxes mapped by `map`.
    ///
    /// # Panics
    ///
    /// If `map` rotates: rotated boxes are not cells of an axis-aligned lattice. [`super::canonical_map`] never
    /// rotates.
    pub fn mapped(&self, map: &Similarity) -> Self {
        assert_eq!(map.rotation, DQuat::IDENTITY, "voxel boxes can be scaled and moved, not rotated");
        let lattice = Lattice { origin: map.point(self.lattice.origin), pitch: map.scale * self.lattice.pitch };
        Self { lattice, cells: self.cells.clone() }
    }
}

//! The space of an unbounded scene's prior: model space around an inner box, contracted (spec 4.9).

use std::collections::BTreeSet;

use glam::{DQuat, DVec3, UVec3};

use super::VoxelBoxes;
use strivec_format::geometry::{Aabb, Contraction, Lattice, Similarity};

/// The most points per axis with which a cell of a prior is sampled.
const MAX_SAMPLES: f64 = 64.0;

/// Contracted model space, and the way to it. The boxes of an unbounded scene's prior are in this space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unbounded {
    /// The contraction.
    pub contraction: Contraction,
    /// The map that takes the inner box to the inner cube.
    pub model_from_dataset: Similarity,
}

impl Unbounded {
    /// The space whose inner cube is the cube around `inner`, in the dataset's space, that is as wide as its longest
    /// edge; `inner` is solid.
    pub fn around(inner: &Aabb, contraction: Contraction) -> Self {
        let scale = 2.0 / inner.size().max_element();
        let map = Similarity { scale, rotation: DQuat::IDENTITY, translation: -scale * inner.center() };
        Self { contraction, model_from_dataset: map }
    }

    /// `point`, in the dataset's space, in contracted model space.
    pub fn contract(&self, point: DVec3) -> DVec3 {
        self.contraction.contract(self.model_from_dataset.point(point))
    }

    /// The point of the dataset's space whose image is `contracted`.
    pub fn expand(&self, contracted: DVec3) -> DVec3 {
        self.model_from_dataset.inverse().point(self.contraction.expand(contracted))
    }

    /// The length in contracted model space of `length` across the line of sight at `point`, both in the dataset's
    /// space.
    pub fn contracted_length(&self, length: f64, point: DVec3) -> f64 {
        let norm = self.model_from_dataset.point(point).abs().max_element().max(1.0);
        length * self.model_from_dataset.scale * (1.0 + self.contraction.shell - self.contraction.shell / norm) / norm
    }

    /// The cells of contracted space, as wide as those of `boxes` are in the inner cube, that hold a part of `boxes`, which
    /// are in the dataset's space.
    pub fn contract_boxes(&self, boxes: &VoxelBoxes) -> VoxelBoxes {
        let bounds = self.contraction.bounds();
        // At most about 1000 cells along an axis.
        let pitch = (self.model_from_dataset.scale * boxes.lattice.pitch).max(bounds.size() / 1000.0);
        let last = (bounds.size() / pitch).ceil().as_uvec3() - 1;
        let cell_of = |p: DVec3| ((p - bounds.min) / pitch).floor().max(DVec3::ZERO).as_uvec3().min(last);
        let mut cells = BTreeSet::new();
        for cell in boxes.boxes() {
            let [low, high] = [cell.min, cell.max].map(|p| self.model_from_dataset.point(p));
            let image = self.contraction.contract_box(&Aabb { min: low, max: high });
            let counts = (image.size() / (0.5 * pitch)).ceil().clamp(DVec3::ONE, DVec3::splat(MAX_SAMPLES)).as_uvec3();
            for z in 0..=counts.z {
                for y in 0..=counts.y {
                    for x in 0..=counts.x {
                        let share = UVec3::new(x, y, z).as_dvec3() / counts.as_dvec3();
                        let cell = cell_of(self.contraction.contract(low + share * (high - low)));
                        cells.insert([cell.z, cell.y, cell.x]);
                    }
                }
            }
        }
        let lattice = Lattice { origin: bounds.min, pitch };
        VoxelBoxes { lattice, cells: cells.into_iter().map(|[z, y, x]| UVec3::new(x, y, z)).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn space() -> Unbounded {
        let inner = Aabb { min: DVec3::new(1.0, 2.0, 3.0), max: DVec3::new(5.0, 4.0, 4.0) };
        Unbounded::around(&inner, Contraction { shell: 0.4 })
    }

    #[test]
    fn the_longest_edge_of_the_inner_box_spans_the_inner_cube() {
        let space = space();
        assert_eq!(space.contract(DVec3::new(5.0, 3.0, 3.5)), DVec3::X);
        assert_eq!(space.contract(DVec3::new(3.0, 4.0, 3.5)), DVec3::new(0.0, 0.5, 0.0));
        for point in [DVec3::new(2.0, 3.0, 3.5), DVec3::new(-40.0, 7.0, 3.0)] {
            assert!((space.expand(space.contract(point)) - point).length() < 1e-10);
        }
        let far = DVec3::new(203.0, 3.0, 3.5);
        let moved = (space.contract(far + 0.01 * DVec3::Y) - space.contract(far)).length();
        assert!((space.contracted_length(0.01, far) - moved).abs() < 1e-3 * moved);
    }

    #[test]
    fn cells_cover_the_images_of_the_boxes() {
        let space = space();
        let lattice = Lattice { origin: DVec3::splat(-60.0), pitch: DVec3::splat(0.5) };
        let cells = (0..40).map(|n| UVec3::new(3 * n, 121 + n % 3, 120 + n)).collect();
        let boxes = VoxelBoxes { lattice, cells };
        let found = space.contract_boxes(&boxes);
        assert!(found.cells.is_sorted_by_key(|c| [c.z, c.y, c.x]) && found.bounds().is_solid());
        for cell in boxes.boxes() {
            for n in 0..64 {
                let share = UVec3::new(n & 3, n >> 2 & 3, n >> 4).as_dvec3() / 3.0;
                let at = space.contract(cell.min + share * cell.size());
                assert!(found.boxes().any(|b| b.grown(DVec3::splat(1e-9)).contains(at)), "{at}");
            }
        }
    }
}

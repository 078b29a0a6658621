//! The first cell that a ray meets, in time that grows little with the number and distance of cells.
//!
//! Each node has 4×4×4 children in one 64-bit mask. The ray traverses the children of a node (Amanatides and Woo, "A
//! Fast Voxel Traversal Algorithm", 1987) and descends into occupied ones. Empty space is skipped by its largest empty
//! nodes.

use glam::{DVec3, IVec3, UVec3};
use rayon::prelude::*;

use super::VoxelBoxes;
use strivec_format::geometry::{Lattice, Ray, morton};

/// Levels of 2 bits per axis for 32-bit cells.
const MAX_LEVELS: u32 = 16;

/// A tree of the occupied cells of a [`VoxelBoxes`].
#[derive(Clone, Debug)]
pub struct SparseVoxelTree {
    /// Lattice of the cells, in the space of the boxes. The origin is the smallest corner of the cells' bounds.
    lattice: Lattice,
    /// Levels of nodes below the root, which spans 4^levels cells along each axis.
    levels: u32,
    /// The root first; the children of a node are adjacent.
    nodes: Vec<Node>,
    /// Indices of cells of the boxes, in the order of the children of the lowest nodes.
    cells: Vec<u32>,
}

/// Mask of the occupied children, bit 16·z + 4·y + x, and index of the first one among the nodes, on the lowest level
/// among the cells.
#[derive(Clone, Copy, Debug)]
struct Node {
    mask: u64,
    first: u32,
}

/// Where a ray meets a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstHit {
    /// Distance from the ray's origin, as a multiple of the length of its direction; 0 if the ray starts in the cell.
    pub t: f64,
    /// Index of the cell in [`VoxelBoxes::cells`].
    pub cell: usize,
    /// Normal axis of the face through which the ray enters; if it starts in the cell, the axis of its largest
    /// component.
    pub axis: usize,
}

impl SparseVoxelTree {
    /// The tree of the cells of `boxes`, at most 2³² of them.
    pub fn new(boxes: &VoxelBoxes) -> Self {
        let smallest = boxes.cells.iter().copied().reduce(UVec3::min).unwrap_or_default();
        let largest = boxes.cells.iter().copied().reduce(UVec3::max).unwrap_or_default();
        let extent = (largest - smallest).max_element();
        let levels = (1..MAX_LEVELS).find(|&levels| extent >> (2 * levels) == 0).unwrap_or(MAX_LEVELS);
        let origin = boxes.lattice.origin + smallest.as_dvec3() * boxes.lattice.pitch;
        let lattice = Lattice { origin, pitch: boxes.lattice.pitch };
        let mut keyed: Vec<(u128, u32)> = boxes
            .cells
            .par_iter()
            .zip(0..boxes.cells.len() as u32)
            .map(|(&cell, n)| (key(cell - smallest), n))
            .collect();
        keyed.par_sort_unstable();
        let cells = keyed.iter().map(|&(_, n)| n).collect();
        let mut keys: Vec<u128> = keyed.into_iter().map(|(key, _)| key).collect();
        // Each level's nodes from the keys of the level below, then all levels in one list, the root first.
        let mut built: Vec<Vec<Node>> = Vec::new();
        for _ in 0..levels {
            let mut nodes: Vec<Node> = Vec::new();
            let mut parents: Vec<u128> = Vec::new();
            for (&key, n) in keys.iter().zip(0..) {
                if parents.last() != Some(&(key >> 6)) {
                    parents.push(key >> 6);
                    nodes.push(Node { mask: 0, first: n });
                }
                nodes.last_mut().expect("just pushed").mask |= 1 << (key as u64 & 63);
            }
            built.push(nodes);
            keys = parents;
        }
        let mut nodes: Vec<Node> = Vec::with_capacity(built.iter().map(Vec::len).sum());
        for (height, level) in built.iter().enumerate().rev() {
            let below = (nodes.len() + level.len()) as u32;
            let shift = if height == 0 { 0 } else { below };
            nodes.extend(level.iter().map(|node| Node { first: node.first + shift, ..*node }));
        }
        Self { lattice, levels, nodes, cells }
    }

    /// The first cell that `ray` meets at its origin or after it. The direction may have any length.
    pub fn cast_ray(&self, ray: &Ray) -> Option<FirstHit> {
        self.nodes.first()?;
        // In cells from the smallest corner.
        let origin = (ray.origin - self.lattice.origin) / self.lattice.pitch;
        let direction = ray.direction / self.lattice.pitch;
        if !(origin.is_finite() && direction.is_finite()) {
            return None;
        }
        let extent = 2_f64.powi(2 * self.levels as i32);
        let mut enter = (0.0, dominant(direction));
        let mut leave = f64::INFINITY;
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            if d == 0.0 {
                if !(0.0..=extent).contains(&o) {
                    return None;
                }
                continue;
            }
            let [near, far] = if d > 0.0 { [-o / d, (extent - o) / d] } else { [(extent - o) / d, -o / d] };
            if near > enter.0 {
                enter = (near, axis);
            }
            leave = leave.min(far);
        }
        if enter.0 > leave {
            return None;
        }
        self.descend(0, self.levels, DVec3::ZERO, origin, direction, enter)
    }

    /// The first hit in node `node` of height `height`, whose children span 4^(height−1) cells. `corner` is its
    /// smallest corner, and `enter` the distance and the axis at which the ray enters it. The unit is the cell.
    fn descend(
        &self,
        node: u32,
        height: u32,
        corner: DVec3,
        origin: DVec3,
        direction: DVec3,
        enter: (f64, usize),
    ) -> Option<FirstHit> {
        let Node { mask, first } = self.nodes[node as usize];
        let size = 2_f64.powi(2 * (height as i32 - 1));
        let local = (origin + enter.0 * direction - corner) / size;
        // Rounding may leave the entry just outside.
        let mut child = local.floor().clamp(DVec3::ZERO, DVec3::splat(3.0)).as_ivec3();
        let step = IVec3::from_array(direction.to_array().map(|d| if d > 0.0 { 1 } else { -1 }));
        // The distance at which the ray leaves the child across each axis.
        let leave = |child: IVec3, axis: usize| {
            let plane = corner[axis] + size * f64::from(child[axis] + step[axis].max(0));
            if direction[axis] == 0.0 { f64::INFINITY } else { (plane - origin[axis]) / direction[axis] }
        };
        let mut next = DVec3::new(leave(child, 0), leave(child, 1), leave(child, 2));
        let (mut t, mut axis) = enter;
        loop {
            let bit = 16 * child.z + 4 * child.y + child.x;
            if mask >> bit & 1 == 1 {
                let below = first + (mask & ((1 << bit) - 1)).count_ones();
                if height == 1 {
                    return Some(FirstHit { t, cell: self.cells[below as usize] as usize, axis });
                }
                let corner = corner + size * child.as_dvec3();
                let hit = self.descend(below, height - 1, corner, origin, direction, (t, axis));
                if hit.is_some() {
                    return hit;
                }
            }
            axis = next.min_position();
            // A ray along two faces at once may seem to go back by a rounding error.
            t = t.max(next[axis]);
            child[axis] += step[axis];
            if !(0..4).contains(&child[axis]) {
                return None;
            }
            next[axis] = leave(child, axis);
        }
    }
}

/// The axis along which `direction` is longest.
fn dominant(direction: DVec3) -> usize {
    direction.abs().max_position()
}

/// Two bits of z, y and x for each level, the highest level first: the children of a node, and theirs, are adjacent.
fn key(cell: UVec3) -> u128 {
    morton::encode(cell, 2, MAX_LEVELS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::random::Random;

    /// The nearest box by trying all of them.
    fn nearest(boxes: &VoxelBoxes, ray: &Ray) -> Option<f64> {
        let entry = |b: strivec_format::geometry::Aabb| {
            let (a, b) = ((b.min - ray.origin) / ray.direction, (b.max - ray.origin) / ray.direction);
            let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
            (enter <= leave).then_some(enter)
        };
        boxes.boxes().filter_map(entry).min_by(f64::total_cmp)
    }

    fn boxes(mut cells: Vec<UVec3>) -> VoxelBoxes {
        cells.sort_by_key(|c| [c.z, c.y, c.x]);
        cells.dedup();
        VoxelBoxes { lattice: Lattice { origin: DVec3::new(1.0, -2.0, 0.5), pitch: DVec3::new(0.1, 0.2, 0.3) }, cells }
    }

    #[test]
    fn rays_meet_the_nearest_of_all_boxes() {
        let random = Random::new(7, "rays");
        let mut counter = 0;
        let mut uniform = || {
            counter += 1;
            random.uniform(counter)
        };
        for (extent, count) in [(4.0, 12), (30.0, 900), (3000.0, 900), (4e9, 30)] {
            let mut cell =
                || UVec3::new((extent * uniform()) as u32, (extent * uniform()) as u32, (extent * uniform()) as u32);
            let boxes = boxes((0..count).map(|_| cell()).collect());
            let tree = SparseVoxelTree::new(&boxes);
            let (mut met, rounding) = (0, 1e-6 + 1e-13 * extent);
            for i in 0..400 {
                // Half of them towards a cell, or the large lattices would never be hit.
                let point =
                    |u: [f64; 3]| boxes.lattice.origin + extent * (3.0 * DVec3::from(u) - 1.0) * boxes.lattice.pitch;
                let origin = point([uniform(), uniform(), uniform()]);
                let target = match i % 2 {
                    0 => boxes.cell_box((uniform() * boxes.cells.len() as f64) as usize).center(),
                    _ => point([uniform(), uniform(), uniform()]),
                };
                let ray = Ray { origin, direction: (target - origin).normalize() };
                let (found, expected) = (tree.cast_ray(&ray), nearest(&boxes, &ray));
                met += u32::from(expected.is_some());
                match (found, expected) {
                    (Some(found), Some(expected)) => {
                        assert!((found.t - expected).abs() < 1e-9 * extent, "{} {expected}", found.t);
                        let into = boxes.cell_box(found.cell);
                        let at = ray.at(found.t) - into.center();
                        assert!((at.abs() / into.size()).max_element() < 0.5 + rounding, "{at}");
                        if found.t > 0.0 {
                            let share = at[found.axis].abs() / into.size()[found.axis];
                            assert!((share - 0.5).abs() < rounding, "enters across another face: {share}");
                        }
                    }
                    (found, expected) => assert_eq!(found.map(|hit| hit.t), expected, "extent {extent}"),
                }
            }
            assert!(met >= 200, "{met}");
        }
    }

    #[test]
    fn axis_parallel_rays_and_empty_trees_are_no_trouble() {
        let boxes = boxes(vec![UVec3::new(5, 5, 5), UVec3::new(9, 5, 5)]);
        let tree = SparseVoxelTree::new(&boxes);
        let middle = boxes.cell_box(0).center();
        let ray = |origin, direction| Ray { origin, direction };
        let hit = tree.cast_ray(&ray(middle - 3.0 * DVec3::Y, DVec3::Y)).unwrap();
        assert_eq!((hit.cell, hit.axis), (0, 1));
        assert!((hit.t - 2.9).abs() < 1e-12);
        let inside = tree.cast_ray(&ray(middle, DVec3::NEG_Z)).unwrap();
        assert_eq!(inside, FirstHit { t: 0.0, cell: 0, axis: 2 });
        assert_eq!(tree.cast_ray(&ray(middle + DVec3::X, DVec3::NEG_X)).unwrap().cell, 1);
        assert_eq!(tree.cast_ray(&ray(middle + DVec3::Y, DVec3::Y)), None, "behind");
        assert_eq!(tree.cast_ray(&ray(middle + 0.15 * DVec3::X, DVec3::Z)), None, "between");
        assert_eq!(tree.cast_ray(&ray(DVec3::NAN, DVec3::Z)), None);
        let none = VoxelBoxes { cells: Vec::new(), ..boxes };
        assert_eq!(SparseVoxelTree::new(&none).cast_ray(&ray(middle, DVec3::Z)), None);
    }
}

//! Which tensors may cover a point: a grid of candidate lists over one scale's cloud.

use glam::DVec3;

use super::Real;
use crate::geometry::Aabb;
use crate::model::TensorCloud;

/// For each cell of a regular grid, the tensors whose boxes reach into it, ascending.
#[derive(Clone, Debug)]
pub struct CellIndex<T> {
    min: [T; 3],
    cells_per_unit: [T; 3],
    cells: [u32; 3],
    /// \[cell\] where its list begins, and the end of the last.
    starts: Vec<u32>,
    tensors: Vec<u32>,
}

impl<T: Real> CellIndex<T> {
    /// Indexes `cloud`, for positions relative to `origin`.
    ///
    /// A cell is a sixth of an edge wide: where edges are 1.5 pitches, box faces then fall on cell faces and hardly a
    /// candidate is listed in vain. In a cloud that is sparse in its bounds cells are wider, so that the grid's size
    /// stays in proportion to the number of tensors.
    pub fn new(cloud: &TensorCloud, origin: DVec3) -> Self {
        let bounds = cloud.bounds();
        let bounds = Aabb { min: bounds.min - origin, max: bounds.max - origin };
        let limit = 512.0 * cloud.len() as f64 + 65536.0;
        let mut width = cloud.half / 3.0;
        while (bounds.size() / width).ceil().max(DVec3::ONE).element_product() > limit {
            width *= 1.25;
        }
        let cells = (bounds.size() / width).ceil().max(DVec3::ONE).as_uvec3();
        let cell_count = cells.x as usize * cells.y as usize * cells.z as usize;
        // Rounding in T must not take a point to a cell whose list lacks its tensor.
        let slack = 1e-3 * width;
        let ranges: Vec<_> = (cloud.centers())
            .map(|center| {
                let cell_at = |p: DVec3| (p / width).floor().max(DVec3::ZERO).as_uvec3().min(cells - 1);
                let relative = center - origin - bounds.min;
                (cell_at(relative - cloud.half - slack), cell_at(relative + cloud.half + slack))
            })
            .collect();
        let for_each_cell = |visit: &mut dyn FnMut(usize, u32)| {
            for (n, (first, last)) in ranges.iter().enumerate() {
                for z in first.z..=last.z {
                    for y in first.y..=last.y {
                        for x in first.x..=last.x {
                            visit(((z * cells.y + y) * cells.x + x) as usize, n as u32);
                        }
                    }
                }
            }
        };
        let mut starts = vec![0u32; cell_count + 1];
        for_each_cell(&mut |cell, _| starts[cell + 1] += 1);
        for cell in 0..cell_count {
            starts[cell + 1] += starts[cell];
        }
        let mut next = starts.clone();
        let mut tensors = vec![0; starts[cell_count] as usize];
        for_each_cell(&mut |cell, n| {
            tensors[next[cell] as usize] = n;
            next[cell] += 1;
        });
        Self {
            min: bounds.min.to_array().map(T::of),
            cells_per_unit: (1.0 / width).to_array().map(T::of),
            cells: cells.to_array(),
            starts,
            tensors,
        }
    }

    /// Every tensor that may cover `position`, ascending.
    #[inline(always)]
    pub fn candidates(&self, position: [T; 3]) -> &[u32] {
        let mut cell = 0;
        for a in [2, 1, 0] {
            let at = ((position[a] - self.min[a]) * self.cells_per_unit[a]).floor_i32();
            // A point on the outermost face belongs to the last cell; one beyond it finds that no box contains it.
            if at < -1 || at > self.cells[a] as i32 {
                return &[];
            }
            cell = cell * self.cells[a] as usize + at.clamp(0, self.cells[a] as i32 - 1) as usize;
        }
        &self.tensors[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}

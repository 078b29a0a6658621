//! The tensors that may cover a point: a grid of candidate lists over one scale's cloud (spec 4.1).

use std::collections::HashMap;

use glam::DVec3;
use pulp::Simd;

use super::Real;
use super::positions::Positions;
use super::real::floor;
use super::vector::MAX_LANES;
use strivec_format::geometry::Aabb;
use strivec_format::model::TensorCloud;

/// Candidates per block, which are tested together. If edges are shorter than two pitches, the candidates of a cell are
/// the eight corners of a lattice cell and fit in one block.
pub(super) const BLOCK: usize = 16;

/// The most cells of a grid. Each takes 8 bytes during construction, plus its list.
/// With this limit a million tensors are indexed in 4 s and 1 GB instead of 23 s and 4 GB.
const MAX_CELLS: f64 = 33_554_432.0;

/// Up to [`BLOCK`] tensors of a list, with their centers by axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct CandidateBlock<T> {
    /// Number of tensors.
    pub(super) count: u32,
    /// \[axis\]\[tensor\] centers, relative to the field's origin; infinite beyond the count.
    pub(super) centers: [[T; BLOCK]; 3],
    /// Indices of the tensors in the scale, ascending.
    pub(super) tensors: [u32; BLOCK],
}

/// For each cell of a regular grid, the list of tensors whose boxes reach into it, ascending. Cells with the same
/// tensors share a list.
#[derive(Clone, Debug)]
pub struct CellIndex<T> {
    min: [T; 3],
    cells_per_unit: [T; 3],
    cells: [i32; 3],
    /// \[cell\] the index of its list, x fastest.
    lists: Vec<u32>,
    /// \[list\] its first block; then the number of blocks. List 0 is empty.
    starts: Vec<u32>,
    blocks: Vec<CandidateBlock<T>>,
}

impl<T: Real> CellIndex<T> {
    /// Indexes `cloud`, for positions relative to `origin`.
    ///
    /// A cell is a sixth of an edge wide: with edges of 1.5 pitches, box faces then fall on cell faces, and few
    /// candidates do not cover their cell. Cells are wider in a cloud that is sparse in its bounds, so that the grid's
    /// size stays in proportion to the number of tensors, and in very large clouds.
    ///
    /// # Errors
    ///
    /// The least bytes of memory that it needs, if they are more than `memory`.
    pub fn new(cloud: &TensorCloud, origin: DVec3, memory: u64) -> Result<Self, u64> {
        let bounds = cloud.bounds();
        let bounds = Aabb { min: bounds.min - origin, max: bounds.max - origin };
        // A cell is a sixth of an edge, so a tensor fills 216 cells: only clouds that are sparse in their bounds
        // exceed this.
        let limit = (512.0 * cloud.len() as f64 + 65536.0).min(MAX_CELLS);
        let mut width = cloud.half_edge / 3.0;
        while (bounds.size() / width).ceil().max(DVec3::ONE).element_product() > limit {
            width *= 1.25;
        }
        // Rounding in T must not move a point to a cell whose list lacks its tensor. In cells, the rounding error grows
        // with the number of cells.
        let most = (bounds.size() / width).ceil().max(DVec3::ONE).max_element() + 1.0;
        let slack = (1e-3 + 4.0 * T::epsilon().f64() * most) * width;
        // Faces that fall on cell faces would reach into the cells on both sides; beside them, the lower faces do not.
        let corner = bounds.min - 2.0 * slack;
        let cells = ((bounds.max + slack - corner) / width).ceil().max(DVec3::ONE).as_uvec3();
        let by_cell = tensors_by_cell(cloud, origin + corner, width, cells, slack, memory / 2);
        let (starts, tensors) = by_cell.map_err(|needed| needed.saturating_mul(2))?;
        // Of a list: its entry in a table that is being doubled, and its start.
        let (list_bytes, block_bytes) = (64, size_of::<CandidateBlock<T>>() as u64);

        let mut index = Self {
            min: corner.to_array().map(T::of),
            cells_per_unit: (1.0 / width).to_array().map(T::of),
            cells: cells.as_ivec3().to_array(),
            lists: Vec::with_capacity(starts.len() - 1),
            starts: vec![0, 0],
            blocks: Vec::new(),
        };
        let centers: Vec<[T; 3]> = cloud.centers().map(|c| (c - origin).to_array().map(T::of)).collect();
        // A list is stored once: the cells between the same box faces have the same tensors, and their samples form
        // one group.
        let mut known = HashMap::from([(&[][..], 0)]);
        for cell in starts.windows(2) {
            // Twice the blocks, while their list grows.
            let needed = index.starts.len() as u64 * list_bytes + 2 * index.blocks.len() as u64 * block_bytes;
            if needed > memory / 2 {
                return Err(2 * needed);
            }
            let list = &tensors[cell[0] as usize..cell[1] as usize];
            let list_index = *known.entry(list).or_insert_with(|| {
                index.blocks.extend(list.chunks(BLOCK).map(|part| block_of(part, &centers)));
                index.starts.push(index.blocks.len() as u32);
                index.starts.len() as u32 - 2
            });
            index.lists.push(list_index);
        }
        Ok(index)
    }

    /// Bytes of memory, but for what construction takes.
    pub fn memory(&self) -> u64 {
        (4 * (self.lists.len() + self.starts.len()) + self.blocks.len() * size_of::<CandidateBlock<T>>()) as u64
    }

    /// The list of the cell of `position`, or of the nearest cell for a point outside the grid, which no box contains.
    #[inline(always)]
    pub(super) fn list_at(&self, position: [T; 3]) -> u32 {
        let cell = [0, 1, 2].map(|a| {
            let u = (position[a] - self.min[a]) * self.cells_per_unit[a];
            u.floor_i32().clamp(0, self.cells[a] - 1) as u32
        });
        self.list_of(cell)
    }

    /// [`CellIndex::list_at`] for all `positions`.
    #[inline(always)]
    pub(super) fn lists_at<S: Simd>(&self, simd: S, positions: &Positions<T>, lists: &mut Vec<u32>) {
        let lanes = T::lanes::<S>();
        let zero = T::splat(simd, T::zero());
        let mut cells = [[T::zero(); MAX_LANES]; 3];
        lists.clear();
        for first in (0..positions.len()).step_by(lanes) {
            for (a, cells) in cells.iter_mut().enumerate() {
                let position = T::load(simd, &positions.axis(a)[first..]);
                let offset = T::minus(simd, position, T::splat(simd, self.min[a]));
                let u = T::times(simd, offset, T::splat(simd, self.cells_per_unit[a]));
                // A clamp instead of a branch. The comparison is false for NaN, which becomes cell 0.
                let u = T::select(simd, T::less_or_equal(simd, zero, u), u, zero);
                let last = T::of_i32(self.cells[a] - 1);
                let floor = floor::<T, S>(simd, T::smaller(simd, u, T::splat(simd, last)));
                T::store(simd, cells, floor);
            }
            for lane in 0..lanes.min(positions.len() - first) {
                let cell = [cells[0][lane].small_u32(), cells[1][lane].small_u32(), cells[2][lane].small_u32()];
                lists.push(self.list_of(cell));
            }
        }
    }

    #[inline(always)]
    fn list_of(&self, [x, y, z]: [u32; 3]) -> u32 {
        let [columns, rows, _] = self.cells;
        self.lists[(z as usize * rows as usize + y as usize) * columns as usize + x as usize]
    }

    /// The tensors of `list`, ascending.
    #[inline(always)]
    pub(super) fn blocks(&self, list: u32) -> &[CandidateBlock<T>] {
        &self.blocks[self.starts[list as usize] as usize..self.starts[list as usize + 1] as usize]
    }

    /// The grid, per axis: the lower corner relative to the field's origin, cells per model unit, number of cells.
    pub fn grid(&self) -> ([T; 3], [T; 3], [i32; 3]) {
        (self.min, self.cells_per_unit, self.cells)
    }

    /// \[cell\] the index of its list, x fastest.
    #[cfg(feature = "gpu")]
    pub fn lists(&self) -> &[u32] {
        &self.lists
    }

    /// Each list's tensors, ascending, with their centers relative to the field's origin. The first list is empty.
    #[cfg(feature = "gpu")]
    pub fn candidates(&self) -> impl Iterator<Item = impl Iterator<Item = ([T; 3], u32)>> {
        (0..self.starts.len() as u32 - 1).map(|list| {
            self.blocks(list).iter().flat_map(|block| {
                (0..block.count as usize).map(|l| ([0, 1, 2].map(|a| block.centers[a][l]), block.tensors[l]))
            })
        })
    }

    /// \[cell\] true if any tensor reaches into the cell, x fastest.
    pub(super) fn covered_cells(&self) -> impl Iterator<Item = bool> {
        self.lists.iter().map(|&list| list != 0)
    }
}

fn block_of<T: Real>(tensors: &[u32], centers: &[[T; 3]]) -> CandidateBlock<T> {
    let mut block =
        CandidateBlock { count: tensors.len() as u32, centers: [[T::infinity(); BLOCK]; 3], tensors: [0; BLOCK] };
    for (l, &tensor) in tensors.iter().enumerate() {
        for a in 0..3 {
            block.centers[a][l] = centers[tensor as usize][a];
        }
        block.tensors[l] = tensor;
    }
    block
}

/// \[cell\] the first of its tensors, then the number of tensors; and the tensors. `corner` is the grid's lower corner.
/// Boxes are grown by `slack`. The bytes that these take, if they are more than `memory`.
fn tensors_by_cell(
    cloud: &TensorCloud,
    corner: DVec3,
    width: DVec3,
    cells: glam::UVec3,
    slack: DVec3,
    memory: u64,
) -> Result<(Vec<u32>, Vec<u32>), u64> {
    let cell_at = |p: DVec3| (p / width).floor().max(DVec3::ZERO).as_uvec3().min(cells - 1);
    let range = |center| {
        let relative = center - corner;
        (cell_at(relative - cloud.half_edge - slack), cell_at(relative + cloud.half_edge + slack))
    };
    let cells_of = |center| {
        let (first, last) = range(center);
        (last - first + 1).as_u64vec3().element_product()
    };
    // At most 2^31: 2^22 tensors, of which each reaches 8^3 cells. The cells twice, with a list of the index, then the tensors in them, and the ranges.
    // Counted before anything is allocated: the cloud may be of an untrusted file.
    let entries: u64 = cloud.centers().map(cells_of).sum();
    let cell_count = cells.as_u64vec3().element_product();
    let needed = 12 * cell_count + 4 * entries + 24 * cloud.len() as u64;
    if needed > memory {
        return Err(needed);
    }
    let ranges: Vec<_> = cloud.centers().map(range).collect();
    let for_each_cell = |visit: &mut dyn FnMut(usize, u32)| {
        for (tensor, (first, last)) in ranges.iter().enumerate() {
            for z in first.z..=last.z {
                for y in first.y..=last.y {
                    for x in first.x..=last.x {
                        visit(
                            (z as usize * cells.y as usize + y as usize) * cells.x as usize + x as usize,
                            tensor as u32,
                        );
                    }
                }
            }
        }
    };
    let cell_count = cells.x as usize * cells.y as usize * cells.z as usize;
    // A counting sort in two passes. It visits tensors ascending, so each list ascends without a sort.
    let mut starts = vec![0u32; cell_count + 1];
    for_each_cell(&mut |cell, _| starts[cell + 1] += 1);
    for cell in 0..cell_count {
        starts[cell + 1] += starts[cell];
    }
    let mut next = starts.clone();
    let mut tensors = vec![0; starts[cell_count] as usize];
    for_each_cell(&mut |cell, tensor| {
        tensors[next[cell] as usize] = tensor;
        next[cell] += 1;
    });
    Ok((starts, tensors))
}

//! A regular grid, filled in blocks on all threads and handed on layer by layer.

use glam::UVec3;
use rayon::prelude::*;

/// Vertices along the edge of a block.
pub(super) const BLOCK: usize = 8;
/// Vertices of a block: x fastest, then y, then z.
const BLOCK_VERTICES: usize = BLOCK * BLOCK * BLOCK;

/// The vertices of the block of the first vertex `first`, in their order in the block.
pub(super) fn vertices_of_block(first: UVec3) -> impl Iterator<Item = UVec3> {
    let edge = BLOCK as u32;
    (0..edge.pow(3)).map(move |n| first + UVec3::new(n % edge, n / edge % edge, n / edge.pow(2)))
}

/// Calls `take` with each layer z of a grid of `vertices` vertices, \[y\]\[x\], from the first on. `fill` writes the numbers
/// of a block from its first vertex on, also of vertices beyond the grid, which are not used. `progress` receives the number
/// of layers that are done, and of all. Memory holds eight layers.
///
/// # Errors
///
/// The errors of `take`.
pub(super) fn for_each_layer<E>(
    vertices: UVec3,
    fill: impl Fn(UVec3, &mut [f32]) + Sync,
    progress: &dyn Fn(u64, u64),
    mut take: impl FnMut(u32, &mut Vec<f32>) -> Result<(), E>,
) -> Result<(), E> {
    let [width, rows] = [vertices.x, vertices.y].map(|n| n as usize);
    let columns = width.div_ceil(BLOCK);
    let mut slab = vec![0.0; columns * rows.div_ceil(BLOCK) * BLOCK_VERTICES];
    let mut layer = vec![0.0; width * rows];
    for first in (0..vertices.z).step_by(BLOCK) {
        slab.par_chunks_mut(BLOCK_VERTICES).enumerate().for_each(|(n, block)| {
            let [x, y] = [n % columns, n / columns].map(|b| (b * BLOCK) as u32);
            fill(UVec3::new(x, y, first), block);
        });
        let end = vertices.z.min(first + BLOCK as u32);
        for z in first..end {
            for (y, row) in layer.chunks_exact_mut(width).enumerate() {
                for (column, part) in row.chunks_mut(BLOCK).enumerate() {
                    let block = &slab[(y / BLOCK * columns + column) * BLOCK_VERTICES..];
                    let start = ((z - first) as usize * BLOCK + y % BLOCK) * BLOCK;
                    part.copy_from_slice(&block[start..][..part.len()]);
                }
            }
            take(z, &mut layer)?;
        }
        progress(end.into(), vertices.z.into());
    }
    Ok(())
}

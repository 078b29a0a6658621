//! The bits of an occupancy, each by those of the vertices around it that come before (spec 2.5).

use std::fmt;

use super::coder::{Coder, Counter, Decoder, Encoder};
use crate::container::Error;

/// Vertices along the edge of a block.
const BLOCK: usize = 8;
/// Bits of the context of a vertex's near neighbors, and of all.
const NEAR: u32 = 12;
const ALL: u32 = 18;
/// Contexts of all neighbors count from this many bits on; before, those of the near ones do.
const ENOUGH: u32 = 2;

/// The rows around one that a context needs: offsets on y and z. The first is the row itself.
const ROWS: [[isize; 2]; 7] = [[0, 0], [-1, 0], [0, -1], [-2, 0], [0, -2], [-1, -1], [1, -1]];
/// The vertices of a context, from its lowest bit on: their row of [`ROWS`], and their offset on x. The near ones come first.
const NEIGHBORS: [(usize, i32); ALL as usize] = [
    (0, -2),
    (0, -1),
    (1, -1),
    (1, 0),
    (1, 1),
    (2, -1),
    (2, 0),
    (2, 1),
    (3, 0),
    (4, 0),
    (5, 0),
    (6, 0),
    (1, -2),
    (1, 2),
    (5, -1),
    (5, 1),
    (6, -1),
    (6, 1),
];

/// The state of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Block {
    /// None is set.
    #[default]
    Empty,
    /// All are set.
    Full,
    Mixed,
}

/// The vertices, in rows along x.
struct Grid {
    vertices: [usize; 3],
    /// Bytes of a row: a bit for each vertex, from the lowest of the second byte on, and a byte of zeros at both ends.
    stride: usize,
    /// \[z\]\[y\] the rows.
    rows: Vec<u8>,
}

/// Bytes that coding an occupancy of `vertices` takes besides its bits.
pub(in crate::container) fn memory(vertices: [u32; 3]) -> u64 {
    let [x, y, z] = vertices.map(u64::from);
    let [bx, by, bz] = vertices.map(|n| u64::from(n).div_ceil(BLOCK as u64));
    (x.div_ceil(8) + 2) * y * z + bx * by * bz + (size_of::<Counter>() as u64) * ((1 << ALL) + (1 << NEAR) + 2 * 729)
}

/// Codes `bits`, one for each of `vertices`, x fastest, from the lowest bit of the first byte on.
pub(in crate::container) fn compress(vertices: [u32; 3], bits: &[u8]) -> Vec<u8> {
    let mut grid = Grid::empty(vertices);
    grid.set(bits);
    let mut encoder = Encoder::new();
    code(&mut encoder, &mut grid);
    encoder.finish()
}

/// The inverse of [`compress`]. Takes [`memory`]; the caller has checked that there is so much.
pub(in crate::container) fn decompress(
    place: &dyn fmt::Display,
    vertices: [u32; 3],
    bytes: &[u8],
) -> Result<Vec<u8>, Error> {
    let mut grid = Grid::empty(vertices);
    let mut decoder = Decoder::new(bytes);
    code(&mut decoder, &mut grid);
    decoder.finish(place)?;
    Ok(grid.bits())
}

/// Codes the blocks of `grid`, then the vertices of mixed ones, both x fastest. An encoder finds them in `grid`, a decoder sets
/// them there.
fn code(coder: &mut impl Coder, grid: &mut Grid) {
    let counts = grid.vertices.map(|n| n.div_ceil(BLOCK));
    let blocks = code_blocks(coder, grid, counts);
    let mut near = vec![Counter::default(); 1 << NEAR];
    let mut all = vec![Counter::default(); 1 << ALL];
    let [_, y_count, z_count] = grid.vertices;
    for z in 0..z_count {
        for y in 0..y_count {
            if coder.is_over() {
                return;
            }
            let first = ((z / BLOCK) * counts[1] + y / BLOCK) * counts[0];
            for (x, block) in blocks[first..first + counts[0]].iter().enumerate() {
                let at = grid.at(x, y, z);
                grid.rows[at] = match block {
                    Block::Empty => 0,
                    Block::Full => grid.mask(x),
                    Block::Mixed => {
                        let count = BLOCK.min(grid.vertices[0] - BLOCK * x);
                        code_row(coder, grid.windows(x, y, z), grid.rows[at], count, &mut near, &mut all)
                    }
                };
            }
        }
    }
}

/// Codes what each of the `counts` blocks is.
fn code_blocks(coder: &mut impl Coder, grid: &Grid, counts: [usize; 3]) -> Vec<Block> {
    let [x_count, y_count, z_count] = counts;
    let mut blocks = vec![Block::Empty; x_count * y_count * z_count];
    let (mut is_mixed, mut is_full) = ([Counter::default(); 729], [Counter::default(); 729]);
    for z in 0..z_count {
        for y in 0..y_count {
            for x in 0..x_count {
                let mut context = 0;
                for [dx, dy, dz] in [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]] {
                    let before = x >= dx && y >= dy && z >= dz;
                    let block = before.then(|| blocks[((z - dz) * y_count + y - dy) * x_count + x - dx]);
                    context = 3 * context + block.unwrap_or_default() as usize;
                }
                let known = grid.block(x, y, z);
                let block = if coder.code_in(known == Block::Mixed, &mut is_mixed[context]) {
                    Block::Mixed
                } else if coder.code_in(known == Block::Full, &mut is_full[context]) {
                    Block::Full
                } else {
                    Block::Empty
                };
                blocks[(z * y_count + y) * x_count + x] = block;
            }
        }
    }
    blocks
}

/// Codes the first `count` vertices of `known`, which are beside each other in a row; bit 8 + i of `windows` is at the x of
/// vertex i. Returns their bits.
#[inline(always)]
fn code_row(
    coder: &mut impl Coder,
    mut windows: [u32; ROWS.len()],
    known: u8,
    count: usize,
    near: &mut [Counter],
    all: &mut [Counter],
) -> u8 {
    let mut row = 0;
    // An encoder's grid also has the bits from the first vertex on, which a decoder has not read yet.
    windows[0] &= 0xff;
    for i in 0..count {
        let mut context = 0;
        for (bit, &(row, x)) in NEIGHBORS.iter().enumerate() {
            context |= (windows[row] >> (8 + i as i32 + x) & 1) << bit;
        }
        let (near, all) = (&mut near[context as usize % (1 << NEAR)], &mut all[context as usize]);
        let counter = if all.seen() < ENOUGH { &*near } else { &*all };
        let bit = coder.code(known >> i & 1 != 0, counter.probability());
        near.learn(bit);
        all.learn(bit);
        row |= u8::from(bit) << i;
        windows[0] |= u32::from(bit) << (8 + i);
    }
    row
}

impl Grid {
    fn empty(vertices: [u32; 3]) -> Self {
        let vertices = vertices.map(|n| n as usize);
        let stride = vertices[0].div_ceil(8) + 2;
        Self { vertices, stride, rows: vec![0; stride * vertices[1] * vertices[2]] }
    }

    /// The byte of the vertices from 8·x on in the row of `y` and `z`.
    #[inline(always)]
    fn at(&self, x: usize, y: usize, z: usize) -> usize {
        (z * self.vertices[1] + y) * self.stride + 1 + x
    }

    /// The bits that byte `x` of a row has.
    fn mask(&self, x: usize) -> u8 {
        match self.vertices[0] - BLOCK * x {
            count @ 0..BLOCK => (1 << count) - 1,
            _ => u8::MAX,
        }
    }

    /// The state of block (`x`, `y`, `z`): empty in a decoder, which has not read its vertices yet.
    fn block(&self, x: usize, y: usize, z: usize) -> Block {
        let (mut any, mut every) = (false, true);
        for z in BLOCK * z..(BLOCK * z + BLOCK).min(self.vertices[2]) {
            for y in BLOCK * y..(BLOCK * y + BLOCK).min(self.vertices[1]) {
                let byte = self.rows[self.at(x, y, z)];
                any |= byte != 0;
                every &= byte == self.mask(x);
            }
        }
        match (any, every) {
            (false, _) => Block::Empty,
            (true, true) => Block::Full,
            (true, false) => Block::Mixed,
        }
    }

    /// \[row of [`ROWS`]\] byte `x` of the row, between the one before and the one behind it, around the row of `y` and `z`.
    #[inline(always)]
    fn windows(&self, x: usize, y: usize, z: usize) -> [u32; ROWS.len()] {
        let mut windows = [0; ROWS.len()];
        for (window, [dy, dz]) in windows.iter_mut().zip(ROWS) {
            if let (Some(y), Some(z)) = (y.checked_add_signed(dy), z.checked_add_signed(dz))
                && y < self.vertices[1]
            {
                let at = self.at(x, y, z);
                *window = u32::from_le_bytes([self.rows[at - 1], self.rows[at], self.rows[at + 1], 0]);
            }
        }
        windows
    }

    /// Sets the vertices of `bits`, as [`compress`] takes them.
    fn set(&mut self, bits: &[u8]) {
        let byte = |at: usize| u16::from(bits.get(at).copied().unwrap_or(0));
        for row in 0..self.vertices[1] * self.vertices[2] {
            for x in 0..self.stride - 2 {
                let vertex = row * self.vertices[0] + 8 * x;
                let two = byte(vertex / 8) | byte(vertex / 8 + 1) << 8;
                self.rows[row * self.stride + 1 + x] = (two >> (vertex % 8)) as u8 & self.mask(x);
            }
        }
    }

    /// The vertices, as [`compress`] takes them.
    fn bits(&self) -> Vec<u8> {
        // A byte more, for the second half of the last one.
        let mut bits = vec![0; self.vertices.iter().product::<usize>().div_ceil(8) + 1];
        for (n, row) in self.rows.chunks_exact(self.stride).enumerate() {
            for (x, &byte) in row[1..self.stride - 1].iter().enumerate() {
                let vertex = n * self.vertices[0] + 8 * x;
                let [lower, upper] = (u16::from(byte) << (vertex % 8)).to_le_bytes();
                bits[vertex / 8] |= lower;
                if upper > 0 {
                    bits[vertex / 8 + 1] |= upper;
                }
            }
        }
        bits.pop();
        bits
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// The vertices near a sphere's surface, and some others.
    fn shell(vertices: [u32; 3], noise: f64) -> Vec<u8> {
        let random = Random::new(3, "noise of an occupancy");
        let mut bits = vec![0; vertices.iter().product::<u32>().div_ceil(8) as usize];
        let mut vertex = 0;
        for z in 0..vertices[2] {
            for y in 0..vertices[1] {
                for x in 0..vertices[0] {
                    let part = |at: u32, of: u32| f64::from(at) / f64::from(of) - 0.5;
                    let parts = [part(x, vertices[0]), part(y, vertices[1]), part(z, vertices[2])];
                    let radius = parts.iter().map(|p| p * p).sum::<f64>().sqrt();
                    let is_set = (radius - 0.4).abs() < 0.05 || radius < 0.1 || random.uniform(vertex) < noise;
                    bits[vertex as usize / 8] |= u8::from(is_set) << (vertex % 8);
                    vertex += 1;
                }
            }
        }
        bits
    }

    #[test]
    fn occupancies_are_read_as_written() {
        for vertices in [[2, 2, 2], [3, 5, 2], [8, 8, 8], [9, 17, 8], [40, 33, 50]] {
            for noise in [0.0, 0.3, 1.0] {
                let bits = shell(vertices, noise);
                let bytes = compress(vertices, &bits);
                assert_eq!(decompress(&"X", vertices, &bytes), Ok(bits), "{vertices:?}, {noise}");
                assert!(decompress(&"X", vertices, &[&bytes[..], &[1]].concat()).is_err());
            }
        }
    }

    #[test]
    fn a_surface_takes_a_fraction_of_its_bits() {
        let vertices = [100, 100, 100];
        let bits = shell(vertices, 0.0);
        let bytes = compress(vertices, &bits);
        assert!(bytes.len() * 20 < bits.len(), "{} of {} bytes", bytes.len(), bits.len());
    }
}

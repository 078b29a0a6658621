//! The bits of an occupancy, each by those of the vertices around it that come before (spec 2.5).

use std::fmt;
use std::hint::select_unpredictable;

use super::coder::{BitDecoder, BitEncoder, Coder, Counter};
use crate::container::Error;

/// Vertices along the edge of a block.
const BLOCK: usize = 8;
/// Bits of the context of a vertex's near neighbors, and of all.
const NEAR: u32 = 12;
const ALL: u32 = 18;
/// Contexts of all neighbors count from this many bits on; before, those of the near ones do.
const ENOUGH: u32 = 2;

/// The rows around one that a context needs: offsets on y and z. The vertices of the first come before one in its own row.
const ROWS: [[isize; 2]; 7] = [[0, 0], [-1, 0], [0, -1], [-2, 0], [0, -2], [-1, -1], [1, -1]];
/// Bits of a context for vertices of the row itself, the lowest ones: two to the left, one to the left.
const OWN: u32 = 2;
/// \[byte\]\[bit\] the other vertices of a context, from its bit [`OWN`] on: their row of [`ROWS`], and their offset on x. The
/// near ones come first.
const NEIGHBORS: [[(usize, i32); 8]; 2] = [
    [(1, -1), (1, 0), (1, 1), (2, -1), (2, 0), (2, 1), (3, 0), (4, 0)],
    [(5, 0), (6, 0), (1, -2), (1, 2), (5, -1), (5, 1), (6, -1), (6, 1)],
];

/// \[row of [`ROWS`]\] the largest offset on x of [`NEIGHBORS`] there.
const REACH: [u32; ROWS.len()] = [0, 2, 1, 0, 0, 1, 1];

/// \[byte\] its bits, from the lowest on, each in the lowest bit of a byte.
const SPREAD: [u64; 256] = {
    let mut spread = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut bit = 0;
        while bit < 8 {
            spread[byte] |= ((byte as u64 >> bit) & 1) << (8 * bit);
            bit += 1;
        }
        byte += 1;
    }
    spread
};

/// The state of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum BlockState {
    /// None is set.
    #[default]
    Empty,
    /// All are set.
    Full,
    Mixed,
}

/// Bits, one for each of the vertices, x fastest, from the lowest bit of the first byte on. Some zeros follow.
struct BitGrid {
    vertices: [usize; 3],
    bits: Vec<u8>,
}

/// Bytes of zeros behind the bits of a [`BitGrid`]: what is read beyond the last one.
const BEHIND: usize = 3;

/// Bytes that coding an occupancy of `vertices` takes besides its bits.
pub(in crate::container) fn memory(vertices: [u32; 3]) -> u64 {
    let [x, y, z] = vertices.map(|n| u64::from(n).div_ceil(BLOCK as u64));
    x * y * z + 16 * x + (size_of::<Counter>() as u64) * ((1 << ALL) + (1 << NEAR) + 2 * 729)
}

/// Codes `bits`, one for each of `vertices`, x fastest, from the lowest bit of the first byte on.
pub(in crate::container) fn compress(vertices: [u32; 3], bits: &[u8]) -> Vec<u8> {
    let mut grid = BitGrid::empty(vertices);
    grid.bits[..bits.len()].copy_from_slice(bits);
    let mut encoder = BitEncoder::new();
    code(&mut encoder, &mut grid);
    encoder.finish()
}

/// The inverse of [`compress`]. Takes [`memory`]; the caller has checked that there is so much.
pub(in crate::container) fn decompress(
    place: &dyn fmt::Display,
    vertices: [u32; 3],
    bytes: &[u8],
) -> Result<Vec<u8>, Error> {
    let mut grid = BitGrid::empty(vertices);
    let mut decoder = BitDecoder::new(bytes, place)?;
    code(&mut decoder, &mut grid);
    decoder.finish(place)?;
    grid.bits.truncate(grid.bits.len() - BEHIND);
    Ok(grid.bits)
}

/// Codes the blocks of `grid`, then the vertices of mixed ones, both x fastest. An encoder finds them in `grid`, a decoder sets
/// them there.
fn code<C: Coder>(coder: &mut C, grid: &mut BitGrid) {
    let counts = grid.vertices.map(|n| n.div_ceil(BLOCK));
    let blocks = code_blocks(coder, grid, counts);
    let mut contexts = Contexts::new();
    let mut occupied = Vec::with_capacity(counts[0]);
    let [_, y_count, z_count] = grid.vertices;
    for z in 0..z_count {
        for y in 0..y_count {
            if coder.is_over() {
                return;
            }
            if y % BLOCK == 0 {
                let first = ((z / BLOCK) * counts[1] + y / BLOCK) * counts[0];
                let row = blocks[first..first + counts[0]].iter().copied().enumerate();
                occupied.clear();
                occupied.extend(row.filter(|&(_, block)| block != BlockState::Empty));
            }
            let rows = grid.rows_around(y, z);
            let mut last = (0, 0);
            for &(x, block) in &occupied {
                let row = match block {
                    BlockState::Full => grid.mask(x),
                    _ => {
                        let mut windows = grid.windows(x, &rows);
                        if C::DECODES {
                            // Nothing behind it is known, and reading what has just been written takes long.
                            windows[0] = if last.0 + 1 == x { u32::from(last.1) } else { 0 };
                        }
                        contexts.code_row(coder, windows, grid.count(x))
                    }
                };
                last = (x, row);
                if C::DECODES {
                    grid.set(x, grid.row(y, z), row);
                }
            }
        }
    }
}

/// Codes what each of the `counts` blocks is.
fn code_blocks<C: Coder>(coder: &mut C, grid: &BitGrid, counts: [usize; 3]) -> Vec<BlockState> {
    let [x_count, y_count, z_count] = counts;
    let mut blocks = vec![BlockState::Empty; x_count * y_count * z_count];
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
                let known = if C::DECODES { BlockState::Empty } else { grid.block(x, y, z) };
                let block = if coder.code_in(known == BlockState::Mixed, &mut is_mixed[context]) {
                    BlockState::Mixed
                } else if coder.code_in(known == BlockState::Full, &mut is_full[context]) {
                    BlockState::Full
                } else {
                    BlockState::Empty
                };
                blocks[(z * y_count + y) * x_count + x] = block;
            }
        }
    }
    blocks
}

/// The counters of vertices.
struct Contexts {
    /// Counters by the near neighbors, and by all.
    near: Vec<Counter>,
    all: Vec<Counter>,
    /// \[surroundings unset, set\] the counter of the bit for whether a row differs from its surroundings.
    differs: [Counter; 2],
}

impl Contexts {
    fn new() -> Self {
        let counters = |bits: u32| vec![Counter::default(); 1 << bits];
        Self { near: counters(NEAR), all: counters(ALL), differs: Default::default() }
    }

    /// Codes `count` vertices that are beside each other in a row; bit 8 + i of `windows` is at the x of vertex i. Returns
    /// their bits. Not inlined: a browser compiles a function better only for the calls after that.
    #[inline(never)]
    fn code_row(&mut self, coder: &mut impl Coder, windows: [u32; ROWS.len()], count: usize) -> u8 {
        // The two vertices before.
        let mut own = (windows[0] >> (8 - OWN)) as usize % (1 << OWN);
        if let Some(around) = alike_around(&windows, own, count) {
            let mask = u8::MAX >> (BLOCK - count);
            let row = if around { mask } else { 0 };
            let differs = (windows[0] >> 8) as u8 & mask != row;
            if !coder.code_in(differs, &mut self.differs[usize::from(around)]) {
                return row;
            }
        }
        // Byte i of these holds bits 2 to 9, and bits 10 to 17, of the context of vertex i.
        let mut others = [0u64; 2];
        for (all, neighbors) in others.iter_mut().zip(&NEIGHBORS) {
            for (bit, &(row, x)) in neighbors.iter().enumerate() {
                *all |= SPREAD[(windows[row] >> (8 + x) & 0xff) as usize] << bit;
            }
        }
        let mut row = 0;
        for i in 0..count {
            let [low, high] = others.map(|others| (others >> (8 * i)) as usize & 0xff);
            let context = (high << 8 | low) << OWN | own;
            let (near, all) = (&mut self.near[context % (1 << NEAR)], &mut self.all[context]);
            let probability = select_unpredictable(all.seen() < ENOUGH, near.probability(), all.probability());
            let bit = coder.code(windows[0] >> (8 + i) & 1 != 0, probability, [near, all]);
            own = own >> 1 | usize::from(bit) << (OWN - 1);
            row |= u8::from(bit) << i;
        }
        row
    }
}

/// The state that all vertices around a row of `count` have: the two before it, `own`, and the others in `windows`. `None` if
/// they differ.
#[inline(always)]
fn alike_around(windows: &[u32; ROWS.len()], own: usize, count: usize) -> Option<bool> {
    let (mut set, mut unset) = (own as u32, own as u32 ^ ((1 << OWN) - 1));
    // By index: an iterator over both copies `windows`, and waits for them.
    for row in 1..ROWS.len() {
        let mask = ((1 << (count as u32 + 2 * REACH[row])) - 1) << (8 - REACH[row]);
        set |= windows[row] & mask;
        unset |= !windows[row] & mask;
    }
    if set == 0 { Some(false) } else { (unset == 0).then_some(true) }
}

impl BitGrid {
    fn empty(vertices: [u32; 3]) -> Self {
        let vertices = vertices.map(|n| n as usize);
        Self { vertices, bits: vec![0; vertices.iter().product::<usize>().div_ceil(8) + BEHIND] }
    }

    /// Vertices of block `x` of a row.
    #[inline(always)]
    fn count(&self, x: usize) -> usize {
        BLOCK.min(self.vertices[0] - BLOCK * x)
    }

    /// The bits of all vertices of block `x` of a row.
    #[inline(always)]
    fn mask(&self, x: usize) -> u8 {
        u8::MAX >> (BLOCK - self.count(x))
    }

    /// The first vertex of the row of `y` and `z`.
    #[inline(always)]
    fn row(&self, y: usize, z: usize) -> usize {
        (z * self.vertices[1] + y) * self.vertices[0]
    }

    /// \[row of [`ROWS`]\] the first vertices of the rows around that of `y` and `z`; `None` outside the grid.
    fn rows_around(&self, y: usize, z: usize) -> [Option<usize>; ROWS.len()] {
        let mut rows = [None; ROWS.len()];
        for (row, [dy, dz]) in rows.iter_mut().zip(ROWS) {
            if let (Some(y), Some(z)) = (y.checked_add_signed(dy), z.checked_add_signed(dz))
                && y < self.vertices[1]
            {
                *row = Some(self.row(y, z));
            }
        }
        rows
    }

    /// The state of block (`x`, `y`, `z`).
    fn block(&self, x: usize, y: usize, z: usize) -> BlockState {
        let (mut any, mut every) = (false, true);
        for z in BLOCK * z..(BLOCK * z + BLOCK).min(self.vertices[2]) {
            for y in BLOCK * y..(BLOCK * y + BLOCK).min(self.vertices[1]) {
                let byte = (self.window(x, self.row(y, z)) >> 8) as u8 & self.mask(x);
                any |= byte != 0;
                every &= byte == self.mask(x);
            }
        }
        match (any, every) {
            (false, _) => BlockState::Empty,
            (true, true) => BlockState::Full,
            (true, false) => BlockState::Mixed,
        }
    }

    /// The vertices of block `x` in a row that begins at vertex `row`, from bit 8 on, between eight before and eight behind
    /// them. There are zeros beyond the ends of the row.
    #[inline(always)]
    fn window(&self, x: usize, row: usize) -> u32 {
        let first = row + (BLOCK * x).saturating_sub(BLOCK);
        let bytes = self.bits[first / 8..].first_chunk().map_or(0, |&bytes| u32::from_le_bytes(bytes)) >> (first % 8);
        let from = if x == 0 { bytes << BLOCK } else { bytes };
        let count = (self.vertices[0] + BLOCK - BLOCK * x).min(3 * BLOCK);
        from & ((1 << count) - 1)
    }

    /// The windows of block `x` in these rows.
    #[inline(always)]
    fn windows(&self, x: usize, rows: &[Option<usize>; ROWS.len()]) -> [u32; ROWS.len()] {
        let mut windows = [0; ROWS.len()];
        for (window, row) in windows.iter_mut().zip(rows) {
            if let &Some(row) = row {
                *window = self.window(x, row);
            }
        }
        windows
    }

    /// Sets the vertices of `bits` in block `x` of a row that begins at vertex `row`.
    #[inline(always)]
    fn set(&mut self, x: usize, row: usize, bits: u8) {
        let first = row + BLOCK * x;
        let [lower, upper] = (u16::from(bits) << (first % 8)).to_le_bytes();
        self.bits[first / 8] |= lower;
        self.bits[first / 8 + 1] |= upper;
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

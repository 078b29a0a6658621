//! Filling of holes in surfaces.
//!
//! A scanned surface is one cell thin, so a closing by a ball of the hole's radius does not fill the hole: the ball
//! sinks through it. A ball of radius R sinks into a hole of radius h by R − √(R² − h²) ≈ h²/2R, which is less than
//! half a cell if R exceeds h². Therefore cells are grown by h² + ½ and shrunk by h² (in cells). Of the cells that this
//! adds, those within h of an occupied cell that are not its neighbors are kept, and the neighbors of these. A hole in
//! a flat surface is thus filled exactly if it is two cells wide, and concave corners are filled by at most h. Both
//! steps are thresholds on exact Euclidean distances (Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled
//! Functions", 2012).

use glam::{DVec3, IVec3};
use rayon::prelude::*;

/// Cells of the box for the distance transform; each takes 8 bytes.
pub(super) const MAX_BLOCK: u64 = 1 << 27;

/// Squared distance if there is no occupied cell; sums of it stay finite.
const FAR: f32 = 1e30;

/// A box of cells, x fastest.
struct CellBlock {
    first: IVec3,
    size: [usize; 3],
    /// Edge lengths of a cell over the shortest one.
    aspect: DVec3,
}

/// `cells`, ascending by (z, y, x), and the cells that fill holes of up to `radius`, in the same order. The unit of
/// `radius` is the shortest edge of a cell; `aspect` are the edge lengths in this unit. `None` if the box around the
/// cells is larger than [`MAX_BLOCK`].
pub(super) fn filled(cells: &[IVec3], radius: f64, aspect: DVec3) -> Option<Vec<IVec3>> {
    let ball = radius * radius;
    let margin = ((ball + 1.5) / aspect).ceil().as_ivec3() + 1;
    let bounds = cells.iter().fold(None, |b: Option<(IVec3, IVec3)>, &c| {
        Some(b.map_or((c, c), |(least, most)| (least.min(c), most.max(c))))
    });
    let Some((least, most)) = bounds else { return Some(Vec::new()) };
    let (least, most) = (least.as_i64vec3() - margin.as_i64vec3(), most.as_i64vec3() + margin.as_i64vec3());
    let size = (most - least + 1).to_array();
    let count = size.iter().try_fold(1_u64, |all, &n| all.checked_mul(n as u64)).filter(|&n| n <= MAX_BLOCK)?;
    let block = CellBlock { first: least.as_ivec3(), size: size.map(|n| n as usize), aspect };

    let mut distances = vec![FAR; count as usize];
    cells.iter().for_each(|&cell| distances[block.index(cell)] = 0.0);
    block.transform(&mut distances);
    let beside = (aspect.max_element().powi(2) * (1.0 + 1e-6)) as f32;
    let grown = ((ball + 0.5) * (ball + 0.5)) as f32;
    let mut outside: Vec<f32> = distances.par_iter().map(|&d| if d <= grown { FAR } else { 0.0 }).collect();
    block.transform(&mut outside);
    let near = (radius * radius * (1.0 + 1e-6)) as f32;
    let shrunk = (ball * ball * (1.0 + 1e-6)) as f32;
    // Farther from all cells than their neighbors: shrinking by half a cell less than growing also adds a layer on
    // slopes.
    let deep = |n: usize| distances[n] > beside && distances[n] <= near && outside[n] > shrunk;
    let kept = |&n: &usize| {
        distances[n] == 0.0 || deep(n) || (distances[n] <= beside && outside[n] > shrunk && block.around(n).any(deep))
    };
    Some((0..count as usize).filter(kept).map(|n| block.cell(n)).collect())
}

impl CellBlock {
    fn index(&self, cell: IVec3) -> usize {
        let [x, y, z] = (cell - self.first).to_array().map(|v| v as usize);
        (z * self.size[1] + y) * self.size[0] + x
    }

    fn cell(&self, index: usize) -> IVec3 {
        let [width, height, _] = self.size;
        let [x, y, z] = [index % width, index / width % height, index / (width * height)].map(|v| v as i32);
        self.first + IVec3::new(x, y, z)
    }

    /// The up to 26 neighbors of a cell.
    fn around(&self, index: usize) -> impl Iterator<Item = usize> + '_ {
        let at = self.cell(index) - self.first;
        let size = IVec3::from_array(self.size.map(|n| n as i32));
        let offsets = (0..27).map(|n| IVec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1));
        let inside = move |c: &IVec3| c.cmpge(IVec3::ZERO).all() && c.cmplt(size).all();
        offsets.map(move |o| at + o).filter(inside).map(|c| self.index(self.first + c))
    }

    /// Replaces values, 0 at some cells and [`FAR`] elsewhere, by squared distances from these cells.
    fn transform(&self, values: &mut [f32]) {
        let [width, height, depth] = self.size;
        let squared = (self.aspect * self.aspect).as_vec3();
        values.par_chunks_exact_mut(width).for_each_init(Envelope::default, |envelope, row| {
            envelope.lower(row.len(), squared.x, |i| row[i]);
            envelope.distances(squared.x, |i, d| row[i] = d);
        });
        values.par_chunks_exact_mut(width * height).for_each_init(Envelope::default, |envelope, layer| {
            for x in 0..width {
                envelope.lower(height, squared.y, |y| layer[y * width + x]);
                envelope.distances(squared.y, |y, d| layer[y * width + x] = d);
            }
        });
        // Columns along z, one plane of (x, z) per task, so that each task owns its output.
        let planes: Vec<Vec<f32>> = (0..height)
            .into_par_iter()
            .map_init(Envelope::default, |envelope, y| {
                let mut plane = vec![0.0; width * depth];
                for x in 0..width {
                    envelope.lower(depth, squared.z, |z| values[(z * height + y) * width + x]);
                    envelope.distances(squared.z, |z, d| plane[z * width + x] = d);
                }
                plane
            })
            .collect();
        values.par_chunks_exact_mut(width).enumerate().for_each(|(row, values)| {
            let (z, y) = (row / height, row % height);
            values.copy_from_slice(&planes[y][z * width..][..width]);
        });
    }
}

/// The lower envelope of parabolas, one at each position of a line.
#[derive(Default)]
struct Envelope {
    count: usize,
    /// (position, height) of the parabolas of the envelope.
    parabolas: Vec<(usize, f32)>,
    /// Position from which on each parabola is the lowest.
    from: Vec<f32>,
}

impl Envelope {
    /// Computes the envelope of the parabolas weight·(i − place)² + height(place).
    fn lower(&mut self, count: usize, weight: f32, height: impl Fn(usize) -> f32) {
        self.count = count;
        self.parabolas.clear();
        self.from.clear();
        for place in 0..count {
            let value = height(place);
            if value >= FAR {
                continue;
            }
            let mut from = f32::NEG_INFINITY;
            while let Some(&(other, lowest)) = self.parabolas.last() {
                let (p, q) = (place as f32, other as f32);
                from = ((value - lowest) / weight + (p * p - q * q)) / (2.0 * (p - q));
                if from > self.from[self.from.len() - 1] {
                    break;
                }
                self.parabolas.pop();
                self.from.pop();
                from = f32::NEG_INFINITY;
            }
            self.parabolas.push((place, value));
            self.from.push(from);
        }
    }

    /// Calls `set` with the height of the envelope at each position.
    fn distances(&self, weight: f32, mut set: impl FnMut(usize, f32)) {
        let mut n = 0;
        for place in 0..self.count {
            let Some(&(mut at)) = self.parabolas.get(n) else {
                set(place, FAR);
                continue;
            };
            while n + 1 < self.parabolas.len() && self.from[n + 1] < place as f32 {
                n += 1;
                at = self.parabolas[n];
            }
            let along = place as f32 - at.0 as f32;
            set(place, weight * along * along + at.1);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use strivec_format::random::Random;

    #[test]
    fn distances_are_those_of_a_search_through_all() {
        let block = CellBlock { first: IVec3::new(-3, 2, 0), size: [9, 7, 8], aspect: DVec3::new(1.0, 1.5, 2.0) };
        let random = Random::new(0, "holes");
        for some in [1_u64, 5, 60] {
            let set: Vec<usize> = (0..some).map(|i| (random.substream(some).uniform(i) * 504.0) as usize).collect();
            let mut values = vec![FAR; 504];
            set.iter().for_each(|&n| values[n] = 0.0);
            block.transform(&mut values);
            for (n, value) in values.iter().enumerate() {
                let to = |&m: &usize| ((block.cell(n) - block.cell(m)).as_dvec3() * block.aspect).length_squared();
                let nearest = set.iter().map(to).fold(f64::INFINITY, f64::min);
                assert!((f64::from(*value) - nearest).abs() < 1e-4, "{n}: {value} and {nearest}");
            }
        }
    }

    /// A plate with a hole of a squared radius, tilted by `slope` along x.
    fn plate(hole: i32, slope: f64) -> Vec<IVec3> {
        let cells: BTreeSet<[i32; 3]> = (-20..=20)
            .flat_map(|y: i32| (-20..=20).map(move |x: i32| (x, y)))
            .filter(|(x, y)| x * x + y * y > hole)
            .map(|(x, y)| [(slope * f64::from(x)).round() as i32, y, x])
            .collect();
        cells.into_iter().map(|[z, y, x]| IVec3::new(x, y, z)).collect()
    }

    #[test]
    fn a_hole_is_filled_by_its_radius_and_not_by_less_and_nothing_else_is() {
        for hole in [2, 3, 5] {
            let before = plate(hole * hole, 0.0);
            // To the nearest cell beyond the rim it is one farther.
            let after = filled(&before, f64::from(hole) + 1.0, DVec3::ONE).unwrap();
            assert!(after == plate(-1, 0.0), "a hole of {hole}: {} cells", after.len());
            let less = filled(&before, f64::from(hole) - 0.5, DVec3::ONE).unwrap();
            assert!(!less.contains(&IVec3::ZERO), "a hole of {hole}");
        }
    }

    #[test]
    fn a_hole_in_a_tilted_plate_is_filled_and_the_plate_hardly_grows() {
        for slope in [0.3, 0.7, 1.0] {
            let whole = plate(-1, slope);
            let after = filled(&plate(9, slope), 4.5, DVec3::ONE).unwrap();
            let missing = whole.iter().filter(|c| !after.contains(c)).count();
            assert_eq!(missing, 0, "slope {slope}");
            assert!(after.len() < whole.len() * 11 / 10, "slope {slope}: {} of {}", after.len(), whole.len());
        }
    }

    #[test]
    fn nothing_stays_nothing_and_boxes_too_large_are_refused() {
        assert_eq!(filled(&[], 3.0, DVec3::ONE), Some(Vec::new()));
        assert_eq!(filled(&[IVec3::ZERO, IVec3::new(0, 0, 1 << 29)], 1.0, DVec3::ONE), None);
    }
}

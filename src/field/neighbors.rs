//! Neighbors of samples and their weights (spec 4.1, 4.2, 4.4). Twin: `shaders/neighbors.wgsl`.
//!
//! Consecutive samples of a ray mostly lie in cells with the same candidates. Each candidate is tested against a group
//! of such samples at once, one lane per sample.

use pulp::Simd;

use super::index::{BLOCK, CandidateBlock};
use super::positions::Positions;
use super::vector::MAX_LANES;
use super::{Contribution, FieldScale, InterpolationSite, Real};
use crate::model::{Aggregation, MAX_TOP_K};

/// The neighbors found for a batch of samples, and scratch.
pub(super) struct Neighbors<'a, T> {
    aggregation: Aggregation,
    /// The interpolation sites of all samples.
    sites: &'a mut Vec<InterpolationSite<T>>,
    /// \[scale × samples + sample\] the sample's range of `sites`.
    ranges: &'a mut Vec<[u32; 2]>,
    covering: Covering<T>,
    /// \[sample\] the candidate list of its cell.
    lists: Vec<u32>,
}

/// The candidates that cover any sample of a group, one lane per sample.
struct Covering<T> {
    count: usize,
    tensors: [u32; BLOCK],
    /// Weights; 0 if the candidate is no neighbor of the lane's sample.
    weights: [[T; MAX_LANES]; BLOCK],
    lowers: [[[T; MAX_LANES]; 3]; BLOCK],
    fractions: [[[T; MAX_LANES]; 3]; BLOCK],
}

impl<'a, T: Real> Neighbors<'a, T> {
    pub(super) fn new(
        aggregation: Aggregation,
        sites: &'a mut Vec<InterpolationSite<T>>,
        ranges: &'a mut Vec<[u32; 2]>,
    ) -> Self {
        let covering = Covering {
            count: 0,
            tensors: [0; BLOCK],
            weights: [[T::zero(); MAX_LANES]; BLOCK],
            lowers: [[[T::zero(); MAX_LANES]; 3]; BLOCK],
            fractions: [[[T::zero(); MAX_LANES]; 3]; BLOCK],
        };
        Self { aggregation, sites, ranges, covering, lists: Vec::new() }
    }
}

impl<T: Real> FieldScale<T> {
    /// True if any tensor covers `position`.
    pub fn is_covered(&self, position: [T; 3]) -> bool {
        self.candidates(position).any(|(_, square)| square.is_finite())
    }

    /// The candidates for `position`, ascending, and the squares of its distances to their centers, infinite for
    /// candidates that do not cover it.
    fn candidates(&self, position: [T; 3]) -> impl Iterator<Item = (u32, T)> {
        self.index().blocks(self.index().list_at(position)).iter().flat_map(move |block| {
            (0..block.count as usize).map(move |l| {
                let [x, y, z] = [0, 1, 2].map(|a| position[a] - block.centers[a][l]);
                let covers =
                    x.abs() <= self.half_edge[0] && y.abs() <= self.half_edge[1] && z.abs() <= self.half_edge[2];
                (block.tensors[l], if covers { x * x + y * y + z * z } else { T::infinity() })
            })
        })
    }

    /// Appends the `top_k` nearest covering tensors of each of `positions`.
    #[inline(always)]
    pub(super) fn find_nearest<S: Simd>(&self, simd: S, positions: &Positions<T>, found: &mut Neighbors<T>) {
        let mut lists = std::mem::take(&mut found.lists);
        self.index().lists_at(simd, positions, &mut lists);
        let mut first = 0;
        while first < lists.len() {
            let list = lists[first];
            let mut end = first + 1;
            let max_end = lists.len().min(first + T::lanes::<S>());
            while end < max_end && lists[end] == list {
                end += 1;
            }
            self.find_of_group(simd, positions, first..end, list, found);
            first = end;
        }
        found.lists = lists;
    }

    /// [`FieldScale::find_nearest`] for a `group` of at most a register's lanes, in cells with the same `list`.
    #[inline(always)]
    fn find_of_group<S: Simd>(
        &self,
        simd: S,
        positions: &Positions<T>,
        group: std::ops::Range<usize>,
        list: u32,
        found: &mut Neighbors<T>,
    ) {
        let is_covering_known = match self.index().blocks(list) {
            [block] => self.cover(simd, block, positions, &group, found),
            _ => false,
        };
        for (lane, sample) in group.enumerate() {
            let begin = found.sites.len() as u32;
            if is_covering_known {
                self.push_lane_sites(&found.covering, lane, found.sites);
            } else {
                self.nearest_of_any(positions.get(sample), found.aggregation, found.sites);
            }
            found.ranges.push([begin, found.sites.len() as u32]);
        }
    }

    /// Finds the candidates of `block` that cover any sample of `group`, with their weights; false if a sample is at a
    /// center, which needs another formula.
    #[inline(always)]
    fn cover<S: Simd>(
        &self,
        simd: S,
        block: &CandidateBlock<T>,
        positions: &Positions<T>,
        group: &std::ops::Range<usize>,
        found: &mut Neighbors<T>,
    ) -> bool {
        let aggregation = found.aggregation;
        let found = &mut found.covering;
        found.count = 0;
        let zero = T::splat(simd, T::zero());
        let one = T::splat(simd, T::one());
        let infinity = T::splat(simd, T::infinity());
        let x = T::load(simd, &positions.axis(0)[group.start..]);
        let y = T::load(simd, &positions.axis(1)[group.start..]);
        let z = T::load(simd, &positions.axis(2)[group.start..]);
        let position = [x, y, z];
        let mut in_group = [T::infinity(); MAX_LANES];
        in_group[..group.len()].fill(T::zero());
        // No candidate covers lanes without a sample.
        let in_group = T::less_or_equal(simd, T::load(simd, &in_group), zero);

        let mut squares = [infinity; BLOCK];
        let mut counts = zero;
        for c in 0..block.count as usize {
            let mut square = zero;
            let mut covers = in_group;
            let mut offsets = [zero; 3];
            for a in 0..3 {
                let offset = T::minus(simd, position[a], T::splat(simd, block.centers[a][c]));
                square = T::times_plus(simd, offset, offset, square);
                let within = T::less_or_equal(simd, T::magnitude(simd, offset), T::splat(simd, self.half_edge[a]));
                covers = T::both(simd, covers, within);
                offsets[a] = offset;
            }
            let square = T::select(simd, covers, square, infinity);
            let least = T::least(simd, square);
            if least == T::zero() {
                return false;
            }
            if least == T::infinity() {
                continue;
            }
            counts = T::plus(simd, counts, T::select(simd, covers, one, zero));
            squares[found.count] = square;
            found.tensors[found.count] = block.tensors[c];
            for a in 0..3 {
                let (lower, fraction) = self.rows().on_axis_of_many(simd, a, offsets[a]);
                T::store(simd, &mut found.lowers[found.count][a], lower);
                T::store(simd, &mut found.fractions[found.count][a], fraction);
            }
            found.count += 1;
        }
        let squares = &mut squares[..found.count.min(BLOCK)];
        let fewest = T::least(simd, T::minus(simd, T::splat(simd, T::of(self.top_k() as f64)), counts));
        if fewest < T::zero() {
            self.drop_far::<S>(simd, squares);
        }
        weigh_lanes(simd, aggregation, squares, &mut found.weights);
        true
    }

    /// Sets all but the `top_k` smallest squares of each lane to infinity. Of equal squares the earlier is smaller.
    #[inline(always)]
    fn drop_far<S: Simd>(&self, simd: S, squares: &mut [T::Register<S>]) {
        let one = T::splat(simd, T::one());
        let zero = T::splat(simd, T::zero());
        let mut ranks = [zero; BLOCK];
        for later in 1..squares.len() {
            for earlier in 0..later {
                let in_order = T::less_or_equal(simd, squares[earlier], squares[later]);
                ranks[later] = T::plus(simd, ranks[later], T::select(simd, in_order, one, zero));
                ranks[earlier] = T::plus(simd, ranks[earlier], T::select(simd, in_order, zero, one));
            }
        }
        let last = T::splat(simd, T::of(self.top_k() as f64 - 1.0));
        for (square, rank) in squares.iter_mut().zip(&ranks) {
            let near = T::less_or_equal(simd, *rank, last);
            *square = T::select(simd, near, *square, T::splat(simd, T::infinity()));
        }
    }

    /// Appends the sites of one sample of a group.
    #[inline(always)]
    fn push_lane_sites(&self, covering: &Covering<T>, lane: usize, sites: &mut Vec<InterpolationSite<T>>) {
        let rows = self.rows();
        for c in 0..covering.count.min(BLOCK) {
            let weight = covering.weights[c][lane];
            if weight > T::zero() {
                let row = |a: usize| rows.first(a) + covering.lowers[c][a][lane].small_u32();
                let fractions = &covering.fractions[c];
                sites.push(InterpolationSite {
                    tensor: self.first_tensor + covering.tensors[c],
                    rows: [row(0), row(1), row(2)],
                    fractions: [fractions[0][lane], fractions[1][lane], fractions[2][lane]],
                    weight,
                });
            }
        }
    }

    /// Appends the `top_k` nearest of any number of candidates, nearest first. By insertion, for single samples.
    #[inline(never)]
    fn nearest_of_any(&self, position: [T; 3], aggregation: Aggregation, sites: &mut Vec<InterpolationSite<T>>) {
        let mut values = [T::infinity(); MAX_TOP_K as usize];
        let mut tensors = [0; MAX_TOP_K as usize];
        let mut count = 0;
        for (tensor, square) in self.candidates(position).filter(|c| c.1.is_finite()) {
            // Candidates ascend, so of equally near tensors the first remains in front.
            let mut index = count;
            while index > 0 && square < values[index - 1] {
                index -= 1;
            }
            if index == self.top_k() {
                continue;
            }
            count = (count + 1).min(self.top_k());
            values.copy_within(index..count - 1, index + 1);
            tensors.copy_within(index..count - 1, index + 1);
            values[index] = square;
            tensors[index] = tensor;
        }
        weigh(aggregation, &mut values[..count]);
        for (tensor, weight) in tensors.into_iter().zip(values).take(count) {
            sites.push(self.locate(Contribution { tensor: self.first_tensor + tensor, weight }, position));
        }
    }
}

/// Turns the squared distances of each lane into `weights` (spec 4.4). Infinite squares have weight 0. Overwrites
/// `squares`.
#[inline(always)]
fn weigh_lanes<T: Real, S: Simd>(
    simd: S,
    aggregation: Aggregation,
    squares: &mut [T::Register<S>],
    weights: &mut [[T; MAX_LANES]; BLOCK],
) {
    let one = T::splat(simd, T::one());
    let mut sum = T::splat(simd, T::zero());
    for square in squares.iter_mut() {
        let root = T::root(simd, *square);
        *square = match aggregation {
            Aggregation::Normalized => T::over(simd, one, root),
            Aggregation::Clamped => T::over(simd, one, T::plus(simd, root, T::splat(simd, T::of(1e-6)))),
        };
        sum = T::plus(simd, sum, *square);
    }
    let divisor = match aggregation {
        Aggregation::Normalized => sum,
        Aggregation::Clamped => T::select(simd, T::less_or_equal(simd, one, sum), sum, one),
    };
    let scale = T::over(simd, one, divisor);
    for (weights, square) in weights.iter_mut().zip(squares.iter()) {
        T::store(simd, weights, T::times(simd, *square, scale));
    }
}

/// Turns squared distances, nearest first, into weights (spec 4.4).
fn weigh<T: Real>(aggregation: Aggregation, values: &mut [T]) {
    let Some(&nearest) = values.first() else { return };
    match aggregation {
        // At a center, that tensor alone has a weight.
        Aggregation::Normalized if nearest == T::zero() => {
            values.fill(T::zero());
            values[0] = T::one();
        }
        Aggregation::Normalized => {
            values.iter_mut().for_each(|v| *v = (nearest / *v).sqrt());
            let sum: T = values.iter().copied().sum();
            values.iter_mut().for_each(|v| *v /= sum);
        }
        Aggregation::Clamped => {
            values.iter_mut().for_each(|v| *v = T::one() / (v.sqrt() + T::of(1e-6)));
            let sum = values.iter().copied().sum::<T>().max(T::one());
            values.iter_mut().for_each(|v| *v /= sum);
        }
    }
}

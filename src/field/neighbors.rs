//! Finding the tensors that samples aggregate (DESIGN, sections 2.1, 2.2 and 2.4).
//!
//! Samples that follow each other on a ray mostly lie in cells with the same candidates. Each candidate is then tested
//! against all of them at once, a lane a sample.

use pulp::Simd;

use super::index::{BLOCK, CandidateBlock};
use super::vector::MAX_LANES;
use super::{Contribution, FieldScale, InterpolationSite, Real};
use crate::model::{Aggregation, MAX_TOP_K};

/// Positions by axis, with room to read a whole register from any of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Positions<T> {
    axes: [Vec<T>; 3],
    len: usize,
}

impl<T: Real> Positions<T> {
    pub(super) fn clear(&mut self) {
        self.axes.iter_mut().for_each(Vec::clear);
        self.len = 0;
    }

    pub(super) fn push(&mut self, position: [T; 3]) {
        for a in 0..3 {
            self.axes[a].push(position[a]);
        }
        self.len += 1;
    }

    /// Ends pushing.
    pub(super) fn pad(&mut self) {
        self.axes.iter_mut().for_each(|axis| axis.resize(self.len + MAX_LANES, T::zero()));
    }

    #[inline(always)]
    pub(super) fn get(&self, n: usize) -> [T; 3] {
        [self.axes[0][n], self.axes[1][n], self.axes[2][n]]
    }

    /// The coordinates on axis `a`.
    #[inline(always)]
    pub(super) fn axis(&self, a: usize) -> &[T] {
        &self.axes[a]
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }
}

/// Neighbors of samples, and scratch for finding them.
pub(super) struct Neighbors<'a, T> {
    aggregation: Aggregation,
    /// What interpolating the contributions needs.
    sites: &'a mut Vec<InterpolationSite<T>>,
    /// \[sample\] where its contributions are in `sites`.
    ranges: &'a mut Vec<[u32; 2]>,
    covering: Covering<T>,
    /// \[sample\] the list of its cell.
    lists: Vec<u32>,
}

/// What is known of the candidates that cover any of a group of samples, a lane a sample.
struct Covering<T> {
    count: usize,
    tensors: [u32; BLOCK],
    /// 0 where the candidate does not count.
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
    /// Whether any tensor covers `position`.
    pub fn is_covered(&self, position: [T; 3]) -> bool {
        self.candidates(position).any(|(_, square)| square.is_finite())
    }

    /// The candidates for `position`, ascending, and the squares of its distances to their centers, infinite where they
    /// do not cover it.
    fn candidates(&self, position: [T; 3]) -> impl Iterator<Item = (u32, T)> {
        self.index().blocks(self.index().list_at(position)).iter().flat_map(move |block| {
            (0..block.count as usize).map(move |l| {
                let [x, y, z] = [0, 1, 2].map(|a| position[a] - block.centers[a][l]);
                let covers = x.abs() <= self.half[0] && y.abs() <= self.half[1] && z.abs() <= self.half[2];
                (block.tensors[l], if covers { x * x + y * y + z * z } else { T::infinity() })
            })
        })
    }

    /// Appends, for each of `positions`, its `top_k` nearest covering tensors.
    #[inline(always)]
    pub(super) fn find_nearest<S: Simd>(&self, simd: S, positions: &Positions<T>, found: &mut Neighbors<T>) {
        let mut lists = std::mem::take(&mut found.lists);
        self.index().lists_at(simd, positions, &mut lists);
        let mut first = 0;
        while first < lists.len() {
            let list = lists[first];
            let mut end = first + 1;
            let most = lists.len().min(first + T::lanes::<S>());
            while end < most && lists[end] == list {
                end += 1;
            }
            self.find_of_group(simd, positions, first..end, list, found);
            first = end;
        }
        found.lists = lists;
    }

    /// [`FieldScale::find_nearest`] for samples in cells with the same `list`, of no more than a register's lanes.
    #[inline(always)]
    fn find_of_group<S: Simd>(
        &self,
        simd: S,
        positions: &Positions<T>,
        group: std::ops::Range<usize>,
        list: u32,
        found: &mut Neighbors<T>,
    ) {
        let known = match self.index().blocks(list) {
            [block] => self.cover(simd, block, positions, &group, found),
            _ => false,
        };
        for (lane, n) in group.enumerate() {
            let begin = found.sites.len() as u32;
            if known {
                self.push_lane_sites(&found.covering, lane, found.sites);
            } else {
                self.nearest_of_any(positions.get(n), found.aggregation, found.sites);
            }
            found.ranges.push([begin, found.sites.len() as u32]);
        }
    }

    /// Finds the candidates of `block` that cover any sample of `group`; false where a sample is at a center.
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
        let x = T::load(simd, &positions.axes[0][group.start..]);
        let y = T::load(simd, &positions.axes[1][group.start..]);
        let z = T::load(simd, &positions.axes[2][group.start..]);
        let position = [x, y, z];
        let mut in_group = [T::infinity(); MAX_LANES];
        in_group[..group.len()].fill(T::zero());
        // Lanes without a sample are nowhere.
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
                let within = T::less_or_equal(simd, T::magnitude(simd, offset), T::splat(simd, self.half[a]));
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

        let mut sum = zero;
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
        for (weights, square) in found.weights.iter_mut().zip(squares.iter()) {
            T::store(simd, weights, T::times(simd, *square, scale));
        }
        true
    }

    /// Leaves in each lane the `top_k` smallest squares finite; a tie leaves the earlier.
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

    /// Appends what covers one sample of a group.
    #[inline(always)]
    fn push_lane_sites(&self, covering: &Covering<T>, lane: usize, sites: &mut Vec<InterpolationSite<T>>) {
        let rows = self.rows();
        for c in 0..covering.count.min(BLOCK) {
            let weight = covering.weights[c][lane];
            if weight > T::zero() {
                let first = covering.tensors[c] * rows.count as u32;
                let row = |a: usize| first + rows.first(a) + covering.lowers[c][a][lane].small_u32();
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

    /// Appends the `top_k` nearest of any number of candidates, by insertion; nearest first.
    #[inline(never)]
    fn nearest_of_any(&self, position: [T; 3], aggregation: Aggregation, sites: &mut Vec<InterpolationSite<T>>) {
        let mut values = [T::infinity(); MAX_TOP_K as usize];
        let mut tensors = [0; MAX_TOP_K as usize];
        let mut count = 0;
        for (tensor, square) in self.candidates(position).filter(|c| c.1.is_finite()) {
            // Tensors ascend, so a tie leaves the smaller center in front.
            let mut at = count;
            while at > 0 && square < values[at - 1] {
                at -= 1;
            }
            if at == self.top_k() {
                continue;
            }
            count = (count + 1).min(self.top_k());
            values.copy_within(at..count - 1, at + 1);
            tensors.copy_within(at..count - 1, at + 1);
            values[at] = square;
            tensors[at] = tensor;
        }
        weigh(aggregation, &mut values[..count]);
        for (tensor, weight) in tensors.into_iter().zip(values).take(count) {
            sites.push(self.locate(Contribution { tensor: self.first_tensor + tensor, weight }, position));
        }
    }
}

/// Squared distances, nearest first, to weights (DESIGN, section 2.4).
fn weigh<T: Real>(aggregation: Aggregation, values: &mut [T]) {
    let Some(&nearest) = values.first() else { return };
    match aggregation {
        // The limit at a center: that tensor alone counts.
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

//! Neighbors of samples and their weights (spec 4.1, 4.2, 4.4). Twin: `shaders/neighbors.wgsl`.
//!
//! Samples of a ray, and of rays beside it, mostly lie in cells with the same candidates. Each candidate is tested
//! against a group of such samples at once, one lane per sample. A search per sample takes more than twice as long
//! (docs/experiments/2026-11-21-step-optimizations.md).

use pulp::Simd;

use super::index::{BLOCK, CandidateBlock};
use super::positions::Positions;
use super::samples::{Contributions, Neighborhood};
use super::vector::MAX_LANES;
use super::{Contribution, FieldScale, Real};
use strivec_format::model::{Aggregation, MAX_TOP_K};

/// The neighbors found for a batch of samples, and scratch.
pub(super) struct Neighbors<'a, T> {
    aggregation: Aggregation,
    /// Contributions of all samples found so far; those of the next are appended.
    contributions: &'a mut Contributions<T>,
    /// \[scale × samples + sample\] the sample's neighbors.
    neighborhoods: &'a mut Vec<Neighborhood>,
    covering: Covering<T>,
    /// \[sample\] the candidate list of its cell.
    lists: Vec<u32>,
}

/// Groups that are filled at the same time.
/// A tile of rays is in few lists at a time, so nearly all groups are full when they are evaluated: 15.1 of 16
/// samples. 256 are not faster (docs/experiments/2026-11-26-frame-in-tiles.md).
const OPEN_GROUPS: usize = 64;

/// Samples in cells with the same candidates.
#[derive(Clone, Copy)]
struct Group {
    /// Their candidate list.
    list: u32,
    /// Number of samples.
    count: usize,
    samples: [u32; MAX_LANES],
}

impl Group {
    const EMPTY: Self = Self { list: 0, count: 0, samples: [0; MAX_LANES] };
}

/// The candidates that cover any sample of a group, one lane per sample.
struct Covering<T> {
    count: usize,
    tensors: [u32; BLOCK],
    /// \[lane\] the number of candidates that cover the sample.
    counts: [T; MAX_LANES],
    /// Weights; 0 if the candidate is no neighbor of the lane's sample.
    weights: [[T; MAX_LANES]; BLOCK],
    lower: [[[u32; MAX_LANES]; 3]; BLOCK],
    fractions: [[[T; MAX_LANES]; 3]; BLOCK],
}

impl<'a, T: Real> Neighbors<'a, T> {
    pub(super) fn new(
        aggregation: Aggregation,
        contributions: &'a mut Contributions<T>,
        neighborhoods: &'a mut Vec<Neighborhood>,
    ) -> Self {
        let covering = Covering {
            count: 0,
            tensors: [0; BLOCK],
            counts: [T::zero(); MAX_LANES],
            weights: [[T::zero(); MAX_LANES]; BLOCK],
            lower: [[[0; MAX_LANES]; 3]; BLOCK],
            fractions: [[[T::zero(); MAX_LANES]; 3]; BLOCK],
        };
        Self { aggregation, contributions, neighborhoods, covering, lists: Vec::new() }
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
        // Taken out, because the groups borrow `found` as a whole.
        let mut lists = std::mem::take(&mut found.lists);
        self.index().lists_at(simd, positions, &mut lists);
        let first = found.neighborhoods.len();
        found.neighborhoods.resize(first + positions.len(), Neighborhood::default());
        // Groups are made across the rays of the batch, not ray by ray: rays side by side share lists, and a group
        // that is not full costs as much as a full one (docs/experiments/2026-11-25-lean-training.md).
        let mut groups = [Group::EMPTY; OPEN_GROUPS];
        for (sample, &list) in lists.iter().enumerate() {
            // A list has one place, so finding its group is no search. Lists that share a place only end groups
            // early.
            let group = &mut groups[list as usize % OPEN_GROUPS];
            if group.list != list || group.count == T::lanes::<S>() {
                self.find_of_group(simd, positions, group, first, found);
                (group.list, group.count) = (list, 0);
            }
            group.samples[group.count] = sample as u32;
            group.count += 1;
        }
        for group in &groups {
            self.find_of_group(simd, positions, group, first, found);
        }
        found.lists = lists;
    }

    /// [`FieldScale::find_nearest`] for the samples of `group`; sample 0 has neighborhood `first`.
    #[inline(always)]
    fn find_of_group<S: Simd>(
        &self,
        simd: S,
        positions: &Positions<T>,
        group: &Group,
        first: usize,
        found: &mut Neighbors<T>,
    ) {
        let samples = &group.samples[..group.count];
        let blocks = self.index().blocks(group.list);
        if samples.is_empty() || blocks.is_empty() {
            return;
        }
        // The samples of a group are anywhere in the batch.
        let mut lanes = [[T::zero(); MAX_LANES]; 3];
        for (a, lanes) in lanes.iter_mut().enumerate() {
            let axis = positions.axis(a);
            lanes.iter_mut().zip(samples).for_each(|(lane, &sample)| *lane = axis[sample as usize]);
        }
        // Ranking in registers is quadratic in the candidates. Lists of more than one block, of tensors with longer
        // edges than two pitches, are searched sample by sample instead.
        let is_covering_known = match blocks {
            [block] => self.cover(simd, block, &lanes, samples.len(), found),
            _ => false,
        };
        let Neighbors { aggregation, contributions, neighborhoods, covering, .. } = found;
        let neighborhoods = &mut neighborhoods[first..];
        if is_covering_known {
            self.push_covering(covering, samples, contributions, neighborhoods);
            return;
        }
        for &sample in samples {
            let begin = contributions.len() as u32;
            self.nearest_of_any(positions.get(sample as usize), *aggregation, contributions);
            let end = contributions.len() as u32;
            neighborhoods[sample as usize] = Neighborhood { contributions: [begin, end], is_covered: begin < end };
        }
    }

    /// Finds the candidates of `block` that cover any of the first `count` positions, \[axis\]\[lane\], with their weights;
    /// false if a position is at a center, which needs another formula.
    #[inline(always)]
    fn cover<S: Simd>(
        &self,
        simd: S,
        block: &CandidateBlock<T>,
        positions: &[[T; MAX_LANES]; 3],
        count: usize,
        found: &mut Neighbors<T>,
    ) -> bool {
        let aggregation = found.aggregation;
        let found = &mut found.covering;
        found.count = 0;
        let zero = T::splat(simd, T::zero());
        let one = T::splat(simd, T::one());
        let infinity = T::splat(simd, T::infinity());
        let [x, y, z] = positions;
        let position = [T::load(simd, x), T::load(simd, y), T::load(simd, z)];
        // Positions beyond the samples are zeros, which a box may contain.
        let mut in_group = [T::infinity(); MAX_LANES];
        in_group[..count].fill(T::zero());
        // No candidate covers lanes without a sample.
        let in_group = T::less_or_equal(simd, T::load(simd, &in_group), zero);

        let mut squares = [infinity; BLOCK];
        let mut counts = zero;
        // The candidate is the outer loop and the samples are the lanes. All lanes do the same, whether or not the
        // candidate covers them, so that no branch depends on a sample.
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
            // 1/d is infinite at a center (spec 4.4).
            if least == T::zero() {
                return false;
            }
            // Of 7.7 candidates, 4.3 cover a sample of the group; the others leave no row
            // (docs/experiments/2026-11-26-frame-in-tiles.md).
            if least == T::infinity() {
                continue;
            }
            counts = T::plus(simd, counts, T::select(simd, covers, one, zero));
            squares[found.count] = square;
            found.tensors[found.count] = block.tensors[c];
            for a in 0..3 {
                // Places between vertices are kept for density and appearance alike: finding them again took a third
                // of the appearance gather (docs/experiments/2026-11-25-lean-training.md).
                let (lower, fraction) = self.vertices().on_axis_of_many(simd, a, offsets[a]);
                T::store(simd, &mut found.fractions[found.count][a], fraction);
                let mut lowers = [T::zero(); MAX_LANES];
                T::store(simd, &mut lowers, lower);
                // Meaningless where the candidate does not cover the lane's sample.
                let vertices = &mut found.lower[found.count][a];
                vertices.iter_mut().zip(lowers).for_each(|(vertex, lower)| *vertex = lower.small_u32());
            }
            found.count += 1;
        }
        T::store(simd, &mut found.counts, counts);
        let squares = &mut squares[..found.count.min(BLOCK)];
        // With edges of 1.5 pitches a point is in 1, 2, 4 or 8 boxes, so only an eighth of a full lattice has more
        // than the usual four and needs a ranking.
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
        // Ranks by counting, without branches: lanes cannot be sorted apart. The counts are small integers, exact as
        // floating point.
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

    /// Appends the contributions to the samples of a group, without those of tensors that have no components, and sets
    /// their `neighborhoods`.
    #[inline(always)]
    fn push_covering(
        &self,
        covering: &Covering<T>,
        samples: &[u32],
        contributions: &mut Contributions<T>,
        neighborhoods: &mut [Neighborhood],
    ) {
        // Tensors without components cover and weigh but add nothing: 15 % of all after lean training
        // (docs/experiments/2026-11-25-lean-training.md).
        let mut held = [0; BLOCK];
        let mut count = 0;
        for (c, &tensor) in covering.tensors[..covering.count.min(BLOCK)].iter().enumerate() {
            held[count] = c;
            count += usize::from(self.blocks().any(|block| block.held().count(tensor as usize) > 0));
        }
        let begin = contributions.len();
        // Room for all, so that the ones of no weight can be overwritten by the next, without a branch.
        let room = contributions.room(samples.len() * count + 1);
        let mut end = 0;
        // From lanes to samples, as gathers read a sample's contributions one after the other. These writes are a
        // third of the time of neighbors (docs/experiments/2026-11-26-frame-in-tiles.md).
        for (lane, &sample) in samples.iter().enumerate() {
            let first = end;
            for &c in &held[..count] {
                let (lower, fractions, weight) =
                    (&covering.lower[c], &covering.fractions[c], covering.weights[c][lane]);
                room[end] = Contribution {
                    tensor: self.first_tensor + covering.tensors[c],
                    lower: [lower[0][lane], lower[1][lane], lower[2][lane]],
                    fractions: [fractions[0][lane], fractions[1][lane], fractions[2][lane]],
                    weight,
                };
                end += usize::from(weight > T::zero());
            }
            neighborhoods[sample as usize] = Neighborhood {
                contributions: [(begin + first) as u32, (begin + end) as u32],
                is_covered: covering.counts[lane] > T::zero(),
            };
        }
        contributions.keep(end);
    }

    /// Appends the `top_k` nearest of any number of candidates, nearest first. By insertion, for single samples.
    // Few samples come here, so its code stays out of the loop over groups.
    #[inline(never)]
    fn nearest_of_any(&self, position: [T; 3], aggregation: Aggregation, contributions: &mut Contributions<T>) {
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
        for (next, (tensor, weight)) in contributions.room(count).iter_mut().zip(tensors.into_iter().zip(values)) {
            *next = self.contribution(tensor, weight, position);
        }
        contributions.keep(count);
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
        // 1/∞ is 0, so lanes that a candidate does not cover need no mask.
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
    // Where nothing covers a lane, the sum is 0 and its weights are NaN; `push_covering` keeps weights above 0 alone.
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
            // Relative to the nearest: 1/d overflows beside a center, d₀/d does not.
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

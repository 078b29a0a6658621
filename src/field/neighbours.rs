//! Finding the tensors that a sample aggregates (DESIGN, sections 2.1, 2.2 and 2.4).

use pulp::Simd;

use super::index::{BLOCK, CandidateBlock};
use super::{FieldScale, Located, Pair, Real};
use crate::model::{Aggregation, MAX_TOP_K};

impl<T: Real> FieldScale<T> {
    /// Whether any tensor covers `position`.
    pub fn is_covered(&self, position: [T; 3]) -> bool {
        self.candidates(position).any(|(_, square)| square.is_finite())
    }

    /// The candidates for `position`, ascending, and the squares of its distances to their centres, infinite where they
    /// do not cover it.
    fn candidates(&self, position: [T; 3]) -> impl Iterator<Item = (u32, T)> {
        self.index().candidates(position).iter().flat_map(move |block| {
            (0..block.count as usize).map(move |l| {
                let [x, y, z] = [0, 1, 2].map(|a| position[a] - block.centers[a][l]);
                let covers = x.abs() <= self.half[0] && y.abs() <= self.half[1] && z.abs() <= self.half[2];
                (block.tensors[l], if covers { x * x + y * y + z * z } else { T::infinity() })
            })
        })
    }

    /// Puts the `top_k` nearest covering tensors and their weights first into `located`, which has room for them; returns
    /// how many there are.
    #[inline(always)]
    pub(super) fn find_nearest<S: Simd>(
        &self,
        simd: S,
        position: [T; 3],
        aggregation: Aggregation,
        located: &mut [Located<T>],
    ) -> usize {
        match self.index().candidates(position) {
            [] => 0,
            [block] => self.all_of_block(simd, block, position, aggregation, located),
            _ => self.nearest_of_any(position, aggregation, located),
        }
    }

    /// [`FieldScale::find_nearest`] where there are few candidates, side by side.
    #[inline(always)]
    fn all_of_block<S: Simd>(
        &self,
        simd: S,
        block: &CandidateBlock<T>,
        position: [T; 3],
        aggregation: Aggregation,
        located: &mut [Located<T>],
    ) -> usize {
        let mut squares = [T::infinity(); BLOCK];
        let mut lowers = [[T::zero(); BLOCK]; 3];
        let mut fractions = [[T::zero(); BLOCK]; 3];
        for first in (0..BLOCK).step_by(T::lanes::<S>()) {
            let infinity = T::splat(simd, T::infinity());
            let mut square = T::splat(simd, T::zero());
            let mut covers = T::less_or_equal(simd, square, infinity);
            for a in 0..3 {
                let center = T::load(simd, &block.centers[a][first..]);
                let offset = T::minus(simd, T::splat(simd, position[a]), center);
                square = T::times_plus(simd, offset, offset, square);
                let within = T::less_or_equal(simd, T::magnitude(simd, offset), T::splat(simd, self.half[a]));
                covers = T::both(simd, covers, within);
                let (lower, fraction) = self.rows().on_axis_of_many(simd, a, offset);
                T::store(simd, &mut lowers[a][first..], lower);
                T::store(simd, &mut fractions[a][first..], fraction);
            }
            let square = T::select(simd, covers, square, infinity);
            T::store(simd, &mut squares[first..], square);
        }
        // The places of those that cover, without a branch for each.
        let mut covering = [0; BLOCK];
        let mut count = 0;
        for (l, square) in squares.iter().enumerate().take(block.count as usize) {
            covering[count % BLOCK] = l;
            count += usize::from(square.is_finite());
        }
        if count > self.top_k() {
            choose_nearest(&squares, &mut covering[..count.min(BLOCK)], self.top_k());
            count = self.top_k();
        }
        let covering = &covering[..count.min(BLOCK)];
        // At a centre the weights below are infinite.
        if covering.iter().any(|&l| squares[l % BLOCK] == T::zero()) {
            return self.nearest_of_any(position, aggregation, located);
        }
        let mut sum = T::zero();
        for (at, &l) in located.iter_mut().zip(covering) {
            let distance = squares[l % BLOCK].sqrt();
            at.weight = match aggregation {
                Aggregation::Normalised => T::one() / distance,
                Aggregation::Clamped => T::one() / (distance + T::of(1e-6)),
            };
            sum += at.weight;
        }
        let scale = match aggregation {
            Aggregation::Normalised => T::one() / sum,
            Aggregation::Clamped => T::one() / sum.max(T::one()),
        };
        let rows = self.rows();
        for (at, &l) in located.iter_mut().zip(covering) {
            let l = l % BLOCK;
            let first = block.tensors[l] * rows.count as u32;
            at.tensor = self.first_tensor + block.tensors[l];
            at.weight *= scale;
            for a in 0..3 {
                at.rows[a] = first + rows.first(a) + lowers[a][l].small_u32();
                at.fractions[a] = fractions[a][l];
            }
        }
        count
    }

    /// [`FieldScale::find_nearest`] for any number of candidates, by insertion; nearest first.
    #[inline(never)]
    fn nearest_of_any(&self, position: [T; 3], aggregation: Aggregation, located: &mut [Located<T>]) -> usize {
        let mut values = [T::infinity(); MAX_TOP_K as usize];
        let mut tensors = [0; MAX_TOP_K as usize];
        let mut count = 0;
        for (tensor, square) in self.candidates(position).filter(|c| c.1.is_finite()) {
            // Tensors ascend, so a tie leaves the smaller centre in front.
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
        for (at, (tensor, weight)) in located.iter_mut().zip(tensors.into_iter().zip(values)).take(count) {
            *at = self.locate(Pair { tensor: self.first_tensor + tensor, weight }, position);
        }
        count
    }
}

/// Brings the `count` of `places` with the smallest squares to the front; a tie leaves the earlier place in front.
#[inline(always)]
fn choose_nearest<T: Real>(squares: &[T; BLOCK], places: &mut [usize], count: usize) {
    for i in 1..places.len() {
        let place = places[i];
        let square = squares[place % BLOCK];
        // Only the front has to be in order.
        let mut at = i.min(count);
        while at > 0 && square < squares[places[at - 1] % BLOCK] {
            places[at] = places[at - 1];
            at -= 1;
        }
        if at < count {
            places[at] = place;
        }
    }
}

/// Squared distances, nearest first, to weights (DESIGN, section 2.4).
fn weigh<T: Real>(aggregation: Aggregation, values: &mut [T]) {
    let Some(&nearest) = values.first() else { return };
    match aggregation {
        // The limit at a centre: that tensor alone counts.
        Aggregation::Normalised if nearest == T::zero() => {
            values.fill(T::zero());
            values[0] = T::one();
        }
        Aggregation::Normalised => {
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

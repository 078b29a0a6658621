//! The pairs of pictures that COLMAP's matching tries: the steps of its progress.

use super::options::Matching;

/// Pictures further on with which sequential matching pairs a picture.
const OVERLAP: u32 = 10;
/// Of so many pictures loop detection looks for the likest of one.
const LOOP_PERIOD: usize = 10;
/// The pictures that it finds.
const LOOP_PICTURES: usize = 50;

/// The pairs that are tried.
#[derive(Debug)]
pub(super) struct PairsTried {
    pictures: usize,
    /// Distances in the order of names of the pictures of a pair; empty if all pairs are tried.
    distances: Vec<usize>,
    /// Pairs of loop detection, at most.
    loops: u64,
}

impl PairsTried {
    /// The pairs of `pictures` by `matching`; with `next_nine` sequential matching also tries the nine pictures after each.
    pub(super) fn new(matching: Matching, pictures: usize, next_nine: bool, has_loops: bool) -> Self {
        let is_sequential = matching.of(pictures) == Matching::Sequential;
        let mut distances: Vec<usize> = (0..OVERLAP).map(|n| 1 << n).collect();
        distances.extend((1..OVERLAP as usize).filter(|_| next_nine));
        distances.sort_unstable();
        distances.dedup();
        let loops = pictures.div_ceil(LOOP_PERIOD) * LOOP_PICTURES.min(pictures.saturating_sub(1));
        Self {
            pictures,
            distances: if is_sequential { distances } else { Vec::new() },
            loops: if is_sequential && has_loops { loops as u64 } else { 0 },
        }
    }

    /// The number of all pairs.
    pub(super) fn total(&self) -> u64 {
        self.of_first(self.pictures) + self.loops
    }

    /// The pairs of each of the first `count` pictures with later ones.
    fn of_first(&self, count: usize) -> u64 {
        if self.distances.is_empty() {
            return (count * (2 * self.pictures).saturating_sub(count + 1) / 2) as u64;
        }
        // Pictures that have one so far behind them.
        let with = |distance: &usize| self.pictures.saturating_sub(*distance).min(count) as u64;
        self.distances.iter().map(with).sum()
    }

    /// The pairs that are tried after `done` of `of` of COLMAP's steps: pictures, or blocks of them.
    pub(super) fn done(&self, [done, of]: [u64; 2]) -> u64 {
        if self.distances.is_empty() {
            return done * self.total() / of.max(1);
        }
        if of == self.pictures as u64 {
            return self.of_first(done.min(of) as usize);
        }
        self.total() - self.loops + self.loops * done.min(of) / of.max(1)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// The pairs one by one.
    fn counted(pictures: usize, next_nine: bool) -> u64 {
        let mut pairs = BTreeSet::new();
        for n in 0..pictures {
            let powers = (0..10).map(|k| n + (1 << k));
            let next = (1..10).filter(|_| next_nine).map(|k| n + k);
            pairs.extend(powers.chain(next).filter(|&other| other < pictures).map(|other| (n, other)));
        }
        pairs.len() as u64
    }

    #[test]
    fn the_pairs_are_those_that_colmap_tries() {
        for pictures in [101, 292, 2000] {
            for next_nine in [false, true] {
                let tried = PairsTried::new(Matching::Auto, pictures, next_nine, false);
                assert_eq!(tried.total(), counted(pictures, next_nine), "{pictures} {next_nine}");
                assert_eq!(tried.done([pictures as u64, pictures as u64]), tried.total());
                assert_eq!(tried.done([0, pictures as u64]), 0);
            }
        }
        // Not the 42 486 pairs of all with all.
        assert_eq!(PairsTried::new(Matching::Auto, 292, false, false).total(), 2117);
        let exhaustive = PairsTried::new(Matching::Auto, 50, false, true);
        assert_eq!((exhaustive.total(), exhaustive.done([5, 25])), (1225, 245));
        let loops = PairsTried::new(Matching::Sequential, 292, false, true);
        assert_eq!((loops.total(), loops.done([292, 292]), loops.done([15, 30])), (2117 + 1500, 2117, 2117 + 750));
    }
}

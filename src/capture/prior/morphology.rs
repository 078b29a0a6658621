//! Dilation of cells by a ball, on runs of cells along x.
//!
//! A ball of radius r (in cells, between centers) is a run of cells along x for each offset (dy, dz). Dilation joins
//! the runs of neighboring rows, each extended by the ball's run, so its cost does not depend on the extent of a sparse
//! set.

use std::collections::BTreeMap;

use glam::{DVec3, IVec3};

/// Cells as runs along x: (z, y) to sorted runs (first, last) that do not touch.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct CellRuns(BTreeMap<(i32, i32), Vec<(i32, i32)>>);

/// (dy, dz, half length) of each row of a ball.
fn ball(radius: DVec3) -> Vec<(i32, i32, i32)> {
    let reach = radius.floor().as_ivec3();
    let along = |d: i32, r: f64| if d == 0 { 0.0 } else { (f64::from(d) / r).powi(2) };
    let mut rows = Vec::new();
    for dz in -reach.z..=reach.z {
        for dy in -reach.y..=reach.y {
            let rest = 1.0 - along(dy, radius.y) - along(dz, radius.z);
            if rest >= -1e-12 {
                rows.push((dy, dz, (radius.x * rest.max(0.0).sqrt() + 1e-9).floor() as i32));
            }
        }
    }
    rows
}

impl CellRuns {
    /// The runs of `cells`, which ascend by (z, y, x).
    pub(super) fn of_cells(cells: impl Iterator<Item = IVec3>) -> Self {
        let mut rows: BTreeMap<_, Vec<(i32, i32)>> = BTreeMap::new();
        for cell in cells {
            let row = rows.entry((cell.z, cell.y)).or_default();
            match row.last_mut() {
                Some((_, last)) if *last + 1 == cell.x => *last = cell.x,
                _ => row.push((cell.x, cell.x)),
            }
        }
        Self(rows)
    }

    /// The cells, ascending by (z, y, x).
    pub(super) fn cells(&self) -> impl Iterator<Item = IVec3> + Clone + '_ {
        self.0.iter().flat_map(|(&(z, y), runs)| {
            runs.iter().flat_map(move |&(first, last)| (first..=last).map(move |x| IVec3::new(x, y, z)))
        })
    }

    /// Number of cells.
    pub(super) fn len(&self) -> u64 {
        self.0.values().flatten().map(|&(first, last)| (i64::from(last) - i64::from(first) + 1) as u64).sum()
    }

    /// All cells whose center is within `radius` (in cells, per axis) of the center of a cell.
    pub(super) fn grown(&self, radius: DVec3) -> Self {
        let mut rows: BTreeMap<_, Vec<(i32, i32)>> = BTreeMap::new();
        for (dy, dz, half) in ball(radius) {
            for (&(z, y), runs) in &self.0 {
                let row = rows.entry((z.saturating_add(dz), y.saturating_add(dy))).or_default();
                row.extend(runs.iter().map(|&(first, last)| (first.saturating_sub(half), last.saturating_add(half))));
            }
        }
        rows.values_mut().for_each(join);
        Self(rows)
    }
}

/// Sorts runs and joins those that touch.
fn join(runs: &mut Vec<(i32, i32)>) {
    runs.sort_unstable();
    let mut joined: Vec<(i32, i32)> = Vec::new();
    for &(first, last) in runs.iter() {
        match joined.last_mut() {
            Some((_, end)) if first <= end.saturating_add(1) => *end = last.max(*end),
            _ => joined.push((first, last)),
        }
    }
    *runs = joined;
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use strivec_format::random::Random;

    type Cells = BTreeSet<[i32; 3]>;

    fn runs(cells: &Cells) -> CellRuns {
        CellRuns::of_cells(cells.iter().map(|&[z, y, x]| IVec3::new(x, y, z)))
    }

    fn cells(runs: &CellRuns) -> Cells {
        runs.cells().map(|c| [c.z, c.y, c.x]).collect()
    }

    /// The offsets of a ball of `radius` cells, by the definition, cell by cell.
    fn offsets(radius: f64) -> Vec<[i32; 3]> {
        let reach = radius.floor() as i32;
        let all =
            (-reach..=reach).flat_map(|z| (-reach..=reach).flat_map(move |y| (-reach..=reach).map(move |x| [z, y, x])));
        all.filter(|o| f64::from(o.iter().map(|d| d * d).sum::<i32>()) <= radius * radius + 1e-9).collect()
    }

    fn plus(a: &[i32; 3], b: &[i32; 3]) -> [i32; 3] {
        [0, 1, 2].map(|i| a[i] + b[i])
    }

    #[test]
    fn growing_follows_its_definition() {
        let random = Random::new(3, "morphology");
        for (case, radius) in [1.0, 1.5, 2.0, 3.2].into_iter().enumerate() {
            let draw = |i: u64| (random.substream(case as u64).uniform(i) * 12.0) as i32;
            let some: Cells = (0..300).map(|i| [draw(3 * i), draw(3 * i + 1), draw(3 * i + 2)]).collect();
            let offsets = offsets(radius);
            let grown: Cells = some.iter().flat_map(|c| offsets.iter().map(move |o| plus(c, o))).collect();
            let found = runs(&some).grown(DVec3::splat(radius));
            assert_eq!(cells(&found), grown, "radius {radius}");
            assert_eq!(found.len(), grown.len() as u64);
        }
    }
}

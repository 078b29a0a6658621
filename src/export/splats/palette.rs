//! Rows of numbers that stand for many.

use std::collections::BinaryHeap;

/// Entries of a palette, whose labels have 16 bits.
const MAX_ENTRIES: usize = 1 << 16;
/// Rounds of k-means when a cell is split.
const ROUNDS: usize = 2;

/// A palette of rows by bisecting k-means (Steinbach et al., "A Comparison of Document Clustering Techniques", 2000): the cell
/// of the largest squared error is split, as long as entries are left.
pub(super) struct Palette {
    /// \[entry\]\[width\]
    pub(super) entries: Vec<Vec<f32>>,
    /// \[row\] the row's entry.
    pub(super) labels: Vec<u16>,
}

/// Rows that share an entry.
struct Cell {
    rows: Vec<u32>,
    mean: Vec<f64>,
    /// The column of the largest variance.
    widest: usize,
    /// Sum of squared distances from the mean.
    error: f64,
}

impl Palette {
    /// The palette of `rows`, \[row\]\[width\]: of as many entries as the largest power of two that is no more than the
    /// rows.
    pub(super) fn of(rows: &[f32], width: usize) -> Self {
        let row = |n: u32| &rows[n as usize * width..][..width];
        let count = rows.len() / width;
        let most = if count == 0 { 0 } else { MAX_ENTRIES.min(1 << count.ilog2()) };
        let mut cells = vec![Cell::of((0..count as u32).collect(), &row, width)];
        // By error, as the bits of a positive number are ordered like it; then the first cell.
        let key = |cells: &[Cell], n: usize| (cells[n].error.to_bits(), std::cmp::Reverse(n));
        let mut waiting = BinaryHeap::from([key(&cells, 0)]);
        while cells.len() < most {
            let Some((error, std::cmp::Reverse(n))) = waiting.pop() else { break };
            if error == 0 {
                break;
            }
            let Some(halves) = cells[n].halves(&row) else { continue };
            let [first, second] = halves.map(|rows| Cell::of(rows, &row, width));
            cells[n] = first;
            cells.push(second);
            waiting.push(key(&cells, n));
            waiting.push(key(&cells, cells.len() - 1));
        }
        let mut labels = vec![0; count];
        for (label, cell) in cells.iter().enumerate() {
            cell.rows.iter().for_each(|&n| labels[n as usize] = label as u16);
        }
        let entries = cells.into_iter().map(|cell| cell.mean.into_iter().map(|value| value as f32).collect());
        Self { entries: entries.collect(), labels }
    }
}

impl Cell {
    fn of<'a>(rows: Vec<u32>, row: &impl Fn(u32) -> &'a [f32], width: usize) -> Self {
        let mean = mean(&rows, row, width);
        let mut variances = vec![0.0; width];
        for &n in &rows {
            for ((variance, &value), mean) in variances.iter_mut().zip(row(n)).zip(&mean) {
                *variance += (f64::from(value) - mean).powi(2);
            }
        }
        let widest = (1..width).fold(0, |best, k| if variances[k] > variances[best] { k } else { best });
        Self { rows, mean, widest, error: variances.iter().sum() }
    }

    /// Two parts of the cell by k-means, from its mean on the widest column on; `None` if all rows are on one side.
    fn halves<'a>(&self, row: &impl Fn(u32) -> &'a [f32]) -> Option<[Vec<u32>; 2]> {
        let threshold = self.mean[self.widest];
        let split = |is_first: &dyn Fn(&[f32]) -> bool| {
            let (first, second): (Vec<u32>, Vec<u32>) = self.rows.iter().copied().partition(|&n| is_first(row(n)));
            (!first.is_empty() && !second.is_empty()).then_some([first, second])
        };
        let mut halves = split(&|values| f64::from(values[self.widest]) < threshold)?;
        for _ in 0..ROUNDS {
            let [a, b] = halves.each_ref().map(|rows| mean(rows, row, self.mean.len()));
            // |v − a|² < |v − b|² is v·(b − a) < (|b|² − |a|²) / 2.
            let across: Vec<f64> = a.iter().zip(&b).map(|(a, b)| b - a).collect();
            let limit = 0.5 * a.iter().zip(&b).map(|(a, b)| b * b - a * a).sum::<f64>();
            let product = |values: &[f32]| values.iter().zip(&across).map(|(&v, d)| f64::from(v) * d).sum::<f64>();
            let Some(better) = split(&|values| product(values) < limit) else { break };
            halves = better;
        }
        Some(halves)
    }
}

fn mean<'a>(rows: &[u32], row: &impl Fn(u32) -> &'a [f32], width: usize) -> Vec<f64> {
    let mut sums = vec![0.0; width];
    for &n in rows {
        sums.iter_mut().zip(row(n)).for_each(|(sum, &value)| *sum += f64::from(value));
    }
    sums.iter_mut().for_each(|sum| *sum /= rows.len().max(1) as f64);
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::random::Random;

    #[test]
    fn rows_of_few_kinds_are_kept_exactly() {
        let kinds = [[1.0, 0.0], [-2.0, 3.0], [5.0, 5.0_f32]];
        let rows: Vec<f32> = (0..50).flat_map(|n| kinds[n * n % 3]).collect();
        let palette = Palette::of(&rows, 2);
        assert_eq!(palette.entries.len(), 2, "the squares of whole numbers are of two kinds modulo 3");
        for (n, label) in palette.labels.iter().enumerate() {
            assert_eq!(palette.entries[usize::from(*label)], rows[2 * n..][..2]);
        }
        assert!(Palette::of(&[], 9).labels.is_empty());
        assert_eq!(Palette::of(&[0.5; 9], 9).entries, [[0.5; 9]]);
    }

    #[test]
    fn a_palette_leaves_little_of_the_variance() {
        let random = Random::new(7, "palette");
        let rows: Vec<f32> = (0..3 * 4096).map(|n| random.normal(n) as f32).collect();
        let palette = Palette::of(&rows[..3 * 4000], 3);
        assert_eq!((palette.entries.len(), palette.labels.len()), (2048, 4000));
        let off = |n: usize| {
            let entry = &palette.entries[usize::from(palette.labels[n])];
            entry.iter().zip(&rows[3 * n..]).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
        };
        let error = (0..4000).map(off).sum::<f64>() / 12_000.0;
        assert!(error < 0.01, "{error}");
    }
}

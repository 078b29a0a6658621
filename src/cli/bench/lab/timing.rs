//! Repeated timings and their statistics.

use std::time::Instant;

use serde::Serialize;

/// Statistics of repeated measurements.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The median, which reports give as the result.
    pub median: f64,
    /// The mean.
    pub mean: f64,
    /// First and third quartile.
    pub quartiles: [f64; 2],
    /// Smallest and largest.
    pub range: [f64; 2],
    /// Number of measurements.
    pub count: usize,
}

impl Spread {
    /// Statistics of `values`; `None` if there are none.
    pub fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        // Linear between the two values around the quantile.
        let quantile = |q: f64| {
            let at = q * last as f64;
            let lower = at.floor() as usize;
            sorted[lower] + (at - lower as f64) * (sorted[(lower + 1).min(last)] - sorted[lower])
        };
        Some(Self {
            median: quantile(0.5),
            mean: sorted.iter().sum::<f64>() / sorted.len() as f64,
            quartiles: [quantile(0.25), quantile(0.75)],
            range: [sorted[0], sorted[last]],
            count: sorted.len(),
        })
    }
}

/// Numbers of runs: some to warm caches and allocations, then the measured ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Runs {
    /// Runs before the measured ones.
    pub warm_up: usize,
    /// Measured runs; at least one is made.
    pub measured: usize,
}

impl Runs {
    /// Seconds of each measured run of `work`, and what the runs returned.
    ///
    /// # Errors
    ///
    /// The first error of `work`.
    pub fn time<R, E>(self, mut work: impl FnMut() -> Result<R, E>) -> Result<(Spread, Vec<R>), E> {
        for _ in 0..self.warm_up {
            work()?;
        }
        let (mut seconds, mut results) = (Vec::new(), Vec::new());
        for _ in 0..self.measured.max(1) {
            let start = Instant::now();
            let result = work()?;
            seconds.push(start.elapsed().as_secs_f64());
            results.push(result);
        }
        Ok((Spread::of(&seconds).expect("at least one run"), results))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_few_values() {
        let spread = Spread::of(&[4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!((spread.median, spread.quartiles, spread.range), (2.5, [1.75, 3.25], [1.0, 4.0]));
        assert_eq!(spread.mean, 2.5);
        assert_eq!(Spread::of(&[7.0]).unwrap().quartiles, [7.0, 7.0]);
        assert_eq!(Spread::of(&[]), None);
    }

    #[test]
    fn warm_up_runs_are_made_and_not_counted() {
        let mut calls = 0;
        let (spread, results) = Runs { warm_up: 2, measured: 3 }
            .time(|| {
                calls += 1;
                Ok::<_, ()>(calls)
            })
            .unwrap();
        assert_eq!((spread.count, results), (3, vec![3, 4, 5]));
        assert_eq!(Runs { warm_up: 0, measured: 1 }.time(|| Err::<(), _>("no")).unwrap_err(), "no");
    }
}

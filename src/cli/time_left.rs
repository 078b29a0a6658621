//! An estimate of the time that a task still takes.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// The speed of a task is that of its last minute: trainings change theirs as they go.
const WINDOW: Duration = Duration::from_secs(60);
/// The least time between two points of the record.
const PITCH: Duration = Duration::from_secs(1);
/// The pieces of the record from which a speed is known: one of three may have a pause in it.
const ENOUGH: usize = 3;

/// The steps of a task that were done at points of its last minute.
#[derive(Debug, Default)]
pub(super) struct TimeLeft {
    record: VecDeque<(Instant, u64)>,
}

impl TimeLeft {
    /// Forgets the speed until now, after other work.
    pub(super) fn reset(&mut self) {
        self.record.clear();
    }

    /// Takes note that `done` steps are done at `now`.
    pub(super) fn note(&mut self, now: Instant, done: u64) {
        let since = |at: Instant| now.saturating_duration_since(at);
        while self.record.len() > ENOUGH && self.record.get(1).is_some_and(|&(at, _)| since(at) >= WINDOW) {
            self.record.pop_front();
        }
        if self.record.back().is_none_or(|&(at, before)| since(at) >= PITCH && done > before) {
            self.record.push_back((now, done));
        }
    }

    /// The time that `steps` more take at the median speed of the last minute, so that a pause does not count; `None` while
    /// little is known.
    pub(super) fn of(&self, steps: u64) -> Option<Duration> {
        let pieces = self.record.iter().zip(self.record.iter().skip(1));
        let seconds_of_a_step = |(&(from, before), &(to, after)): (&(Instant, u64), &(Instant, u64))| {
            to.duration_since(from).as_secs_f64() / (after - before).max(1) as f64
        };
        let mut seconds: Vec<f64> = pieces.map(seconds_of_a_step).collect();
        seconds.sort_by(f64::total_cmp);
        let middle = seconds.get(seconds.len() / 2).filter(|_| seconds.len() >= ENOUGH)?;
        Duration::try_from_secs_f64(middle * steps as f64).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(left: &mut TimeLeft, now: Instant, done: u64, total: u64) -> Option<Duration> {
        left.note(now, done);
        left.of(total - done)
    }

    #[test]
    fn the_last_minute_decides() {
        let (start, mut left) = (Instant::now(), TimeLeft::default());
        let second = |n: u64| start + Duration::from_secs(n);
        assert_eq!(after(&mut left, start, 500, 3000), None);
        // Ten steps a second, then two.
        assert_eq!([1, 2].map(|n| after(&mut left, second(n), 500 + 10 * n, 3000)), [None; 2]);
        for n in 3..=100 {
            let found = after(&mut left, second(n), 500 + 10 * n, 3000).unwrap();
            assert_eq!(found.as_secs_f64().round(), ((2500 - 10 * n) as f64 / 10.0).round());
        }
        for n in 101..=200 {
            after(&mut left, second(n), 1500 + 2 * (n - 100), 3000);
        }
        assert_eq!(after(&mut left, second(201), 1702, 3000).unwrap().as_secs(), 649);
        // A pause does not count.
        assert_eq!(after(&mut left, second(231), 1703, 3000).unwrap().as_secs(), 648);
        left.reset();
        for (n, done) in [(262, 1702), (264, 1722), (294, 1723)] {
            assert_eq!(after(&mut left, second(n), done, 3000), None);
        }
        assert_eq!(after(&mut left, second(295), 1733, 3000).unwrap().as_secs_f64().round(), 127.0);
    }
}

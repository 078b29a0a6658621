//! An estimate of the time that a task still takes.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// The speed of a task is that of its last minute: trainings change theirs as they go.
const WINDOW: Duration = Duration::from_secs(60);
/// The least time between two points of the record.
const PITCH: Duration = Duration::from_secs(1);

/// The most of what is done that an estimate is a multiple of, so that it is a time.
const MOST: f64 = 1e6;

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

    /// Takes note that `done` steps are done at `now`. Returns the time that the rest of `total` takes at the speed of the last
    /// minute; `None` in the first second, or if nothing was done.
    pub(super) fn after(&mut self, now: Instant, done: u64, total: u64) -> Option<Duration> {
        let since = |at: Instant| now.saturating_duration_since(at);
        while self.record.len() > 1 && self.record.get(1).is_some_and(|&(at, _)| since(at) >= WINDOW) {
            self.record.pop_front();
        }
        if self.record.back().is_none_or(|&(at, _)| since(at) >= PITCH) {
            self.record.push_back((now, done));
        }
        let &(from, before) = self.record.front()?;
        let (time, steps) = (since(from), done.saturating_sub(before));
        (time >= PITCH && steps > 0).then(|| time.mul_f64((total.saturating_sub(done) as f64 / steps as f64).min(MOST)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_minute_decides() {
        let (start, mut left) = (Instant::now(), TimeLeft::default());
        let second = |n: u64| start + Duration::from_secs(n);
        assert_eq!(left.after(start, 500, 3000), None);
        // Ten steps a second, then two.
        for n in 1..=100 {
            let found = left.after(second(n), 500 + 10 * n, 3000).unwrap();
            assert_eq!(found.as_secs_f64().round(), ((2500 - 10 * n) as f64 / 10.0).round());
        }
        for n in 101..=200 {
            left.after(second(n), 1500 + 2 * (n - 100), 3000);
        }
        assert_eq!(left.after(second(201), 1702, 3000).unwrap().as_secs(), 649);
        // A pause of a minute does not make hours of minutes.
        assert!(left.after(second(261), 1702, 3000).is_none_or(|left| left.as_secs() < 100_000));
        left.reset();
        assert_eq!(left.after(second(262), 1702, 3000), None);
        assert_eq!(left.after(second(264), 1722, 3000).unwrap().as_secs(), 127);
    }
}

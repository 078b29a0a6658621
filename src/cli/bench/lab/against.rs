//! Comparison of two builds that do the same work in turns, so that other load on the machine affects both alike.

use serde::Serialize;

use super::Spread;

/// Measurements of this build and another, taken in turns.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BuildComparison {
    /// This build's times.
    pub this: Spread,
    /// The other build's times.
    pub other: Spread,
    /// This build's median divided by the other's; above 1 this build is slower.
    pub ratio: f64,
    /// The ratios within the rounds; their spread is the noise of the machine.
    pub rounds: Spread,
}

impl BuildComparison {
    /// Compares positive measurements; round i is `this[i]` and `other[i]`. `None` for no rounds, or lists of different
    /// lengths.
    pub fn of(this: &[f64], other: &[f64]) -> Option<Self> {
        if this.len() != other.len() {
            return None;
        }
        let rounds: Vec<f64> = this.iter().zip(other).map(|(a, b)| a / b).collect();
        let (this, other) = (Spread::of(this)?, Spread::of(other)?);
        Some(Self { ratio: this.median / other.median, rounds: Spread::of(&rounds)?, this, other })
    }

    /// This build takes more than `limit` times as long as the other, or the ratio is NaN.
    pub fn is_above(&self, limit: f64) -> bool {
        self.ratio.is_nan() || self.ratio > limit
    }
}

/// Runs `this` and `other` in turns, `rounds` times each, and lists the measurements of each. Every other round begins
/// with `other`, so that neither always comes second.
///
/// # Errors
///
/// The first error of either.
pub fn by_turns<V, E>(
    rounds: usize,
    mut this: impl FnMut() -> Result<V, E>,
    mut other: impl FnMut() -> Result<V, E>,
) -> Result<[Vec<V>; 2], E> {
    let mut values = [Vec::new(), Vec::new()];
    for round in 0..rounds {
        if round % 2 == 0 {
            values[0].push(this()?);
            values[1].push(other()?);
        } else {
            values[1].push(other()?);
            values[0].push(this()?);
        }
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Durations on a machine that is slow at times, which affects both builds alike.
    fn planted(rounds: usize, factor: f64) -> [Vec<f64>; 2] {
        let machine = |i: usize| 1.0 + 0.3 * (i as f64 * 2.4).sin();
        let noise = |i: usize| 1.0 + 0.01 * (i as f64 * 1.7).cos();
        let turn = std::cell::Cell::new(0);
        let next = |factor: f64| {
            let i = turn.replace(turn.get() + 1);
            Ok::<_, ()>(factor * machine(i / 2) * noise(i))
        };
        by_turns(rounds, || next(factor), || next(1.0)).unwrap()
    }

    #[test]
    fn a_planted_slowdown_is_found_and_fails_the_check() {
        let [this, other] = planted(9, 1.2);
        let slower = BuildComparison::of(&this, &other).unwrap();
        assert!((slower.ratio - 1.2).abs() < 0.04, "{slower:?}");
        assert!(slower.is_above(1.05) && !slower.is_above(1.3));
        assert!(slower.rounds.range[0] > 1.15 && slower.rounds.range[1] < 1.25, "{slower:?}");

        let [this, other] = planted(9, 1.0);
        let equal = BuildComparison::of(&this, &other).unwrap();
        assert!(!equal.is_above(1.05), "{equal:?}");
        assert!(BuildComparison::of(&other, &other).unwrap().ratio == 1.0);
    }

    #[test]
    fn turns_alternate_and_an_error_ends_them() {
        let order = std::cell::RefCell::new(String::new());
        let turn = |name: char| {
            order.borrow_mut().push(name);
            if order.borrow().len() < 6 { Ok(0.0) } else { Err("broken") }
        };
        assert_eq!(by_turns(9, || turn('A'), || turn('B')), Err("broken"));
        assert_eq!(*order.borrow(), "ABBAAB");
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        assert_eq!(BuildComparison::of(&[], &[]), None);
        assert_eq!(BuildComparison::of(&[1.0], &[1.0, 2.0]), None);
        assert!(BuildComparison::of(&[0.0], &[0.0]).unwrap().is_above(1.05));
    }
}

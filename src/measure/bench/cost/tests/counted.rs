//! A number that counts the operations on it.

use std::cell::Cell;
use std::ops::{Add, AddAssign, Div, Mul, Sub};

use super::{SINE_COSINE, TRANSCENDENTAL};

thread_local! {
    static FLOP: Cell<f64> = const { Cell::new(0.0) };
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Counted(pub(super) f64);

/// The operations in `work`.
pub(super) fn count(work: impl FnOnce()) -> f64 {
    FLOP.set(0.0);
    work();
    FLOP.get()
}

fn add(flop: f64) {
    FLOP.set(FLOP.get() + flop);
}

impl Counted {
    pub(super) fn max(self, other: Self) -> Self {
        add(1.0);
        Self(self.0.max(other.0))
    }

    pub(super) fn sqrt(self) -> Self {
        add(1.0);
        Self(self.0.sqrt())
    }

    pub(super) fn exp(self) -> Self {
        add(TRANSCENDENTAL);
        Self(self.0.exp())
    }

    pub(super) fn sine_cosine(self) -> (Self, Self) {
        add(SINE_COSINE);
        (Self(self.0.sin()), Self(self.0.cos()))
    }
}

impl Add for Counted {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        add(1.0);
        Self(self.0 + other.0)
    }
}

impl AddAssign for Counted {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Counted {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        add(1.0);
        Self(self.0 - other.0)
    }
}

impl Mul for Counted {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        add(1.0);
        Self(self.0 * other.0)
    }
}

impl Div for Counted {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        add(1.0);
        Self(self.0 / other.0)
    }
}

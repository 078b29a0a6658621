//! The extremes that `docs/numerics.md` states bounds for: every renderer against the f64 reference where numbers are at
//! their limits. Needs a graphics adapter where feature `gpu` is on; none is a failure, never a silent skip.
#![cfg(feature = "toolkit")]

#[path = "../scenes/mod.rs"]
mod scenes;

mod compare;
mod distributions;
mod field;
mod made;
mod properties;
mod shapes;
mod training;
mod values;

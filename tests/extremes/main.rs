//! The extremes that `docs/numerics.md` states bounds for: every renderer against the f64 reference, with numbers at
//! their limits. With feature `gpu` a graphics adapter is needed; the tests fail without one, they never skip silently.

#[path = "../scenes/mod.rs"]
mod scenes;

mod compare;
mod distributions;
mod field;
mod made;
mod properties;
mod shapes;
mod training;
mod unbounded;
mod values;

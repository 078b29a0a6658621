//! Tests of field: one program, so that the crates are linked once.

mod approximations;
mod gpu;
mod parity;
mod per_ray;
#[path = "../scenes/mod.rs"]
mod scenes;
mod sky;
mod toward;
mod vectors;

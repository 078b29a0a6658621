//! Tests of export: one program, so that the crates are linked once.

mod checkpoints;
#[path = "../data/mod.rs"]
mod data;
mod formats;
mod geographic;
#[path = "../scenes/mod.rs"]
mod scenes;
mod splats;

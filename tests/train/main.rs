//! Tests of train: one program, so that the crates are linked once.

#[path = "../data/mod.rs"]
mod data;
mod gradients;
mod http_ranges;
mod photographs;
mod prior;
mod pruning;
#[path = "../scenes/mod.rs"]
mod scenes;
mod shrinking;
mod training;

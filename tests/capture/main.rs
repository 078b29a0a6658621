//! Tests of capture: one program, so that the crates are linked once.

#[path = "../data/mod.rs"]
mod data;
mod dataset;
mod scannet;
mod synthetic;

//! Tests of capture: one program, so that the crates are linked once.

#[path = "../data/mod.rs"]
mod data;
mod dataset;
mod foreign;
mod foreign_names;
mod foreign_records;
mod scannet;
mod synthetic;

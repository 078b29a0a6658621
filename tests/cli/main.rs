//! Tests of the commands, as processes: one program, so that the crates are linked once.

mod atomic_write;
mod authors;
mod captures;
#[path = "../command/mod.rs"]
mod command;
mod commands;
mod conformance;
mod editing;
mod evaluation;
mod examples;
mod for_size;
mod layouts;
mod memory;
mod pack;
mod poses;
mod prior_files;
mod render_paths;
#[path = "../scenes/mod.rs"]
mod scenes;
mod trade;
mod unbounded;
mod untrusted_texts;
mod whole_way;

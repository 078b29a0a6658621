//! `strivec-player`: scenes in a window.
#![forbid(unsafe_code)]

mod app;
mod arguments;
mod chooser;
mod dataset_folder;
mod interpolation;
mod memory;
mod message;
mod opening;
mod output;
mod overlay;
mod painter;
mod panel;
mod recent;
mod software;
mod surface;
mod window;

pub use window::main;

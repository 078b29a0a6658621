//! `strivec-player`: scenes in a window.

mod app;
mod arguments;
mod memory;
mod opening;
mod panel;
mod recent;
mod scene_slot;
mod software;
mod surface;
mod window;

pub use window::main;

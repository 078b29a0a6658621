//! Rendering on a graphics device, through the shaders in `shaders/`.
//!
//! In: a scene and an open device. Out: pictures that agree with the reference's, with positions within
//! [`POSITION_ERROR`]. A batch of rays passes through a sequence of compute stages (`shader::ShaderStage`). The host sets the
//! number of rays, and checks afterwards whether the batch's samples fit the buffers. Waiting is asynchronous;
//! `blocking` (native only) waits on the calling thread.

#[cfg(not(target_arch = "wasm32"))]
mod blocking;
mod device;
mod drawing;
mod error;
mod job;
mod layout;
mod packed;
mod renderer;
mod shader;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod testing;
mod workspace;

pub use device::Gpu;
pub use error::GpuError;
pub use job::Drawing;
pub use renderer::GpuRenderer;
pub use shader::Precision;
pub use workspace::StageTime;

/// The largest distance between a sample's position and the reference's, relative to the distance of the ray's origin:
/// rays are computed in 32 bits.
pub const POSITION_ERROR: f64 = 1e-6;

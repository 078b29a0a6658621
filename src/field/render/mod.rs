//! Renderers, behind one small trait; camera paths as JSON; and the Pareto front of render settings.

mod approximation;
mod cpu;
mod error;
#[cfg(feature = "gpu")]
pub mod gpu;
mod keyframes;
mod memory;
mod orbit;
mod pareto;
mod reference;
mod turntable;
mod upsample;

pub use approximation::Approximation;
pub use cpu::{CpuRenderer, TraceInfo};
pub use error::RendererError;
pub use keyframes::{KeyframesError, MAX_KEYFRAMES, MAX_KEYFRAMES_BYTES, read_keyframes, write_keyframes};
pub use memory::check_picture;
pub use orbit::Orbit;
pub use pareto::{ParetoFront, ParetoPoint, QualitySelector, RenderSettings, TRADE_NOTE};
pub use reference::{ReferenceRenderer, Trace};
pub use turntable::{Gaze, Turntable};
pub use upsample::upsample_bilinear;

use strivec_format::geometry::{Camera, Ray};

/// The result of one ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// The color, sRGB, composited on the scene's background or sky.
    pub color: [f32; 3],
    /// 1 − the transmittance at the end of the ray; 1 in a scene with a sky, as it belongs to the picture.
    pub opacity: f32,
    /// The expected depth Σ w·t / Σ w over the ray's samples, in model units along the ray; 0 if no sample counted.
    pub depth: f32,
}

/// A rendered picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Number of columns.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// \[height\]\[width\], row-major from the top left.
    pub pixels: Vec<Pixel>,
}

/// A renderer of one scene. Cameras and rays are in model space.
pub trait Renderer {
    /// The pixels of `rays`, in their order.
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel>;

    /// The scene's background color in sRGB, which pixels without a ray have, with a sky or without.
    fn background(&self) -> [f32; 3];

    /// Renders the picture of `camera`.
    fn render(&self, camera: &Camera) -> Picture {
        let (width, height) = (camera.width, camera.height);
        let rays: Vec<Option<Ray>> = camera.rays(0..height).collect();
        let seen: Vec<Ray> = rays.iter().copied().flatten().collect();
        let mut traced = self.trace(&seen).into_iter();
        let unseen = Pixel { color: self.background(), ..Pixel::default() };
        let pixel = |ray: Option<Ray>| ray.and_then(|_| traced.next()).unwrap_or(unseen);
        Picture { width, height, pixels: rays.into_iter().map(pixel).collect() }
    }
}

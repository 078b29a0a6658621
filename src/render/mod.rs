//! Pictures of a scene, behind one small trait, and the paths of cameras that take many.

mod approximation;
mod components;
mod cpu;
#[cfg(feature = "gpu")]
pub mod gpu;
mod keyframes;
mod pareto;
mod reference;

pub use approximation::{Approximation, ApproximationError};
pub use cpu::{CpuRenderer, TraceInfo};
pub use keyframes::{KeyframesError, MAX_KEYFRAMES, MAX_KEYFRAMES_BYTES, read_keyframes, write_keyframes};
pub use pareto::{
    ParetoError, ParetoFront, ParetoPoint, QualitySelector, RenderSettings, TRADE_NOTE, upsample_bilinear,
};
pub use reference::{ReferenceRenderer, Trace};

use crate::geometry::{Camera, Ray};

/// What a ray sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// sRGB, composited on the scene's background.
    pub color: [f32; 3],
    /// 1 − the transmittance that is left at the end of the ray.
    pub opacity: f32,
    /// Expected distance along the ray in model units, Σ w·t / Σ w over the ray's samples; 0 where there are none.
    pub depth: f32,
}

/// A rendered picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// \[height\]\[width\], row-major from the top left.
    pub pixels: Vec<Pixel>,
}

/// A way to turn a scene into pictures. Cameras and rays are in the model's space.
pub trait Renderer {
    /// What each of `rays` sees, in their order.
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel>;

    /// The picture that `camera` takes.
    fn render(&self, camera: &Camera) -> Picture {
        let (width, height) = (camera.width, camera.height);
        let rays: Vec<Ray> =
            (0..height).flat_map(|row| (0..width).map(move |column| camera.ray(column, row))).collect();
        Picture { width, height, pixels: self.trace(&rays) }
    }
}

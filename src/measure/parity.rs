//! How closely a renderer follows the reference. Rays that are near a decision, at which the field is discontinuous
//! (spec 4.10), are counted apart from the others.

use rayon::prelude::*;
use serde::Serialize;

use strivec_field::render::{Pixel, ReferenceRenderer, Renderer};
use strivec_format::geometry::{Camera, Ray};
use strivec_format::model::Scene;

/// The position error of f32 arithmetic near the model's origin, in model units (spec 4.10).
pub const F32_POSITION_ERROR: f64 = 1e-6;

/// Differences of color to the reference, the largest of the three channels of each ray.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Parity {
    /// Rays whose decision margin exceeds the position error.
    pub clear_rays: u64,
    /// The other rays.
    pub near_rays: u64,
    /// The largest difference of the clear rays.
    pub clear_maximum: f64,
    /// Half of the others differ by no more than this.
    pub near_median: f64,
    /// 99.9 % of the others differ by no more than this.
    pub near_999: f64,
    /// The largest difference of the others.
    pub near_maximum: f64,
}

impl Parity {
    /// The share of rays that are near a decision.
    pub fn near_share(&self) -> f64 {
        self.near_rays as f64 / (self.clear_rays + self.near_rays).max(1) as f64
    }
}

/// Compares `renderer`'s pictures from `cameras`, in the model's space, with the reference's pictures of `scene`.
pub fn parity(scene: &Scene, renderer: &impl Renderer, cameras: &[Camera], position_error: f64) -> Parity {
    let reference = ReferenceRenderer::new(scene);
    let (mut clear, mut near) = (Vec::new(), Vec::new());
    for camera in cameras {
        let rays: Vec<Ray> = camera.rays(0..camera.height).flatten().collect();
        let expected: Vec<_> = rays.par_iter().map(|ray| reference.trace_one(ray)).collect();
        for (expected, found) in expected.iter().zip(renderer.trace(&rays)) {
            let differences = if expected.margin > position_error { &mut clear } else { &mut near };
            differences.push(difference(&expected.color, &found));
        }
    }
    clear.sort_by(f64::total_cmp);
    near.sort_by(f64::total_cmp);
    let quantile = |sorted: &[f64], q: f64| {
        let at = (q * sorted.len() as f64).ceil() as usize;
        sorted.get(at.saturating_sub(1)).copied().unwrap_or(0.0)
    };
    Parity {
        clear_rays: clear.len() as u64,
        near_rays: near.len() as u64,
        clear_maximum: quantile(&clear, 1.0),
        near_median: quantile(&near, 0.5),
        near_999: quantile(&near, 0.999),
        near_maximum: quantile(&near, 1.0),
    }
}

fn difference(expected: &[f64; 3], found: &Pixel) -> f64 {
    (0..3).map(|i| (expected[i] - f64::from(found.color[i])).abs()).fold(0.0, f64::max)
}

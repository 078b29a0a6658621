//! Colors of points near a surface, by short rays into it.

use glam::DVec3;
use rayon::prelude::*;

use strivec_field::Field;
use strivec_field::render::{CpuRenderer, Pixel, Renderer};
use strivec_format::geometry::Ray;

/// Rays that are traced at once.
const RAYS: usize = 1 << 16;
/// How far in front of a surface the ray begins that finds its color, in march steps.
const STEPS_IN_FRONT: f64 = 2.0;
/// Opacities below this are taken as it: a color of hardly any opacity is that of rounding errors.
const MIN_OPACITY: f32 = 1e-6;

/// Computes the colors of points: those that a ray from the point composites, with the opacity divided out. All modes of
/// the decoder have such a color, and it is the one that pictures show.
pub(super) struct Shader {
    renderer: CpuRenderer<f32>,
    step: f64,
    is_contracted: bool,
}

impl Shader {
    /// A shader of the scene of `field`, without its background.
    pub(super) fn new(mut field: Field<f32>) -> Self {
        field.near_far[0] = 0.0;
        field.background = [0.0; 3];
        field.sky = None;
        // Where a surface begins, all samples are faint.
        field.rules.min_weight = 0.0;
        let (step, is_contracted) = (field.rules.step, field.rules.contraction.is_some());
        Self { renderer: CpuRenderer::from_field(field), step, is_contracted }
    }

    /// A ray toward a surface at `point` with the unit normal `normal`, in model space.
    pub(super) fn ray_against(&self, normal: DVec3, point: DVec3) -> Ray {
        // Contracted space is about as much smaller than the scene.
        let stretch = if self.is_contracted { point.abs().max_element().max(1.0) } else { 1.0 };
        ray_against(normal, point, STEPS_IN_FRONT * self.step * stretch)
    }

    /// The sRGB colors at the ends of rays in model space, in \[0, 1\].
    pub(super) fn colors(&self, rays: impl Iterator<Item = Ray>) -> Vec<[f32; 3]> {
        let mut rays = rays.peekable();
        let mut colors = Vec::new();
        while rays.peek().is_some() {
            let some: Vec<Ray> = rays.by_ref().take(RAYS).collect();
            let traced = self.renderer.trace(&some);
            colors.par_extend(traced.par_iter().map(color_of));
        }
        colors
    }

    /// \[ray\]\[n\] [`Shader::colors`] as the decoder has them for the directions `toward(ray, n)`, n from 0 to below `count`.
    pub(super) fn colors_toward(
        &self,
        rays: &[Ray],
        count: usize,
        toward: &(dyn Fn(&Ray, usize) -> DVec3 + Sync),
    ) -> Vec<[f32; 3]> {
        self.renderer.trace_toward(rays, count, toward).par_iter().map(color_of).collect()
    }
}

/// The color of a pixel, with the opacity divided out.
fn color_of(pixel: &Pixel) -> [f32; 3] {
    pixel.color.map(|value| (value / pixel.opacity.max(MIN_OPACITY)).clamp(0.0, 1.0))
}

/// A ray toward a surface at `point` with the unit normal `normal`, from `distance` in front of it.
pub(super) fn ray_against(normal: DVec3, point: DVec3, distance: f64) -> Ray {
    Ray { origin: point + distance * normal, direction: -normal }
}

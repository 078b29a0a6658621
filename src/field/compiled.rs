//! The entries of the hot path, compiled in this crate once for each precision.
//!
//! A generic function is compiled anew in each crate that calls it: pictures and points were, in four crates, for three instruction
//! sets each. These entries are not generic, so other crates only link to them, whatever their own level of optimization.

use glam::DVec3;

use crate::render::{CpuRenderer, Picture, Pixel, TraceInfo};
use crate::{Field, Work};
use strivec_format::geometry::{Camera, Ray};

/// A precision for which the entries are compiled: f32, and with the feature `f64` also f64.
pub trait Compiled: Sized {
    /// [`CpuRenderer::render_with_work`].
    fn render(renderer: &CpuRenderer<Self>, camera: &Camera) -> (Picture, Work);
    /// [`Renderer::trace`](crate::render::Renderer::trace).
    fn trace(renderer: &CpuRenderer<Self>, rays: &[Ray]) -> Vec<Pixel>;
    /// [`CpuRenderer::trace_info`].
    fn trace_info(renderer: &CpuRenderer<Self>, rays: &[Ray], has_normals: bool) -> Vec<TraceInfo>;
    /// [`CpuRenderer::trace_toward`].
    fn trace_toward(
        renderer: &CpuRenderer<Self>,
        rays: &[Ray],
        count: usize,
        toward: &(dyn Fn(&Ray, usize) -> DVec3 + Sync),
    ) -> Vec<Pixel>;
    /// [`Field::densities`].
    fn densities(field: &Field<Self>, point: &(dyn Fn(usize) -> DVec3 + Sync), densities: &mut [Self]);
    /// [`Field::appearances`].
    fn appearances(field: &Field<Self>, point: &(dyn Fn(usize) -> DVec3 + Sync), appearances: &mut [Self]);
}

macro_rules! compile {
    ($Real:ty) => {
        impl Compiled for $Real {
            fn render(renderer: &CpuRenderer<Self>, camera: &Camera) -> (Picture, Work) {
                renderer.render_inlined(camera)
            }

            fn trace(renderer: &CpuRenderer<Self>, rays: &[Ray]) -> Vec<Pixel> {
                renderer.trace_inlined(rays)
            }

            fn trace_info(renderer: &CpuRenderer<Self>, rays: &[Ray], has_normals: bool) -> Vec<TraceInfo> {
                renderer.trace_info_inlined(rays, has_normals)
            }

            fn trace_toward(
                renderer: &CpuRenderer<Self>,
                rays: &[Ray],
                count: usize,
                toward: &(dyn Fn(&Ray, usize) -> DVec3 + Sync),
            ) -> Vec<Pixel> {
                renderer.trace_toward_inlined(rays, count, toward)
            }

            fn densities(field: &Field<Self>, point: &(dyn Fn(usize) -> DVec3 + Sync), densities: &mut [Self]) {
                field.densities_inlined(point, densities);
            }

            fn appearances(field: &Field<Self>, point: &(dyn Fn(usize) -> DVec3 + Sync), appearances: &mut [Self]) {
                field.appearances_inlined(point, appearances);
            }
        }
    };
}

compile!(f32);
#[cfg(any(test, feature = "f64"))]
compile!(f64);

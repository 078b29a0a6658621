//! The entries of the hot path, compiled in this crate once for each precision.
//!
//! A generic function is compiled anew in each crate that calls it: pictures and points were, in four crates, for three instruction
//! sets each. These entries are not generic, so other crates only link to them, whatever their own level of optimization.

use glam::DVec3;

use crate::render::{CpuRenderer, Picture, Pixel, TraceInfo};
use crate::vector::Sealed;
use crate::{Field, Work};
use strivec_format::geometry::{Camera, Ray};

/// A precision for which the entries are compiled: f32, and with the feature `f64` also f64.
///
/// Other crates cannot implement it, [`Vector`](crate::Vector) or [`Real`](crate::Real), which `unsafe` code trusts:
///
/// ```compile_fail
/// use glam::DVec3;
/// use strivec_field::render::{CpuRenderer, Picture, Pixel, TraceInfo};
/// use strivec_field::{Compiled, Field, Work};
/// use strivec_format::geometry::{Camera, Ray};
///
/// struct Number;
/// impl Compiled for Number {
///     fn render(_: &CpuRenderer<Self>, _: &Camera) -> (Picture, Work) { todo!() }
///     fn trace(_: &CpuRenderer<Self>, _: &[Ray]) -> Vec<Pixel> { todo!() }
///     fn trace_info(_: &CpuRenderer<Self>, _: &[Ray], _: bool) -> Vec<TraceInfo> { todo!() }
///     fn densities(_: &Field<Self>, _: &(dyn Fn(usize) -> DVec3 + Sync), _: &mut [Self]) {}
///     fn appearances(_: &Field<Self>, _: &(dyn Fn(usize) -> DVec3 + Sync), _: &mut [Self]) {}
/// }
/// ```
pub trait Compiled: Sealed + Sized {
    /// [`CpuRenderer::render_with_work`].
    fn render(renderer: &CpuRenderer<Self>, camera: &Camera) -> (Picture, Work);
    /// [`Renderer::trace`](crate::render::Renderer::trace).
    fn trace(renderer: &CpuRenderer<Self>, rays: &[Ray]) -> Vec<Pixel>;
    /// [`CpuRenderer::trace_info`].
    fn trace_info(renderer: &CpuRenderer<Self>, rays: &[Ray], has_normals: bool) -> Vec<TraceInfo>;
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

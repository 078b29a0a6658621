//! Every renderer against the reference, separately for rays above and below the decision margin.

use std::sync::LazyLock;

use glam::DVec3;
use rayon::prelude::*;
use strivec_field::Field;
use strivec_field::render::Approximation;
use strivec_field::render::gpu::{Gpu, GpuRenderer, Precision};
use strivec_field::render::{CpuRenderer, Pixel, ReferenceRenderer, Renderer, Trace};
use strivec_format::geometry::{MAX_SPACING, Ray};
use strivec_format::model::Scene;

/// A renderer and its precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    CpuF64,
    CpuF32,
    GpuF32,
    GpuF16,
}

impl Way {
    pub(crate) const ALL: &[Self] = &[Self::CpuF64, Self::CpuF32, Self::GpuF32, Self::GpuF16];

    /// A generous bound of the relative rounding error of positions.
    pub(crate) fn rounding(self) -> f64 {
        if self == Self::CpuF64 { 1e-15 } else { 2.0 * f64::from(f32::EPSILON) }
    }

    /// Bound of the rounding error of a sample's position in `scene`, in model units.
    pub(crate) fn position_error(self, scene: &Scene) -> f64 {
        let farthest = if scene.rules.contraction.is_some() { MAX_SPACING } else { scene.frame.far };
        self.rounding() * (scene.bounds.size().max_element() + farthest)
    }

    /// Bound of the color difference to the reference on clear, well-conditioned rays.
    pub(crate) fn bound(self) -> f64 {
        match self {
            Self::CpuF64 => 1e-7,
            Self::CpuF32 => 2e-4,
            Self::GpuF32 => 1e-3,
            Self::GpuF16 => 1e-2,
        }
    }

    /// The pixels of `rays` through `scene`.
    pub(crate) fn trace(self, scene: &Scene, rays: &[Ray]) -> Vec<Pixel> {
        match self {
            Self::CpuF64 => CpuRenderer::from_field(Field::<f64>::unlimited(scene)).trace(rays),
            Self::CpuF32 => CpuRenderer::unlimited(scene).trace(rays),
            Self::GpuF32 => on_device(scene, rays, Precision::F32),
            Self::GpuF16 => on_device(scene, rays, Precision::F16),
        }
    }
}

fn on_device(scene: &Scene, rays: &[Ray], precision: Precision) -> Vec<Pixel> {
    // Never dropped: the driver may be unloaded before the device of a thread is dropped.
    static GPU: LazyLock<Gpu> =
        LazyLock::new(|| Gpu::open().unwrap_or_else(|e| panic!("{e}; apt-get install mesa-vulkan-drivers")));
    let renderer = GpuRenderer::new(&GPU, scene.clone(), &Approximation::default(), precision);
    renderer.unwrap().trace(rays).unwrap()
}

/// Sorted differences to the reference, the largest channel of each ray.
#[derive(Debug, Default)]
pub(crate) struct Errors {
    pub(crate) clear: Vec<f64>,
    pub(crate) near: Vec<f64>,
}

impl Errors {
    fn quantile(sorted: &[f64], q: f64) -> f64 {
        let at = (q * sorted.len() as f64).ceil() as usize;
        sorted.get(at.saturating_sub(1)).copied().unwrap_or(0.0)
    }

    pub(crate) fn clear_maximum(&self) -> f64 {
        Self::quantile(&self.clear, 1.0)
    }

    /// Median, 99.9 % quantile and maximum of the clear rays, then of the others.
    pub(crate) fn row(&self) -> String {
        let of = |sorted: &[f64]| [0.5, 0.999, 1.0].map(|q| format!("{:.1e}", Self::quantile(sorted, q))).join(" | ");
        format!("{} | {} | {} | {}", self.clear.len(), of(&self.clear), self.near.len(), of(&self.near))
    }
}

/// The reference's traces of `rays`.
pub(crate) fn expected(scene: &Scene, rays: &[Ray]) -> Vec<Trace> {
    let reference = ReferenceRenderer::new(scene);
    rays.par_iter().map(|ray| reference.trace_one(ray)).collect()
}

/// Errors of `way` on `rays`. All its values must be finite.
pub(crate) fn errors(way: Way, scene: &Scene, rays: &[Ray], expected: &[Trace]) -> Errors {
    let limit = way.position_error(scene);
    let mut errors = Errors::default();
    for (expected, found) in expected.iter().zip(way.trace(scene, rays)) {
        let numbers = found.color.iter().chain([&found.opacity, &found.depth]);
        assert!(numbers.clone().all(|v| v.is_finite()), "{way:?}: {found:?}, expected {expected:?}");
        let colors = (0..3).map(|c| (expected.color[c] - f64::from(found.color[c])).abs());
        let apart = colors.fold((expected.opacity - f64::from(found.opacity)).abs(), f64::max);
        if expected.margin > limit { errors.clear.push(apart) } else { errors.near.push(apart) }
    }
    errors.clear.sort_by(f64::total_cmp);
    errors.near.sort_by(f64::total_cmp);
    errors
}

/// Asserts that all `ways` are within `times` their bounds on the clear rays, and that at least a tenth of `rays` are
/// clear. Returns the largest differences.
pub(crate) fn within(name: &str, scene: &Scene, rays: &[Ray], ways: &[Way], times: f64) -> Vec<f64> {
    let expected = expected(scene, rays);
    (ways.iter())
        .map(|&way| {
            let errors = errors(way, scene, rays, &expected);
            println!("| {name} | {way:?} | {:?} | {} |", scene.decoder.mode, errors.row());
            assert!(10 * errors.clear.len() >= rays.len(), "{name}, {way:?}: {}", errors.row());
            let bound = times * way.bound();
            assert!(errors.clear_maximum() <= bound, "{name}, {way:?}: {} > {bound}", errors.clear_maximum());
            errors.clear_maximum()
        })
        .collect()
}

/// `count` rays from all around through `scene`, none along an axis.
pub(crate) fn rays_through(scene: &Scene, count: usize) -> Vec<Ray> {
    let (center, size) = (scene.bounds.center(), scene.bounds.size());
    let point = |n: usize, shift: f64| {
        // Low-discrepancy points of three dimensions.
        let part = |g: f64| (n as f64 * g + shift).fract() - 0.5;
        DVec3::new(part(0.819_172_513_4), part(0.671_043_606_7), part(0.549_700_477_9))
    };
    (0..count)
        .map(|n| {
            let target = center + 0.8 * point(n, 0.37) * size;
            let origin = center + 1.3 * size.length() * (point(n, 0.71) + 1e-3).normalize();
            Ray { origin, direction: (target - origin).normalize() }
        })
        .collect()
}

//! Rays with what they see: written by the reference, recomputed by any renderer.

use glam::DVec3;
use rayon::prelude::*;

use crate::container::{Probe, Probes};
use crate::geometry::Ray;
use crate::model::{ReferenceField, Scene};
use crate::random::Random;
use crate::render::{Pixel, ReferenceRenderer, Renderer};

/// How many rays are tried for each probe: of the tried the one that is farthest from any other decision is taken.
const TRIED: u64 = 16;
/// Smaller decision margins, in model units, are not what f32 can be held against.
pub const PROBE_MARGIN: f64 = 2e-6;
/// The most that renderers may differ by if no decision is near (spec 4.10).
const COLOR_TOLERANCE: f64 = 2e-4;

/// How far a renderer is from a scene's probes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeReport {
    /// Probes whose margin is above [`PROBE_MARGIN`]; only those are held against their tolerances.
    pub compared: usize,
    /// All of them.
    pub count: usize,
    /// Of colors and opacity.
    pub largest_color_difference: f64,
    /// In model units.
    pub largest_depth_difference: f64,
    /// Probes that are beyond a tolerance.
    pub failed: usize,
}

/// `count` probes of `scene`, spread over what it shows; fewer where it shows almost nothing.
///
/// Cameras stand around the bounds at any angle, where a dataset's cameras may; each looks at a point of the bounds. A
/// probe's point is the one that the ray sees, at its depth.
pub fn make_probes(scene: &Scene, count: usize, seed: u64) -> Probes {
    let renderer = ReferenceRenderer::new(scene);
    let field = ReferenceField::new(scene);
    let random = Random::new(seed, "probes");
    let probes = (0..count as u64)
        .into_par_iter()
        .filter_map(|n| {
            let stream = random.substream(n);
            let candidates = (0..TRIED).filter_map(|k| candidate(scene, &renderer, &field, &stream.substream(k)));
            candidates.max_by(|a, b| a.margin.total_cmp(&b.margin))
        })
        .collect();
    Probes {
        color_tolerance: COLOR_TOLERANCE,
        // A ray's length is some thousand steps, of which f32 holds each to a part in ten million.
        depth_tolerance: 0.1 * scene.rules.step,
        density_tolerance: 1e-3,
        probes,
    }
}

fn candidate(
    scene: &Scene,
    renderer: &ReferenceRenderer<'_>,
    field: &ReferenceField<'_>,
    random: &Random,
) -> Option<Probe> {
    let (center, half) = (scene.bounds.center(), 0.5 * scene.bounds.size());
    let around = DVec3::new(random.normal(0), random.normal(1), random.normal(2)).try_normalize()?;
    // Outside the bounds, and so that they lie between near and far.
    let distance = (scene.frame.near + half.length()).min(scene.frame.far);
    let origin = center + distance * around;
    let aim = DVec3::new(random.uniform(10), random.uniform(11), random.uniform(12)) * 2.0 - 1.0;
    let direction = (center + 0.7 * aim * half - origin).try_normalize()?;
    let ray = Ray { origin, direction };
    let trace = renderer.trace_one(&ray);
    if trace.opacity <= 0.0 {
        return None;
    }
    let seen = field.locate(ray.at(trace.depth));
    if !seen.covered {
        return None;
    }
    let density_feature = field.density_feature(&seen).feature;
    Some(Probe {
        origin: origin.to_array(),
        direction: direction.to_array(),
        color: trace.color,
        opacity: trace.opacity,
        depth: trace.depth,
        point: seen.position.to_array(),
        density_feature,
        margin: trace.margin.min(seen.margin),
        reserved: [0; 2],
    })
}

/// Holds what `renderer` sees against `probes`.
pub fn check_probes(renderer: &dyn Renderer, probes: &Probes) -> ProbeReport {
    let rays: Vec<Ray> = (probes.probes.iter())
        .map(|p| Ray { origin: DVec3::from_array(p.origin), direction: DVec3::from_array(p.direction) })
        .collect();
    let mut report = ProbeReport { count: probes.probes.len(), ..ProbeReport::default() };
    for (probe, pixel) in probes.probes.iter().zip(renderer.trace(&rays)) {
        if probe.margin <= PROBE_MARGIN {
            continue;
        }
        let Pixel { color, opacity, depth } = pixel;
        let colors = color.iter().zip(probe.color).map(|(&found, expected)| (f64::from(found) - expected).abs());
        let color = colors.fold((f64::from(opacity) - probe.opacity).abs(), f64::max);
        let depth = (f64::from(depth) - probe.depth).abs();
        report.compared += 1;
        report.largest_color_difference = report.largest_color_difference.max(color);
        report.largest_depth_difference = report.largest_depth_difference.max(depth);
        let within = color <= probes.color_tolerance && depth <= probes.depth_tolerance;
        report.failed += usize::from(!within);
    }
    report
}

/// The largest difference between the reference's density features and those of `probes`, relative to the larger of 1
/// and their size; none where no probe is compared.
pub fn probe_density_error(scene: &Scene, probes: &Probes) -> f64 {
    let field = ReferenceField::new(scene);
    let error = |probe: &Probe| {
        let found = field.density_feature(&field.locate(DVec3::from_array(probe.point))).feature;
        (found - probe.density_feature).abs() / probe.density_feature.abs().max(1.0)
    };
    probes.probes.iter().filter(|p| p.margin > PROBE_MARGIN).map(error).fold(0.0, f64::max)
}

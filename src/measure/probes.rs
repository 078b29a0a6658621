//! Probes: rays with the color, opacity and depth of the reference, which every renderer can check.

use glam::DVec3;
use rayon::prelude::*;

use crate::container::{Probe, Probes};
use crate::geometry::{Aabb, Ray};
use crate::model::{ReferenceField, Scene};
use crate::random::Random;
use crate::render::{Pixel, ReferenceRenderer, Renderer};

/// Rays tried for each probe. The one with the largest decision margin is kept.
const TRIED: u64 = 16;
/// Smallest decision margin, in model units, at which an f32 renderer is compared.
pub const PROBE_MARGIN: f64 = 2e-6;
/// Largest difference of color if no decision is near (spec 4.10).
const COLOR_TOLERANCE: f64 = 2e-4;

/// The differences of a renderer to a scene's probes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeReport {
    /// Probes whose margin is above [`PROBE_MARGIN`]; the others are not compared.
    pub compared: usize,
    /// Number of probes.
    pub count: usize,
    /// Largest difference of a color channel or of the opacity.
    pub largest_color_difference: f64,
    /// Largest difference of depth, in model units.
    pub largest_depth_difference: f64,
    /// Compared probes beyond a tolerance.
    pub failed: usize,
}

/// `count` probes of `scene`, spread over its surfaces; fewer if it shows almost nothing.
///
/// Rays begin around the bounds, in random directions, and go towards a random point in the bounds. A probe's point is
/// the point of the ray at its depth.
pub fn make_probes(scene: &Scene, count: usize, seed: u64) -> Probes {
    let renderer = ReferenceRenderer::new(scene);
    let field = ReferenceField::new(scene);
    let random = Random::new(seed, "probes");
    let probes: Vec<Probe> = (0..count as u64)
        .into_par_iter()
        .filter_map(|n| {
            let stream = random.substream(n);
            let candidates = (0..TRIED).filter_map(|k| candidate(scene, &renderer, &field, &stream.substream(k)));
            candidates.max_by(|a, b| a.margin.total_cmp(&b.margin))
        })
        .collect();
    Probes {
        color_tolerance: COLOR_TOLERANCE,
        // A ray has about a thousand steps; f32 rounds each position by one part in ten million. In a contracted scene
        // distances grow faster than the spacing of samples.
        depth_tolerance: match scene.rules.contraction {
            None => 0.1 * scene.rules.step,
            Some(_) => 0.1 * scene.rules.step * probes.iter().map(|p| 1.0 + p.depth * p.depth).fold(1.0, f64::max),
        },
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
    // In a contracted scene the inner cube, which its cameras surround or are in.
    let inner = Aabb::around(DVec3::ZERO, DVec3::ONE);
    let bounds = if scene.rules.contraction.is_some() { inner } else { scene.bounds };
    let (center, half) = (bounds.center(), 0.5 * bounds.size());
    let around = DVec3::new(random.normal(0), random.normal(1), random.normal(2)).try_normalize()?;
    // Outside the bounds, and so that they lie between near and far.
    let distance = (scene.frame.near + half.length()).min(scene.frame.far);
    let origin = center + distance * around;
    let aim = DVec3::new(random.uniform(10), random.uniform(11), random.uniform(12)) * 2.0 - 1.0;
    let direction = (center + 0.7 * aim * half - origin).try_normalize()?;
    let ray = Ray { origin, direction };
    let trace = renderer.trace_one(&ray);
    // A ray that sees the sky alone is opaque and has no depth.
    if trace.opacity <= 0.0 || trace.depth <= 0.0 {
        return None;
    }
    let seen = field.locate(scene.rules.contracted(ray.at(trace.depth)));
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

/// Compares `renderer` with `probes`.
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
/// and their size; 0 if no probe is compared.
pub fn probe_density_error(scene: &Scene, probes: &Probes) -> f64 {
    let field = ReferenceField::new(scene);
    let error = |probe: &Probe| {
        let found = field.density_feature(&field.locate(DVec3::from_array(probe.point))).feature;
        (found - probe.density_feature).abs() / probe.density_feature.abs().max(1.0)
    };
    probes.probes.iter().filter(|p| p.margin > PROBE_MARGIN).map(error).fold(0.0, f64::max)
}

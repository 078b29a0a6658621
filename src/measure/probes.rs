//! Probes: rays with the color, opacity and depth of the reference, which every renderer can check.

use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use strivec_field::Field;
use strivec_field::render::{CpuRenderer, Pixel, ReferenceRenderer, Renderer};
use strivec_format::container::{Probe, Probes};
use strivec_format::geometry::{Aabb, Ray};
use strivec_format::model::{MemoryLimit, ReferenceField, Scene};
use strivec_format::random::Random;

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
    let rays: Vec<Ray> = probes.probes.iter().map(Probe::ray).collect();
    compare(probes, renderer.trace(&rays).into_iter().map(Some))
}

/// What checking the probes of an untrusted file may take.
#[derive(Clone, Copy, Debug)]
pub struct ProbeLimits {
    /// Bytes of memory, besides the scene.
    pub memory: u64,
    /// When to end, if ever.
    pub deadline: Option<Instant>,
}

/// The memory of [`ProbeLimits`] does not suffice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{part} needs {} MiB of memory, but {} MiB of the budget are left; allow more", needed.div_ceil(1 << 20), left >> 20)]
pub struct OverBudget {
    part: &'static str,
    needed: u64,
    left: u64,
}

/// How the renderers compare with probes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CheckedProbes {
    /// Probes that were traced before the deadline.
    pub traced: usize,
    /// Differences of the reference renderer to the probes.
    pub reference: ProbeReport,
    /// Differences of the CPU renderer to the probes.
    pub cpu: ProbeReport,
    /// Largest error of the density feature, as [`probe_density_error`] measures it, of the probes that were traced.
    pub density_error: f64,
}

/// Compares the reference and the CPU renderer with `probes`, ray by ray, until the deadline.
///
/// The reference can end at any sample. The CPU renderer, which takes less time, traces only the rays that the reference has.
///
/// # Errors
///
/// If it takes more memory than `limits` allows.
pub fn check_probes_within(scene: &Scene, probes: &Probes, limits: ProbeLimits) -> Result<CheckedProbes, OverBudget> {
    let unless_over =
        |part, needed, left| if needed <= left { Ok(left - needed) } else { Err(OverBudget { part, needed, left }) };
    let start = Instant::now();
    let is_before = |deadline: Option<Instant>| deadline.is_none_or(|deadline| Instant::now() < deadline);
    // The other half is for the CPU renderer.
    let half = limits.deadline.map(|deadline| start + deadline.saturating_duration_since(start) / 2);

    unless_over("the reference renderer", ReferenceField::memory(scene), limits.memory)?;
    let reference = ReferenceRenderer::new(scene);
    let mut references: Vec<Option<Pixel>> = (probes.probes.par_iter())
        .map(|probe| Some(reference.trace_while(&probe.ray(), || is_before(half))?.pixel()))
        .collect();
    let field = ReferenceField::new(scene);
    let mut density_error = 0.0;
    for (probe, pixel) in probes.probes.iter().zip(&mut references).filter(|(_, pixel)| pixel.is_some()) {
        if is_before(limits.deadline) {
            density_error = f64::max(density_error, density_error_of(&field, probe));
        } else {
            *pixel = None;
        }
    }
    drop((reference, field));

    let needed = Field::<f32>::memory(scene, MemoryLimit(limits.memory)).unwrap_or_else(|error| error.needed);
    let left = unless_over("the CPU renderer", needed, limits.memory)?;
    let renderer = CpuRenderer::<f32>::unlimited(scene);
    // Besides the ray that is counted.
    let together = (left / Field::<f32>::memory_of_ray(scene)).clamp(0, 63) as usize + 1;
    let mut pixels = vec![None; probes.probes.len()];
    let traced: Vec<usize> = (0..pixels.len()).filter(|&n| references[n].is_some()).collect();
    for some in traced.chunks(together).take_while(|_| is_before(limits.deadline)) {
        let rays: Vec<Ray> = some.iter().map(|&n| probes.probes[n].ray()).collect();
        for (&n, pixel) in some.iter().zip(renderer.trace(&rays)) {
            pixels[n] = Some(pixel);
        }
    }
    Ok(CheckedProbes {
        traced: pixels.iter().flatten().count(),
        reference: compare(probes, references.into_iter()),
        cpu: compare(probes, pixels.into_iter()),
        density_error,
    })
}

/// Compares `pixels` with those of `probes`, where there is one.
fn compare(probes: &Probes, pixels: impl Iterator<Item = Option<Pixel>>) -> ProbeReport {
    let mut report = ProbeReport { count: probes.probes.len(), ..ProbeReport::default() };
    for (probe, pixel) in probes.probes.iter().zip(pixels) {
        let Some(Pixel { color, opacity, depth }) = pixel.filter(|_| probe.margin > PROBE_MARGIN) else { continue };
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
    probes.probes.iter().map(|probe| density_error_of(&field, probe)).fold(0.0, f64::max)
}

/// Error of the density feature at one probe; 0 if it is not compared.
fn density_error_of(field: &ReferenceField<'_>, probe: &Probe) -> f64 {
    if probe.margin <= PROBE_MARGIN {
        return 0.0;
    }
    let found = field.density_feature(&field.locate(DVec3::from_array(probe.point))).feature;
    (found - probe.density_feature).abs() / probe.density_feature.abs().max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::container::{Limits, decode_scene_file};

    #[test]
    fn probes_are_checked_within_time_and_memory() {
        let bytes = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/f32.strivec"));
        let file = decode_scene_file(bytes, Limits::default()).unwrap();
        let probes = file.metadata.probes.unwrap();
        let check = |memory, deadline| check_probes_within(&file.scene, &probes, ProbeLimits { memory, deadline });

        let whole = check(1 << 28, None).unwrap();
        assert_eq!(whole.traced, 64);
        assert_eq!(whole.reference, check_probes(&ReferenceRenderer::new(&file.scene), &probes));
        assert_eq!(whole.cpu, check_probes(&CpuRenderer::<f32>::unlimited(&file.scene), &probes));
        assert_eq!(whole.density_error, probe_density_error(&file.scene, &probes));

        let late = check(1 << 28, Some(Instant::now())).unwrap();
        assert_eq!((late.traced, late.reference.compared, late.cpu.compared), (0, 0, 0));

        for memory in [0, 1 << 10, 1 << 15, 1 << 17] {
            assert!(check(memory, None).is_err(), "{memory} bytes");
        }
    }
}

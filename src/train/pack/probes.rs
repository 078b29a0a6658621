//! The probes of a file that still hold after an edit of its scene.

use glam::DVec3;
use rayon::prelude::*;

use strivec_field::render::ReferenceRenderer;
use strivec_format::container::{Probe, Probes};
use strivec_format::geometry::{Ray, RayPath};
use strivec_format::model::{ReferenceField, Scene};

/// Probes that differ by more than this from the reference are dropped: relative to the larger of 1 and the value.
const TOLERANCE: f64 = 1e-9;
/// Samples of all rays that are traced, at most. Those of the usual 64 probes are a sixteenth of this.
const MAX_SAMPLES: f64 = (1 << 22) as f64;

/// The probes among `probes` whose pixel and density feature are the reference's for `scene`, with the decision margin
/// that they have in it if that is smaller. Probes whose rays together have too many samples to trace are left out,
/// too.
pub fn true_probes(scene: &Scene, probes: &Probes) -> Vec<Probe> {
    let (renderer, field) = (ReferenceRenderer::new(scene), ReferenceField::new(scene));
    let is_near = |found: f64, stored: f64| (found - stored).abs() <= TOLERANCE * stored.abs().max(1.0);
    let kept = |probe: &&Probe| -> Option<Probe> {
        let trace = renderer.trace_one(&probe.ray());
        let seen = field.locate(DVec3::from_array(probe.point));
        let pixel = trace
            .color
            .into_iter()
            .zip(probe.color)
            .chain([(trace.opacity, probe.opacity), (trace.depth, probe.depth)]);
        let density = field.density_feature(&seen).feature;
        let holds = seen.covered && pixel.chain([(density, probe.density_feature)]).all(|(f, s)| is_near(f, s));
        holds.then(|| Probe { margin: probe.margin.min(trace.margin).min(seen.margin), ..**probe })
    };
    let mut left = MAX_SAMPLES;
    let traced: Vec<&Probe> = (probes.probes.iter())
        .take_while(|probe| {
            left -= samples(scene, &probe.ray());
            left >= 0.0
        })
        .collect();
    traced.par_iter().filter_map(kept).collect()
}

/// The samples of a ray, at most.
fn samples(scene: &Scene, ray: &Ray) -> f64 {
    let near_far = [scene.frame.near, scene.frame.far];
    let path = RayPath::new(ray, &scene.bounds, scene.rules.contraction, near_far);
    path.span.map_or(0.0, |(start, end)| ((end - start) / scene.rules.step).max(0.0))
}

//! The reference renderer: one ray after another, in f64, on the reference field.

use rayon::prelude::*;

use super::{Pixel, Renderer};
use crate::geometry::Ray;
use crate::model::{DecoderMode, ReferenceField, Scene, alpha, sigmoid};

/// What a ray sees, in f64, and how close it came to seeing something else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trace {
    /// sRGB, composited on the scene's background.
    pub color: [f64; 3],
    /// 1 − the transmittance that is left at the end of the ray.
    pub opacity: f64,
    /// Σ w·t / Σ w in model units; 0 where no sample counted.
    pub depth: f64,
    /// The smallest displacement of a sample, per axis and in model units, that changes a decision of this ray:
    /// coverage, ranking, occupancy, a threshold, or the number of samples. At most [`ReferenceField::margin_horizon`].
    pub margin: f64,
    /// The condition of density along the ray: where every product of factors has a relative error of ε, no decision comes
    /// out differently and ε is small, color and opacity change by at most this times ε.
    pub condition: f64,
}

/// Renders a scene as DESIGN, section 2, defines it.
#[derive(Debug)]
pub struct ReferenceRenderer<'a> {
    field: ReferenceField<'a>,
}

impl<'a> ReferenceRenderer<'a> {
    /// Prepares `scene`, which must have passed [`Scene::check`].
    pub fn new(scene: &'a Scene) -> Self {
        Self { field: ReferenceField::new(scene) }
    }

    /// Marches one ray (DESIGN, sections 2.8 and 2.9).
    pub fn trace_one(&self, ray: &Ray) -> Trace {
        let scene = self.field.scene();
        let rules = &scene.rules;
        let mut color = [0.0; 3];
        // Where rays are decoded: Σ w and Σ w·f over the colored samples, and of each w and its first features.
        let mut composed_weight = 0.0;
        let mut composed = vec![0.0; scene.features() as usize];
        let mut own_colors = Vec::new();
        let (mut weight_sum, mut distance_sum) = (0.0, 0.0);
        let mut transmittance = 1.0;
        let mut margin = self.field.margin_horizon();
        // By how much ln(transmittance) can change for a displacement of all samples so far by 1 per axis.
        let mut sensitivity = 0.0;
        let mut condition = 0.0;

        if let Some((entry, exit)) = scene.bounds.intersect(ray) {
            let start = entry.max(scene.frame.near);
            let end = exit.min(scene.frame.far);
            for k in 0.. {
                let t = start + f64::from(k) * rules.step;
                // One sample more or less at the far end of the span.
                margin = margin.min((t - end).abs());
                if t >= end {
                    break;
                }
                let position = ray.at(t);
                let (occupied, occupancy_margin) = self.field.occupied(position);
                let point = self.field.locate(position);
                // A sample counts where both hold: one that fails is out until the last that fails is reached.
                let failing = [(occupied, occupancy_margin), (point.covered, point.margin)];
                let failing = failing.into_iter().filter(|(holds, _)| !holds).map(|(_, margin)| margin);
                if let Some(outside) = failing.reduce(f64::max) {
                    margin = margin.min(outside);
                    continue;
                }
                margin = margin.min(occupancy_margin).min(point.margin);

                let density = self.field.density_feature(&point);
                let depth = rules.optical_depth(self.field.density(density.feature));
                let depth_slope = rules.optical_depth(sigmoid(density.feature + rules.density_shift));
                let slope = depth_slope * density.gradient.abs().element_sum();
                let sample_alpha = alpha(depth);
                let weight = transmittance * sample_alpha;
                let after = transmittance * (1.0 - sample_alpha);
                // A change of this sample's depth takes from what is behind it what it adds in front.
                condition += after * depth_slope * density.magnitude;

                let weight_sensitivity = weight * sensitivity + after * slope;
                margin = margin.min((weight - rules.min_weight).abs() / weight_sensitivity);
                if weight > rules.min_weight {
                    let features = self.field.appearance_features(&point);
                    match scene.decoder.mode {
                        DecoderMode::PerSample => {
                            let sample_color = self.field.decode(&features, ray.direction);
                            color.iter_mut().zip(sample_color).for_each(|(c, s)| *c += weight * s);
                        }
                        DecoderMode::PerRay | DecoderMode::Residual => {
                            if scene.decoder.mode == DecoderMode::Residual {
                                own_colors.push((weight, [features[0], features[1], features[2]]));
                            }
                            composed_weight += weight;
                            composed.iter_mut().zip(features).for_each(|(sum, f)| *sum += weight * f);
                        }
                    }
                }
                weight_sum += weight;
                distance_sum += weight * t;

                transmittance = after;
                sensitivity += slope;
                margin = margin.min((transmittance - rules.min_transmittance).abs() / (transmittance * sensitivity));
                if transmittance < rules.min_transmittance {
                    break;
                }
            }
        }
        if composed_weight > 0.0 {
            composed.iter_mut().for_each(|f| *f /= composed_weight);
            let ray_range = self.field.decoder_output(&composed, ray.direction);
            if scene.decoder.mode == DecoderMode::Residual {
                for (weight, own) in own_colors {
                    (0..3).for_each(|c| color[c] += weight * sigmoid(own[c] + ray_range[c]));
                }
            } else {
                color = ray_range.map(|v| composed_weight * sigmoid(v));
            }
        }
        for (c, &background) in color.iter_mut().zip(&scene.frame.background) {
            *c += transmittance * f64::from(background);
        }
        let depth = if weight_sum > 0.0 { distance_sum / weight_sum } else { 0.0 };
        Trace { color, opacity: 1.0 - transmittance, depth, margin, condition }
    }
}

impl Renderer for ReferenceRenderer<'_> {
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel> {
        let pixel = |ray| {
            let trace = self.trace_one(ray);
            let color = trace.color.map(|c| c as f32);
            Pixel { color, opacity: trace.opacity as f32, depth: trace.depth as f32 }
        };
        rays.par_iter().map(pixel).collect()
    }
}

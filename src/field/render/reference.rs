//! The reference renderer: one ray at a time, in f64, on the reference field. It defines the pixels of every other
//! renderer (docs/numerics.md).

use rayon::prelude::*;

use super::{Pixel, Renderer};
use strivec_format::geometry::{Ray, RayPath};
use strivec_format::model::{DecoderMode, ReferenceField, Scene, alpha, sigmoid};

/// A traced ray in f64, with its decision margin and condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trace {
    /// The color, sRGB, composited on the scene's background or sky.
    pub color: [f64; 3],
    /// 1 − the transmittance at the end of the ray; 1 in a scene with a sky.
    pub opacity: f64,
    /// The expected depth Σ w·t / Σ w, in model units; 0 if no sample counted.
    pub depth: f64,
    /// The decision margin (spec 4.10): the smallest displacement of a sample, per axis and in model units, that
    /// changes a decision of this ray (coverage, ranking, occupancy, a threshold, or the number of samples). At most
    /// [`ReferenceField::margin_horizon`].
    pub margin: f64,
    /// The condition of density along the ray and of the sky: if every product of factors, and every product of the
    /// sky's sums, has a relative error of at most ε, no decision changes and ε is small, color and opacity change by
    /// at most the condition times ε.
    pub condition: f64,
}

impl Trace {
    /// The pixel, in 32 bits.
    pub fn pixel(&self) -> Pixel {
        let color = self.color.map(|c| c as f32);
        Pixel { color, opacity: self.opacity as f32, depth: self.depth as f32 }
    }
}

/// Renders a scene as spec 4 defines it.
#[derive(Debug)]
pub struct ReferenceRenderer<'a> {
    field: ReferenceField<'a>,
}

impl<'a> ReferenceRenderer<'a> {
    /// Prepares `scene`, which must have passed [`Scene::check`].
    pub fn new(scene: &'a Scene) -> Self {
        Self { field: ReferenceField::new(scene) }
    }

    /// Marches one ray (spec 4.8).
    pub fn trace_one(&self, ray: &Ray) -> Trace {
        self.trace_while(ray, || true).expect("nothing ends the march")
    }

    /// Marches one ray like [`Self::trace_one`]; `None` if `goes_on` returns false before some sample.
    pub fn trace_while(&self, ray: &Ray, goes_on: impl Fn() -> bool) -> Option<Trace> {
        let scene = self.field.scene();
        let rules = &scene.rules;
        let mut shading = ShadingSums::new(scene.features() as usize);
        let (mut weight_sum, mut distance_sum) = (0.0, 0.0);
        let mut transmittance = 1.0;
        let mut margin = self.field.margin_horizon();
        // The change of ln(transmittance) by a displacement of all samples so far by 1 per axis.
        let mut sensitivity = 0.0;
        let mut condition = 0.0;

        // Samples: u_k = u_0 + k·δ while u_k is before the end. Without contraction u is the distance t.
        let path = RayPath::new(ray, &scene.bounds, rules.contraction, [scene.frame.near, scene.frame.far]);
        if let Some((start, end)) = path.span {
            for k in 0.. {
                let u = start + f64::from(k) * rules.step;
                // The number of samples changes if the last one crosses the end.
                margin = margin.min((u - end).abs());
                if u >= end {
                    break;
                }
                if !goes_on() {
                    return None;
                }
                // Counting: in the model and occupied.
                let position = path.position(u);
                let (occupied, occupancy_margin) = self.field.occupied(position);
                let point = self.field.locate(position);
                // If conditions fail, the sample counts only after a displacement that reaches all of them.
                let failing = [(occupied, occupancy_margin), (point.covered, point.margin)];
                let failing = failing.into_iter().filter(|(holds, _)| !holds).map(|(_, margin)| margin);
                if let Some(outside) = failing.reduce(f64::max) {
                    margin = margin.min(outside);
                    continue;
                }
                margin = margin.min(occupancy_margin).min(point.margin);

                // Opacity and visibility weight: α = 1 − exp(−σ·δ·distance scale), w = T·α.
                let density = self.field.density_feature(&point);
                let depth = rules.optical_depth(self.field.density(density.feature));
                let depth_slope = rules.optical_depth(sigmoid(density.feature + rules.density_shift));
                let slope = depth_slope * density.gradient.abs().element_sum();
                let sample_alpha = alpha(depth);
                let weight = transmittance * sample_alpha;
                let after = transmittance * (1.0 - sample_alpha);
                // A change of this sample's depth adds in front as much as it removes behind.
                condition += after * depth_slope * density.magnitude;

                // Shading: if w exceeds the minimum weight.
                let weight_sensitivity = weight * sensitivity + after * slope;
                margin = margin.min((weight - rules.min_weight).abs() / weight_sensitivity);
                if weight > rules.min_weight {
                    shading.add(&self.field, &self.field.appearance_features(&point), ray, weight);
                }
                weight_sum += weight;
                distance_sum += weight * path.distance(u);

                // The end of the march: T below the minimum transmittance.
                transmittance = after;
                sensitivity += slope;
                margin = margin.min((transmittance - rules.min_transmittance).abs() / (transmittance * sensitivity));
                if transmittance < rules.min_transmittance {
                    break;
                }
            }
        }
        let mut color = shading.color(&self.field, ray);
        let background = match &rules.sky {
            Some(sky) => {
                condition += transmittance * sky.condition(ray.direction);
                sky.color(ray.direction)
            }
            None => scene.frame.background.map(f64::from),
        };
        color.iter_mut().zip(background).for_each(|(c, b)| *c += transmittance * b);
        let opacity = if rules.sky.is_some() { 1.0 } else { 1.0 - transmittance };
        let depth = if weight_sum > 0.0 { distance_sum / weight_sum } else { 0.0 };
        Some(Trace { color, opacity, depth, margin, condition })
    }
}

/// The sums over a ray's shaded samples, by decoder mode (spec 4.8).
struct ShadingSums {
    /// Mode *per sample*: Σ w·color.
    color: [f64; 3],
    /// The other modes: Σ w and Σ w·F.
    weight: f64,
    features: Vec<f64>,
    /// Mode *residual*: w and the first three features of each sample.
    own_colors: Vec<(f64, [f64; 3])>,
}

impl ShadingSums {
    fn new(features: usize) -> Self {
        Self { color: [0.0; 3], weight: 0.0, features: vec![0.0; features], own_colors: Vec::new() }
    }

    /// Adds a shaded sample of appearance `features`.
    fn add(&mut self, field: &ReferenceField, features: &[f64], ray: &Ray, weight: f64) {
        match field.scene().decoder.mode {
            DecoderMode::PerSample => {
                let sample_color = field.decode(features, ray.direction);
                self.color.iter_mut().zip(sample_color).for_each(|(c, s)| *c += weight * s);
            }
            mode @ (DecoderMode::PerRay | DecoderMode::Residual) => {
                if mode == DecoderMode::Residual {
                    self.own_colors.push((weight, [features[0], features[1], features[2]]));
                }
                self.weight += weight;
                self.features.iter_mut().zip(features).for_each(|(sum, f)| *sum += weight * f);
            }
        }
    }

    /// The ray's color in front of the background.
    fn color(self, field: &ReferenceField, ray: &Ray) -> [f64; 3] {
        let Self { mut color, weight: weight_sum, mut features, own_colors } = self;
        if weight_sum > 0.0 {
            features.iter_mut().for_each(|f| *f /= weight_sum);
            let output = field.decoder_output(&features, ray.direction);
            if field.scene().decoder.mode == DecoderMode::Residual {
                for (weight, own) in own_colors {
                    (0..3).for_each(|c| color[c] += weight * sigmoid(own[c] + output[c]));
                }
            } else {
                color = output.map(|v| weight_sum * sigmoid(v));
            }
        }
        color
    }
}

impl Renderer for ReferenceRenderer<'_> {
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel> {
        rays.par_iter().map(|ray| self.trace_one(ray).pixel()).collect()
    }

    fn background(&self) -> [f32; 3] {
        self.field.scene().frame.background
    }
}

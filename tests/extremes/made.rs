//! Scenes with chosen parameters: one scale, explicit centers, a small decoder.

use glam::DVec3;
use strivec_format::geometry::{Aabb, Similarity};
use strivec_format::model::{
    Aggregation, AppearanceMatrix, Block, ColorSpace, Coverage, Decoder, DecoderMode, FactorKind, Factors, Form, Frame,
    Linear, MemoryLimit, Placement, Provenance, Reduction, Rules, Scale, Scene, TensorCloud, UpAxis,
};
use strivec_format::random::Random;

/// Appearance features of a scene.
const FEATURES: u32 = 4;

/// The parameters of a scene.
#[derive(Clone)]
pub(crate) struct Made {
    pub(crate) centers: Vec<DVec3>,
    pub(crate) half: DVec3,
    pub(crate) resolution: [u32; 3],
    pub(crate) kind: FactorKind,
    pub(crate) ranks: [u32; 2],
    pub(crate) top_k: u32,
    pub(crate) mode: DecoderMode,
    pub(crate) step: f64,
    pub(crate) distance_scale: f64,
}

impl Default for Made {
    /// A tensor around the origin.
    fn default() -> Self {
        Self {
            centers: vec![DVec3::ZERO],
            half: DVec3::ONE,
            resolution: [4; 3],
            kind: FactorKind::Cp,
            ranks: [3, 3],
            top_k: 4,
            mode: DecoderMode::PerSample,
            step: 0.0625,
            distance_scale: 1.0,
        }
    }
}

/// The kinds of factors.
pub(crate) const KINDS: [FactorKind; 2] = [FactorKind::Cp, FactorKind::Vm];

/// A factor by the vertex along its axis, in matrices the first, its component, and a random number of mean 0 and deviation 1.
pub(crate) type FactorOf<'a> = &'a dyn Fn(usize, usize, f64) -> f64;

/// Random factors.
pub(crate) fn random(_: usize, _: usize, normal: f64) -> f64 {
    0.7 * normal
}

impl Made {
    /// The scene with density factors `density` and random appearance factors. Its bounds are those of the tensors,
    /// grown by a quarter.
    pub(crate) fn scene(&self, density: FactorOf<'_>) -> Scene {
        self.scene_with(density, &random)
    }

    /// The scene with density factors `density` and appearance factors `appearance`.
    pub(crate) fn scene_with(&self, density: FactorOf<'_>, appearance: FactorOf<'_>) -> Scene {
        let mut centers = self.centers.clone();
        centers.sort_by(|a, b| [a.z, a.y, a.x].partial_cmp(&[b.z, b.y, b.x]).unwrap());
        let draw = |stream: &str, blocks: &mut [Block], of: FactorOf<'_>| {
            let random = Random::new(11, stream);
            let mut n = 0;
            for Block { form, rank, values } in blocks {
                let rows = form.vectors(self.resolution).into_iter().flat_map(|vertices| 0..vertices);
                let places = rows.flat_map(|vertex| (0..*rank as usize).map(move |r| (vertex, r)));
                let all = std::iter::repeat_n(places.collect::<Vec<_>>(), self.centers.len()).flatten();
                for (value, (vertex, r)) in values.iter_mut().zip(all) {
                    let normal = (0..4).map(|k| random.uniform(4 * n + k) - 0.5).sum::<f64>() * 1.73;
                    *value = of(vertex, r, normal) as f32;
                    n += 1;
                }
            }
        };
        let [density_rank, appearance_rank] = self.ranks;
        let forms = |rank: u32| match self.kind {
            FactorKind::Cp => vec![(Form::Cp, rank)],
            FactorKind::Vm => (0..3).map(|axis| (Form::Vm(axis), (rank + 2 - axis as u32) / 3)).collect(),
        };
        let forms = [forms(density_rank), forms(appearance_rank)];
        let mut factors = Factors::zeros(self.centers.len(), self.resolution, forms.each_ref().map(Vec::as_slice));
        draw("density", &mut factors.density, density);
        draw("appearance", &mut factors.appearance, appearance);
        let cloud = TensorCloud {
            placement: Placement::Explicit { centers },
            half_edge: self.half,
            resolution: self.resolution,
        };
        let bounds = cloud.bounds();
        let bounds = bounds.grown(0.125 * bounds.size());
        let weights = |stream: &str, count: u32, deviation: f64| -> Vec<f32> {
            let random = Random::new(12, stream);
            (0..u64::from(count)).map(|n| (3.4 * deviation * (random.uniform(n) - 0.5)) as f32).collect()
        };
        let linear = |stream: &str, inputs: u32, outputs: u32| Linear {
            inputs,
            outputs,
            weights: weights(stream, inputs * outputs, 0.3),
            bias: weights(stream, outputs, 0.3),
        };
        // Features and direction, with their sines and cosines.
        let inputs = 3 * (FEATURES + 3);
        let scene = Scene {
            frame: Frame {
                model_from_dataset: Similarity::IDENTITY,
                up: UpAxis::Z,
                meters_per_unit: None,
                near: 0.0,
                far: 4.0 * bounds.size().length(),
                background: [1.0, 0.5, 0.25],
                color_space: ColorSpace::Srgb,
            },
            bounds,
            rules: Rules {
                coverage: Coverage::All,
                aggregation: Aggregation::Normalized,
                density_reduction: Reduction::Sum,
                appearance_reduction: Reduction::Sum,
                density_shift: 0.0,
                distance_scale: self.distance_scale,
                step: self.step,
                min_transmittance: 1e-3,
                min_weight: 1e-4,
                contraction: None,
                sky: None,
            },
            scales: vec![Scale {
                top_k: self.top_k,
                appearance_matrix: AppearanceMatrix {
                    features: FEATURES,
                    rank: appearance_rank,
                    weights: weights("matrix", FEATURES * appearance_rank, 1.0 / f64::from(appearance_rank).sqrt()),
                },
                factors,
                cloud,
            }],
            decoder: Decoder {
                mode: self.mode,
                feature_frequencies: 1,
                direction_frequencies: 1,
                layers: vec![linear("first", inputs, 8), linear("second", 8, 3)],
            },
            occupancy: None,
            provenance: Provenance::default(),
            memory: MemoryLimit::NONE,
        };
        scene.check().expect("a valid scene");
        scene
    }
}

/// The centers of a lattice of `counts` around the origin, `pitch` apart.
pub(crate) fn lattice(counts: [u32; 3], pitch: DVec3) -> Vec<DVec3> {
    let [columns, rows, layers] = counts;
    let middle = (DVec3::new(columns.into(), rows.into(), layers.into()) - 1.0) * 0.5;
    let all = (0..layers).flat_map(|z| (0..rows).flat_map(move |y| (0..columns).map(move |x| (x, y, z))));
    all.map(|(x, y, z)| (DVec3::new(x.into(), y.into(), z.into()) - middle) * pitch).collect()
}

/// `scene` scaled by `factor` around the origin, then moved by `offset`, in model units. The picture does not change.
pub(crate) fn moved(mut scene: Scene, factor: f64, offset: DVec3) -> Scene {
    let point = |p: DVec3| factor * p + offset;
    scene.bounds = Aabb { min: point(scene.bounds.min), max: point(scene.bounds.max) };
    for scale in &mut scene.scales {
        scale.cloud.half_edge *= factor;
        match &mut scale.cloud.placement {
            Placement::Explicit { centers } => centers.iter_mut().for_each(|c| *c = point(*c)),
            Placement::Lattice { lattice, .. } => {
                lattice.origin = point(lattice.origin);
                lattice.pitch *= factor;
            }
        }
    }
    if let Some(occupancy) = &mut scene.occupancy {
        occupancy.bounds = Aabb { min: point(occupancy.bounds.min), max: point(occupancy.bounds.max) };
    }
    scene.frame.near *= factor;
    scene.frame.far *= factor;
    scene.rules.step *= factor;
    scene.rules.distance_scale /= factor;
    scene.check().expect("a valid scene");
    scene
}

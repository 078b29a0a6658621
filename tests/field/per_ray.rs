//! One decoder call per ray, without and with residual colors of samples: the reference against values computed by
//! hand.

use crate::scenes;

use glam::{DVec3, UVec3};
use strivec_field::render::{ReferenceRenderer, Trace};
use strivec_format::geometry::{Aabb, Lattice, Ray, Similarity};
use strivec_format::model::{
    Aggregation, AppearanceMatrix, Block, ColorSpace, Coverage, Decoder, DecoderMode, Factors, Frame, Linear,
    MemoryLimit, Placement, Provenance, Reduction, Rules, Scale, Scene, TensorCloud, UpAxis, sigmoid,
};

/// Ratio of a feature's residual colors before the sigmoid to the feature.
const OWN: [f64; 3] = [1.0, 2.0, -0.5];

const BACKGROUND: [f64; 3] = [1.0, 0.5, 0.25];

/// One tensor per scale around the origin, of half edge 1. Density features are 0, so σ = ln 2, and σ·δ·distance scale
/// is ln 2 as well: α is ½ everywhere. [`RAY`] has samples at z = −¾, −¼, ¼ of weights ½, ¼, ⅛ and leaves T = ⅛. The
/// scales' appearance features are 4·(z + 1) and 2, their mean 1½, 2½, 3½.
///
/// With F the feature and d the direction, the color is sigmoid of F, sin F, and cos F + d_z. If samples have residual
/// colors, features are [`OWN`] times that one.
fn scene(mode: DecoderMode, min_weight: f64) -> Scene {
    let features = mode.min_features();
    let scale = |appearance_z: [f32; 2]| Scale {
        cloud: TensorCloud {
            placement: Placement::Lattice {
                lattice: Lattice { origin: DVec3::NEG_ONE, pitch: DVec3::splat(2.0) },
                cells: vec![UVec3::ZERO],
            },
            half_edge: DVec3::ONE,
            resolution: [1; 3],
        },
        top_k: 4,
        factors: Factors {
            density: vec![Block::cp(1, vec![0.0; 6])],
            appearance: vec![Block::cp(1, vec![1.0, 1.0, 1.0, 1.0, appearance_z[0], appearance_z[1]])],
        },
        appearance_matrix: AppearanceMatrix {
            features,
            rank: 1,
            weights: OWN[..features as usize].iter().map(|&v| v as f32).collect(),
        },
    };
    // Features, d, their sines, their cosines, sin d, cos d.
    let inputs = 3 * features + 9;
    let mut weights = vec![0.0; 3 * inputs as usize];
    for (color, input) in [(0, 0), (1, features + 3), (2, 2 * features + 3), (2, features + 2)] {
        weights[(inputs * color + input) as usize] = 1.0;
    }
    let scene = Scene {
        frame: Frame {
            model_from_dataset: Similarity::IDENTITY,
            up: UpAxis::Z,
            meters_per_unit: None,
            near: 0.5,
            far: 10.0,
            background: BACKGROUND.map(|c| c as f32),
            color_space: ColorSpace::Srgb,
        },
        bounds: Aabb { min: DVec3::splat(-0.75), max: DVec3::splat(0.75) },
        rules: Rules {
            coverage: Coverage::All,
            aggregation: Aggregation::Normalized,
            density_reduction: Reduction::Sum,
            appearance_reduction: Reduction::Mean,
            density_shift: 0.0,
            distance_scale: 2.0,
            step: 0.5,
            min_transmittance: 1e-3,
            min_weight,
            contraction: None,
            sky: None,
        },
        scales: vec![scale([0.0, 8.0]), scale([2.0, 2.0])],
        decoder: Decoder {
            mode,
            feature_frequencies: 1,
            direction_frequencies: 1,
            layers: vec![Linear { inputs, outputs: 3, weights, bias: vec![0.0; 3] }],
        },
        occupancy: None,
        provenance: Provenance::default(),
        memory: MemoryLimit::NONE,
    };
    scene.check().unwrap();
    scene
}

const RAY: Ray = Ray { origin: DVec3::new(0.0, 0.0, -3.0), direction: DVec3::Z };

fn traced(scene: &Scene) -> Trace {
    ReferenceRenderer::new(scene).trace_one(&RAY)
}

/// `weight` of the decoder's color of the feature `f`, with ⅛ of the background.
fn pixel(weight: f64, f: f64) -> [f64; 3] {
    let color = decoded(f).map(sigmoid);
    [0, 1, 2].map(|i| weight * color[i] + 0.125 * BACKGROUND[i])
}

/// The decoder's output for the feature `f`.
fn decoded(f: f64) -> [f64; 3] {
    [f, f.sin(), f.cos() + 1.0]
}

fn difference(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max)
}

#[test]
fn a_ray_is_decoded_once_on_the_weighted_mean_of_its_features() {
    // The last sample weighs too little for a color: it counts in T alone.
    let found = traced(&scene(DecoderMode::PerRay, 0.2)).color;
    let sum = 0.5 * 1.5 + 0.25 * 2.5;
    assert!(difference(found, pixel(0.75, sum / 0.75)) < 1e-15, "{found:?}");

    let planted = [
        ("features that are not divided by the sum of weights", pixel(0.75, sum)),
        ("features divided by the opacity", pixel(0.75, sum / 0.875)),
        ("a color that weighs as much as the ray is opaque", pixel(0.875, sum / 0.75)),
        ("a color that is not weighted", pixel(1.0, sum / 0.75)),
        ("the uncolored sample's features", pixel(0.75, (sum + 0.125 * 3.5) / 0.875)),
    ];
    for (what, wrong) in planted {
        assert!(difference(found, wrong) > 1e-2, "{what} would go unnoticed");
    }
    let per_sample = traced(&scene(DecoderMode::PerSample, 0.2)).color;
    let two_calls = [0, 1, 2].map(|i| pixel(0.5, 1.5)[i] + pixel(0.25, 2.5)[i] - 0.125 * BACKGROUND[i]);
    assert!(difference(per_sample, two_calls) < 1e-15 && difference(per_sample, found) > 1e-3);
}

#[test]
fn samples_add_colors_of_their_own_to_their_ray_s_before_the_sigmoid() {
    let found = traced(&scene(DecoderMode::Residual, 0.2)).color;
    let mean = (0.5 * 1.5 + 0.25 * 2.5) / 0.75;
    let expected = |color: &dyn Fn(f64, usize) -> f64| {
        [0, 1, 2].map(|i| 0.5 * color(1.5, i) + 0.25 * color(2.5, i) + 0.125 * BACKGROUND[i])
    };
    let right = expected(&|f, i| sigmoid(OWN[i] * f + decoded(mean)[i]));
    assert!(difference(found, right) < 1e-15, "{found:?}, expected {right:?}");

    let planted = [
        ("the ray's color alone", expected(&|_, i| sigmoid(decoded(mean)[i]))),
        ("colors added after the sigmoid", expected(&|f, i| sigmoid(OWN[i] * f) + sigmoid(decoded(mean)[i]))),
        ("the ray's own color", expected(&|_, i| sigmoid(OWN[i] * mean + decoded(mean)[i]))),
        ("a decoder call a sample", expected(&|f, i| sigmoid(OWN[i] * f + decoded(f)[i]))),
    ];
    for (what, wrong) in planted {
        assert!(difference(found, wrong) > 2e-3, "{what} would go unnoticed ({:e})", difference(found, wrong));
    }
}

#[test]
fn a_ray_with_one_colored_sample_has_that_sample_s_color() {
    let [once, each] = [DecoderMode::PerRay, DecoderMode::PerSample].map(|mode| traced(&scene(mode, 0.3)).color);
    assert_eq!(once, each);
    assert!(difference(once, pixel(0.5, 1.5)) < 1e-15);
}

#[test]
fn a_ray_without_colored_samples_shows_what_is_left_of_the_background() {
    for mode in DecoderMode::ALL {
        let trace = traced(&scene(mode, 0.6));
        assert!(difference(trace.color, BACKGROUND.map(|c| 0.125 * c)) < 1e-15, "{trace:?}");
        assert!((trace.opacity - 0.875).abs() < 1e-15);
    }
}

/// The shaded samples, and their margins to the threshold, do not depend on the decoder's mode.
#[test]
fn the_mode_changes_colors_alone() {
    let [mut once, mut each] = [scenes::scene(&scenes::config()), scenes::scene(&scenes::config())];
    once.decoder.mode = DecoderMode::PerRay;
    each.decoder.mode = DecoderMode::PerSample;
    let camera = scenes::camera(16, 0.7);
    let (mut colored, mut same) = (0, 0);
    for (column, row) in (0..16).flat_map(|row| (0..16).map(move |column| (column, row))) {
        let ray = camera.ray(column, row).unwrap();
        let [a, b] = [&once, &each].map(|scene| ReferenceRenderer::new(scene).trace_one(&ray));
        assert_eq!((a.opacity, a.depth, a.margin), (b.opacity, b.depth, b.margin));
        colored += usize::from(a.opacity > 0.1);
        same += usize::from(a.opacity > 0.1 && difference(a.color, b.color) < 1e-6);
    }
    assert!(colored > 50 && same < colored / 10, "{same} of {colored}");
}

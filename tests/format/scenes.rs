//! Small scenes, made by hand.

use glam::{DQuat, DVec3, UVec3};
use strivec_format::container::{
    Metadata, Pose, Prefix, Probe, Probes, Quality, Thumbnail, ThumbnailFormat, TrainingCamera, Views,
};
use strivec_format::geometry::{Aabb, Distortion, Lattice, Lens, Projection, Similarity};
use strivec_format::model::{
    Aggregation, AppearanceMatrix, Block, ColorSpace, Coverage, Decoder, DecoderMode, Factors, Form, Frame, Linear,
    MemoryLimit, Occupancy, Placement, Provenance, Reduction, Rules, Scale, Scene, TensorCloud, UpAxis,
};

/// Numbers between −1 and 1 that half precision does not hold.
pub(crate) struct Numbers(pub(crate) u32);

impl Numbers {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    pub(crate) fn take(&mut self, count: usize) -> Vec<f32> {
        (0..count).map(|_| self.next()).collect()
    }
}

/// A coarse scale on a lattice and a fine one of explicit centers, with an occupancy; about 2 KB as a file.
pub(crate) fn two_scales() -> Scene {
    let mut numbers = Numbers(1);
    let cells = [[2, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 3]].map(UVec3::from_array).to_vec();
    let lattice = Lattice { origin: DVec3::new(-0.6, -0.5, -0.4), pitch: DVec3::new(0.4, 0.3, 0.2) };
    let coarse = Placement::Lattice { lattice, cells };
    let fine = Placement::Explicit { centers: vec![DVec3::new(0.1, 0.2, -0.3), DVec3::new(-0.1, 0.2, 0.3)] };
    let mut scales = vec![
        scale(&mut numbers, coarse, DVec3::new(0.3, 0.25, 0.2), [2, 3, 1], [2, 3]),
        scale(&mut numbers, fine, DVec3::splat(0.15), [1, 1, 1], [1, 2]),
    ];
    // Values that comparisons with == would miss.
    scales[0].factors.density[0].values[3] = -0.0;
    let mut occupancy = Occupancy::empty(bounds(), UVec3::new(3, 4, 5));
    for vertex in [[0, 0, 0], [2, 3, 4], [1, 2, 3]] {
        occupancy.set(UVec3::from_array(vertex));
    }
    Scene {
        frame: Frame {
            model_from_dataset: Similarity {
                scale: 2.5,
                rotation: DQuat::from_xyzw(0.5, -0.5, 0.5, 0.5),
                translation: DVec3::new(1.0, -2.0, 3.0),
            },
            up: UpAxis::Z,
            meters_per_unit: Some(0.1),
            near: 2.0,
            far: 6.0,
            background: [1.0, 0.5, 0.25],
            color_space: ColorSpace::Srgb,
        },
        bounds: bounds(),
        rules: Rules {
            coverage: Coverage::All,
            aggregation: Aggregation::Normalized,
            density_reduction: Reduction::Sum,
            appearance_reduction: Reduction::Mean,
            density_shift: -10.0,
            distance_scale: 25.0,
            step: 0.005,
            min_transmittance: 1e-3,
            min_weight: 1e-4,
            contraction: None,
            sky: None,
        },
        scales,
        decoder: Decoder {
            mode: DecoderMode::PerRay,
            feature_frequencies: 1,
            direction_frequencies: 0,
            layers: vec![linear(&mut numbers, 9, 4), linear(&mut numbers, 4, 3)],
        },
        occupancy: Some(occupancy),
        memory: MemoryLimit::NONE,
        provenance: Provenance {
            dataset: "lego".into(),
            preset: "48 – künstlich".into(),
            steps: 30_000,
            seed: 7,
            tool: "strivec 0.1.0".into(),
        },
    }
}

/// As little as a scene can be: one scale, one tensor, no occupancy, no provenance.
pub(crate) fn smallest() -> Scene {
    let mut numbers = Numbers(2);
    let lattice = Lattice { origin: DVec3::splat(-0.5), pitch: DVec3::ONE };
    let placement = Placement::Lattice { lattice, cells: vec![UVec3::ZERO] };
    let mut scene = two_scales();
    scene.scales = vec![scale(&mut numbers, placement, DVec3::splat(0.75), [1, 1, 1], [1, 1])];
    scene.frame.model_from_dataset = Similarity::IDENTITY;
    scene.frame.meters_per_unit = None;
    scene.occupancy = None;
    scene.provenance = Provenance::default();
    scene
}

fn bounds() -> Aabb {
    Aabb { min: DVec3::new(-1.0, -0.9, -0.8), max: DVec3::new(1.0, 1.1, 1.2) }
}

fn linear(numbers: &mut Numbers, inputs: u32, outputs: u32) -> Linear {
    Linear { inputs, outputs, weights: numbers.take((inputs * outputs) as usize), bias: numbers.take(outputs as usize) }
}

/// A scale with random factors of these density and appearance ranks, for 2 features.
pub(crate) fn scale(
    numbers: &mut Numbers,
    placement: Placement,
    half_edge: DVec3,
    resolution: [u32; 3],
    ranks: [u32; 2],
) -> Scale {
    let cloud = TensorCloud { placement, half_edge, resolution };
    let rows = cloud.len() * Form::Cp.rows(resolution);
    let factors = Factors {
        density: vec![Block::cp(ranks[0], numbers.take(rows * ranks[0] as usize))],
        appearance: vec![Block::cp(ranks[1], numbers.take(rows * ranks[1] as usize))],
    };
    let matrix = AppearanceMatrix { features: 2, rank: ranks[1], weights: numbers.take(2 * ranks[1] as usize) };
    Scale { cloud, top_k: 4, factors, appearance_matrix: matrix }
}

/// Something of everything that a file with [`two_scales`] may hold besides.
pub(crate) fn metadata() -> Metadata {
    let mut numbers = Numbers(4);
    let pose = |z: f64| Pose { position: DVec3::new(1.0, -2.0, z), rotation: DQuat::from_xyzw(0.5, 0.5, -0.5, 0.5) };
    let probe = |n: f64| Probe {
        origin: [n, 0.5, -4.0],
        direction: [0.0, 0.6, 0.8],
        color: [0.25, n / 8.0, 1.0],
        opacity: 0.75,
        depth: 3.5,
        point: [0.1, 0.2, 0.3],
        density_feature: -2.5,
        margin: 1e-4,
        reserved: [0; 2],
    };
    Metadata {
        license: Some("CC-BY-4.0, © somebody".into()),
        quality: Some(Quality {
            encoded: Some(54.5),
            test: None,
            test_before: Some(33.25),
            prefixes: vec![Some(21.5), None],
            dataset: "every tenth test view".into(),
        }),
        views: Some(Views {
            angle_of_view: 0.7,
            first: pose(4.0),
            center: DVec3::new(0.0, 0.25, 0.0),
            seconds: 12.0,
            is_closed: true,
            path: vec![pose(4.0), pose(5.0), pose(6.0)],
        }),
        thumbnail: Some(Thumbnail { format: ThumbnailFormat::Jpeg, size: [64, 48], file: b"not a picture".to_vec() }),
        prefixes: vec![Some(Prefix { gain: 1.25, offset: 0.5, features: 2, matrices: vec![numbers.take(6)] }), None],
        probes: Some(Probes {
            color_tolerance: 2e-4,
            depth_tolerance: 1e-3,
            density_tolerance: 1e-4,
            probes: vec![probe(0.0), probe(1.0)],
        }),
        cameras: [(Projection::Perspective, [-0.3, 0.1, 0.0, 0.0]), (Projection::Fisheye, [0.0; 4])]
            .map(|(projection, radial)| TrainingCamera {
                pose: pose(7.0),
                focal: [100.0, 101.0],
                principal: [32.0, 24.5],
                size: [64, 48],
                lens: Lens {
                    projection,
                    distortion: Distortion::new(radial, [0.02, 0.0, -0.01], [1e-3, 2e-3], [5e-4, -5e-4]).unwrap(),
                },
            })
            .to_vec(),
        notes: [("author", "somebody"), ("place", "Zürich")].map(|(k, v)| (k.into(), v.into())).into(),
        unknown: Vec::new(),
        skipped: Vec::new(),
    }
}

//! Small random scenes for tests: every rule in use, anisotropic tensors, partly opaque.
#![allow(dead_code, reason = "each test uses a part")]

use glam::{DQuat, DVec3, UVec3};
use strivec_format::container::{Pose, TrainingCamera};
use strivec_format::geometry::{Aabb, Camera, Contraction, Distortion, Lattice, Lens, Projection, Similarity};
use strivec_format::model::{
    Aggregation, ColorSpace, Coverage, DecoderMode, FactorKind, Frame, Occupancy, Placement, Reduction, Rules, Scene,
    Sky, TensorCloud, UpAxis,
};
use strivec_format::random::Random;
use strivec_train::{
    DecoderConfig, FinishConfig, LeanConfig, OptimizerConfig, SamplingConfig, ScaleConfig, ScheduleConfig, TrainConfig,
    initial_scene,
};

/// A configuration of two or three scales with small, anisotropic tensors.
pub(crate) fn config() -> TrainConfig {
    let scale = |pitch: [f64; 3], resolution, density_rank, appearance_rank, top_k| ScaleConfig {
        whole_scene: false,
        pitch,
        edge: pitch.map(|p| 1.5 * p),
        resolutions: vec![resolution],
        factors: FactorKind::Cp,
        density_rank,
        appearance_rank,
        top_k,
    };
    let base = TrainConfig::preset("48").unwrap();
    TrainConfig {
        seed: 5,
        schedule: ScheduleConfig { steps: 10, upsample_at: vec![], occupancy_at: vec![], ..base.schedule },
        sampling: SamplingConfig { batch_rays: 64, ..base.sampling },
        optimizer: OptimizerConfig { factor_deviation: 0.5, ..base.optimizer },
        model: Rules { density_shift: -2.0, distance_scale: 6.0, ..base.model },
        decoder: DecoderConfig { features: 5, hidden: vec![16, 12], ..DecoderConfig::default() },
        // All components stay, and the march.
        lean: LeanConfig::off(),
        finish: FinishConfig::off(),
        // Ranks below, at and above the kernels' width.
        scales: vec![
            scale([0.5, 0.4, 0.45], [6, 5, 7], 9, 5, 4),
            scale([0.25, 0.25, 0.2], [4, 6, 3], 8, 8, 3),
            scale([0.2, 0.16, 0.2], [3, 2, 5], 3, 17, 4),
        ],
        ..base
    }
}

/// `config` with these kinds of factors, and two density components in the last scale: of three blocks, one is missing.
pub(crate) fn with_kinds(mut config: TrainConfig, kinds: &[FactorKind]) -> TrainConfig {
    config.scales.iter_mut().zip(kinds).for_each(|(scale, &kind)| scale.factors = kind);
    if let Some(last) = config.scales.last_mut() {
        last.density_rank = 2;
    }
    config
}

/// A scene of `config`: a ball of radius 0.7 around the origin, on lattices that do not line up with it.
pub(crate) fn scene(config: &TrainConfig) -> Scene {
    let clouds = (config.scales.iter())
        .map(|scale| {
            let pitch = DVec3::from_array(scale.pitch);
            let lattice = Lattice { origin: DVec3::new(-1.03, -1.01, -0.99), pitch };
            let cells = (2.2 / pitch).ceil().as_uvec3();
            let mut occupied = Vec::new();
            for z in 0..cells.z {
                for y in 0..cells.y {
                    for x in 0..cells.x {
                        let cell = UVec3::new(x, y, z);
                        if lattice.center(cell.as_ivec3()).length() < 0.7 {
                            occupied.push(cell);
                        }
                    }
                }
            }
            TensorCloud {
                placement: Placement::Lattice { lattice, cells: occupied },
                half_edge: 0.5 * DVec3::from_array(scale.edge),
                resolution: scale.resolutions[0],
            }
        })
        .collect();
    let frame = Frame {
        model_from_dataset: Similarity::IDENTITY,
        up: UpAxis::Z,
        meters_per_unit: None,
        near: 0.5,
        far: 6.0,
        background: [1.0, 0.9, 0.2],
        color_space: ColorSpace::Srgb,
    };
    let scene = initial_scene(config, clouds, frame, "test").expect("the scales overlap");
    scene.check().expect("a sound scene");
    scene
}

/// A camera that sees all of it.
pub(crate) fn camera(size: u32, angle: f64) -> Camera {
    let position = 3.0 * DVec3::new(angle.cos(), angle.sin(), 0.4);
    Camera::looking_at([size, size], 1.6 * f64::from(size), position, DVec3::ZERO, DVec3::Z)
}

/// The camera of a photograph of it.
pub(crate) fn training_camera() -> TrainingCamera {
    let Camera { world_from_camera, position, focal, principal, width, height, .. } = camera(64, 0.4);
    let pose = Pose { position, rotation: DQuat::from_mat3(&world_from_camera) };
    TrainingCamera { pose, focal, principal, size: [width, height], lens: Lens::PINHOLE }
}

/// A camera whose lens bends rays so much that its picture ends within 0.3 focal lengths of the middle.
pub(crate) fn bent_camera(size: u32) -> Camera {
    let distortion = Distortion::new([-1.646, 0.0, 0.0, 0.0], [0.0; 3], [1e-3, 0.0], [0.0; 2]).unwrap();
    Camera { lens: Lens { projection: Projection::Perspective, distortion }, ..camera(size, 1.0) }
}

/// Every combination of rules, with an occupancy that cuts through the model, half of them with skies of all degrees;
/// then the first of each decoder mode, contracted, two of them with a sky; and at last scenes whose components have matrices.
pub(crate) fn rule_cases() -> Vec<(String, Scene)> {
    let mut cases = Vec::new();
    for (bits, mode) in (0..16).flat_map(|bits| DecoderMode::ALL.map(|mode| (bits, mode))) {
        let mut config = self::config();
        let reduction = |mean| if mean { Reduction::Mean } else { Reduction::Sum };
        config.model.coverage = if bits & 1 == 0 { Coverage::All } else { Coverage::Any };
        config.model.aggregation = if bits & 2 == 0 { Aggregation::Normalized } else { Aggregation::Clamped };
        config.model.density_reduction = reduction(bits & 4 != 0);
        config.model.appearance_reduction = reduction(bits & 8 != 0);
        config.decoder.mode = mode;
        config.optimizer.factor_deviation = 0.8;
        let mut scene = self::scene(&config);
        // Away from the tensors' faces, on which every ray's first sample would lie.
        scene.bounds = scene.bounds.grown(DVec3::splat(0.0123));
        scene.occupancy = Some(sliced(scene.bounds.grown(DVec3::splat(0.0345))));
        // With every rule and without it.
        scene.rules.sky = (u32::count_ones(bits) % 2 == 1).then(|| sky(1 + bits / 2 % Sky::MAX_DEGREE));
        scene.check().unwrap();
        let degree = scene.rules.sky.as_ref().map_or(0, |sky| sky.degree);
        cases.push((format!("{:?}, {:?}, sky of degree {degree}", config.model, scene.decoder.mode), scene));
    }
    for n in 0..DecoderMode::ALL.len() {
        let mut scene = cases[n].1.clone();
        if n == 0 {
            scene.occupancy = None;
        } else {
            scene.rules.sky = Some(sky(2 * n as u32));
        }
        let degree = scene.rules.sky.as_ref().map_or(0, |sky| sky.degree);
        cases.push((format!("contracted, {:?}, sky of degree {degree}", scene.decoder.mode), contracted(scene)));
    }
    for n in 0..DecoderMode::ALL.len() {
        // The GPU's test takes every third case.
        let mut scene = cases[n].1.clone();
        write_zero_components(&mut scene);
        cases.push((format!("some components of tensors are zeros, {:?}", scene.decoder.mode), scene));
    }
    for (n, kinds) in [[FactorKind::Vm; 3], [FactorKind::Cp, FactorKind::Vm, FactorKind::Vm]].into_iter().enumerate() {
        let mut config = with_kinds(self::config(), &kinds);
        config.optimizer.factor_deviation = 0.8;
        if n == 1 {
            config.model.coverage = Coverage::Any;
            (config.model.density_reduction, config.model.appearance_reduction) = (Reduction::Mean, Reduction::Mean);
            config.decoder.mode = DecoderMode::Residual;
        }
        let mut scene = self::scene(&config);
        scene.bounds = scene.bounds.grown(DVec3::splat(0.0123));
        if n == 1 {
            write_zero_components(&mut scene);
        }
        cases.push((format!("{kinds:?}"), scene));
    }
    cases
}

/// Writes zeros over components of tensors: of every sixth tensor over all, of the others over the last ones, and of half
/// of them over one component that is not the last.
pub(crate) fn write_zero_components(scene: &mut Scene) {
    let random = Random::new(3, "zero components");
    for (s, scale) in scene.scales.iter_mut().enumerate() {
        for (b, block) in scale.factors.blocks_mut().enumerate() {
            let (rank, random) = (block.rank as usize, random.substream(2 * s as u64 + b as u64));
            let len = block.tensor_len(scale.cloud.resolution);
            for (n, tensor) in block.values.chunks_exact_mut(len).enumerate() {
                let bits = random.bits(n as u64);
                let kept = if bits % 6 == 0 { 0 } else { 1 + (bits >> 8) as usize % rank };
                let hole = (bits & 1 << 7 == 0).then_some((bits >> 40) as usize % rank);
                for row in tensor.chunks_exact_mut(rank) {
                    row[kept..].fill(0.0);
                    hole.into_iter().for_each(|hole| row[hole] = 0.0);
                }
            }
        }
    }
}

/// A sky of this degree whose colors depend strongly on the direction.
pub(crate) fn sky(degree: u32) -> Sky {
    let random = Random::new(u64::from(degree), "sky of a test");
    let draw = |k| (1.5 * random.normal(k)) as f32;
    Sky { degree, coefficients: (0..3 * Sky::terms(degree) as u64).map(draw).collect() }
}

/// `scene` at twice its size in contracted space: the ball reaches through the faces of the inner cube.
pub(crate) fn contracted(mut scene: Scene) -> Scene {
    for scale in &mut scene.scales {
        scale.cloud.half_edge *= 2.0;
        let Placement::Lattice { lattice, .. } = &mut scale.cloud.placement else { unreachable!("made on a lattice") };
        lattice.origin *= 2.0;
        lattice.pitch *= 2.0;
    }
    let contraction = Contraction { shell: 0.4 };
    scene.bounds = contraction.bounds();
    scene.rules.contraction = Some(contraction);
    if scene.occupancy.is_some() {
        scene.occupancy = Some(sliced(scene.bounds.grown(DVec3::splat(0.0345))));
    }
    (scene.frame.near, scene.frame.far) = (0.3, 1e4);
    scene.check().expect("a sound scene");
    scene
}

pub(crate) fn sliced(bounds: Aabb) -> Occupancy {
    let mut occupancy = Occupancy::empty(bounds, UVec3::new(20, 21, 19));
    for z in 0..19 {
        for y in 0..21 {
            for x in (0..20).filter(|x| (x + y + z) % 7 < 5) {
                occupancy.set(UVec3::new(x, y, z));
            }
        }
    }
    occupancy
}

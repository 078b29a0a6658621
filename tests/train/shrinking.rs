//! Shrinking of trained scenes.

use crate::scenes;

use glam::UVec3;
use strivec_capture::dataset::{Photograph, Pixels};
use strivec_field::render::{CpuRenderer, Renderer};
use strivec_format::geometry::Ray;
use strivec_format::model::{Block, Form, Occupancy, Scale, Scene};
use strivec_format::psnr::psnr_of_mse;
use strivec_format::random::Random;
use strivec_train::{Cell, CellMap};
use strivec_train::{
    Checkpoint, FinishConfig, RayBatch, ShrinkGoal, Target, TrainConfig, TrainError, Trainer, Tuning, compacted,
    shrink, upsample,
};

/// As presets have it: a density feature of 0 is empty.
fn config() -> TrainConfig {
    let mut config = scenes::config();
    config.sampling.batch_rays = 256;
    config.scales.truncate(2);
    config
}

/// A scene of many colors.
fn colorful() -> Scene {
    let mut scene = scenes::scene(&config());
    for scale in &mut scene.scales {
        scale.appearance_matrix.weights.iter_mut().for_each(|w| *w *= 40.0);
    }
    scene
}

/// Photographs of `scene`.
fn views(scene: &Scene) -> Vec<Photograph> {
    let renderer = CpuRenderer::unlimited(scene);
    let view = |i: u32| {
        let camera = scenes::camera(24, f64::from(i));
        let pixels = renderer.render(&camera).pixels;
        Photograph::new(i.to_string(), camera, Pixels::opaque(pixels.iter().map(|p| p.color)))
    };
    (0..6).map(view).collect()
}

/// `scene` with `more` density and appearance components in each tensor whose numbers are 0.02 in magnitude: they
/// change no feature by more than 1e-5 each.
fn with_idle_components(scene: &Scene, more: usize) -> Scene {
    let mut scene = scene.clone();
    let idle = |n: usize| if n.is_multiple_of(3) { 0.02 } else { -0.02 };
    let widened = |values: &[f32], rank: usize| -> Vec<f32> {
        values
            .chunks_exact(rank)
            .enumerate()
            .flat_map(|(n, row)| (0..more).map(move |i| idle(n + i)).chain(row.iter().copied()))
            .collect()
    };
    for scale in &mut scene.scales {
        let factors = &mut scale.factors;
        for block in factors.blocks_mut() {
            block.values = widened(&block.values, block.rank as usize);
            block.rank += more as u32;
        }
        let matrix = &mut scale.appearance_matrix;
        matrix.weights = matrix
            .weights
            .chunks_exact(matrix.rank as usize)
            .flat_map(|row| std::iter::repeat_n(0.3, more).chain(row.iter().copied()))
            .collect();
        matrix.rank += more as u32;
    }
    scene.check().unwrap();
    scene
}

/// A shrunk scene.
struct Shrunk {
    scene: Scene,
    /// Before and after.
    parameters: [u64; 2],
    psnr: [f64; 2],
}

/// `config` with learning rates that hardly change a trained scene.
fn gentle() -> TrainConfig {
    let mut config = config();
    config.optimizer.factor_learning_rate = 4e-5;
    config.optimizer.network_learning_rate = 4e-5;
    config
}

/// `views` with noise: exact photographs have an endless PSNR.
fn noisy(views: &[Photograph]) -> Vec<Photograph> {
    let of_view = |(v, view): (u64, &Photograph)| {
        let noise = Random::new(v, "noise");
        let colors = (0..).zip(view.pixels.colors([0.0; 3])).map(|(n, color): (u64, [f32; 3])| {
            [0, 1, 2].map(|c| (color[c] + 0.1 * (noise.uniform(3 * n + c as u64) as f32 - 0.5)).clamp(0.0, 1.0))
        });
        Photograph { pixels: Pixels::opaque(colors), ..view.clone() }
    };
    (0..).zip(views).map(of_view).collect()
}

fn shrunk(scene: &Scene, views: &[Photograph], goal: ShrinkGoal, tuning: &Tuning) -> Shrunk {
    let mut trainer = shrink(scene.clone(), views, goal, tuning).unwrap();
    let before = trainer.psnr_of(scene);
    (0..tuning.steps).for_each(|_| drop(trainer.step().unwrap()));
    let small = compacted(&trainer).unwrap();
    small.check().unwrap();
    let parameters = [scene, &small].map(Scene::nonzero_parameter_count);
    Shrunk { parameters, psnr: [before, trainer.psnr_of(&small)], scene: small }
}

/// PSNR of `scene` on `views`, in dB.
fn psnr(scene: &Scene, views: &[Photograph]) -> f64 {
    let renderer = CpuRenderer::unlimited(scene);
    let error = |view: &Photograph| {
        let photograph = view.pixels.colors(scene.frame.background);
        let pairs = renderer.render(&view.camera).pixels.into_iter().zip(photograph);
        pairs.flat_map(|(p, q)| (0..3).map(move |c| f64::from(p.color[c] - q[c]).powi(2))).sum::<f64>()
    };
    let pixels: usize = views.iter().map(|view| view.pixels.len()).sum();
    psnr_of_mse(views.iter().map(error).sum::<f64>() / (3 * pixels) as f64)
}

fn ranks(scale: &Scale) -> [u32; 2] {
    [scale.factors.density_rank(), scale.factors.appearance_rank()]
}

/// Parameters of the appearance matrices.
fn matrix_parameters(scene: &Scene) -> u64 {
    scene.scales.iter().map(|s| s.appearance_matrix.weights.len() as u64).sum()
}

#[test]
fn what_does_nothing_goes_first() {
    let scene = colorful();
    let views = views(&scene);
    let wide = with_idle_components(&scene, 3);
    // Until the end, the appearance matrices keep the columns of what was given up.
    let most = scene.nonzero_parameter_count() - matrix_parameters(&scene) + matrix_parameters(&wide);
    let tuning = Tuning { steps: 40, config: gentle() };
    let small = shrunk(&wide, &views, ShrinkGoal::Parameters(most), &tuning);
    println!("{:?} parameters, {:?} dB", small.parameters, small.psnr);
    assert!(small.parameters[1] <= most && small.psnr[0] > 60.0 && small.psnr[1] > 55.0);
    for (small, scale) in small.scene.scales.iter().zip(&scene.scales) {
        let [before, after] = [scale, small].map(ranks);
        assert!((0..2).all(|part| after[part] <= before[part]), "no more ranks than are of use: {after:?}");
    }

    // Removing half of the useful components costs PSNR, so the comparison is sensitive.
    let half = shrunk(&scene, &views, ShrinkGoal::Parameters(scene.nonzero_parameter_count() / 2), &tuning);
    assert!(half.psnr[1] < 45.0, "{:?}", half.psnr);
}

#[test]
fn training_gives_up_what_does_nothing() {
    let scene = colorful();
    let views = views(&scene);
    let wide = with_idle_components(&scene, 3);
    let lean = |most: u64| {
        let mut config = config();
        (config.schedule.steps, config.optimizer.factor_learning_rate, config.optimizer.network_learning_rate) =
            (40, 1e-5, 1e-5);
        config.lean.max_parameters = Some(most);
        for (settings, scale) in config.scales.iter_mut().zip(&wide.scales) {
            settings.resolutions = vec![scale.cloud.resolution];
        }
        let mut trainer = Trainer::new(config, wide.clone(), &views).unwrap();
        (0..40).for_each(|_| drop(trainer.step().unwrap()));
        let lean = trainer.scene();
        lean.check().unwrap();
        for scale in &lean.scales {
            // A tensor has the first components of the scale's order.
            let block = &scale.factors.appearance[0];
            let (rank, nonzero) = (block.rank as usize, block.nonzero_components(scale.cloud.resolution));
            assert!(nonzero.chunks_exact(rank).all(|of_tensor| of_tensor.is_sorted_by(|a, b| a >= b)));
        }
        (lean.nonzero_parameter_count(), psnr(&lean, &views))
    };
    // The appearance matrices keep the columns of what was given up.
    let most = scene.nonzero_parameter_count() + matrix_parameters(&wide);
    let (parameters, psnr) = lean(most);
    println!("{parameters} of {} parameters, {psnr} dB", wide.nonzero_parameter_count());
    assert!(parameters <= most && psnr > 60.0);

    // Half of the useful ones cost PSNR, so the comparison is sensitive.
    let (parameters, psnr) = lean(most / 2);
    println!("{parameters} parameters, {psnr} dB");
    assert!(parameters <= most / 2 && psnr < 55.0);
}

#[test]
fn training_makes_up_for_what_was_given_up() {
    let scene = colorful();
    let views = views(&scene);
    let most = scene.nonzero_parameter_count() * 2 / 3;
    let tuning = Tuning { steps: 120, config: config() };
    let mut trainer = shrink(scene.clone(), &views, ShrinkGoal::Parameters(most), &tuning).unwrap();
    // The rounds end after 0.6 of the steps.
    (0..72).for_each(|_| drop(trainer.step().unwrap()));
    let at_once = trainer.psnr();
    assert!(trainer.scene().nonzero_parameter_count() <= most);
    (72..120).for_each(|_| drop(trainer.step().unwrap()));
    let small = compacted(&trainer).unwrap();
    println!("{at_once} dB, then {} dB", trainer.psnr());
    assert!(trainer.psnr() > at_once + 1.0);
    assert_eq!(small.provenance.steps, scene.provenance.steps + 120);
    // Training must not restore a removed component by itself.
    let held: usize = (small.scales.iter())
        .map(|s| {
            let resolution = s.cloud.resolution;
            let of = |block: &Block| block.nonzero_components(resolution).iter().filter(|h| **h).count();
            Form::Cp.rows(resolution) * s.factors.blocks().map(of).sum::<usize>()
        })
        .sum();
    let shared = matrix_parameters(&small) + small.decoder.parameter_count();
    assert_eq!(held as u64 + shared, small.nonzero_parameter_count());
    assert!(small.nonzero_parameter_count() <= most);
}

#[test]
fn a_loss_is_not_exceeded_and_a_larger_one_leaves_less() {
    let scene = colorful();
    let views = noisy(&views(&scene));
    let wide = with_idle_components(&scene, 4);
    let left = [0.5, 25.0].map(|most| {
        let small = shrunk(&wide, &views, ShrinkGoal::Loss(most), &Tuning { steps: 150, config: gentle() });
        println!("{:?} parameters, {:?} dB", small.parameters, small.psnr);
        assert!(small.psnr[0] > 25.0 && small.psnr[0] - small.psnr[1] < most + 0.1);
        assert!(small.parameters[1] < small.parameters[0]);
        small.parameters[1]
    });
    assert!(left[1] < left[0]);

    assert!(ShrinkGoal::Parameters(u64::MAX).is_met_by(&scene) && !ShrinkGoal::Loss(1.0).is_met_by(&scene));
}

#[test]
fn resolution_goes_where_cells_are_finer_than_what_is_there() {
    let scene = colorful();
    let views = views(&scene);
    let mut fine = scene.clone();
    // Six times as many cells of one scale, interpolated linearly.
    let scale = &mut fine.scales[1];
    let (from, to) = (scale.cloud.resolution, scale.cloud.resolution.map(|d| 6 * d));
    let factors = &mut scale.factors;
    for block in factors.blocks_mut() {
        block.values = upsample(block.form, &block.values, block.rank as usize, from, to);
    }
    scale.cloud.resolution = to;
    fine.check().unwrap();
    let goal = ShrinkGoal::Parameters(fine.nonzero_parameter_count() / 2);
    let small = shrunk(&fine, &views, goal, &Tuning { steps: 120, config: gentle() });
    println!("{:?} parameters, {:?} dB", small.parameters, small.psnr);
    let found = small.scene.scales[1].cloud.resolution;
    assert!((0..3).all(|a| found[a] < to[a]), "{found:?} of {to:?}");
    assert_eq!(small.scene.scales[0].cloud.resolution, scene.scales[0].cloud.resolution, "these cells are needed");
}

#[test]
fn a_shrunk_scene_has_a_faster_march_unless_that_is_off() {
    let scene = colorful();
    let views = noisy(&views(&scene));
    let goal = ShrinkGoal::Parameters(scene.nonzero_parameter_count() * 3 / 4);
    let rules_of = |scene: &Scene, finish: FinishConfig| {
        let tuning = Tuning { steps: 30, config: TrainConfig { finish, ..config() } };
        let rules = shrunk(scene, &views, goal, &tuning).scene.rules;
        [rules.step, rules.min_weight]
    };
    let finish = FinishConfig { min_weight: 7e-4, max_loss: 100.0, ..FinishConfig::default() };
    let before = scene.rules.step;
    let [step, least_weight] = rules_of(&scene, finish.clone());
    assert!(before < step && step <= 1.1 * before, "{before}, {step}");
    assert_eq!(least_weight, 1.4e-3);
    assert_eq!(rules_of(&scene, FinishConfig::off()), [before, scene.rules.min_weight]);
    let mut coarse = scene.clone();
    coarse.rules.step *= 2.0;
    assert_eq!(rules_of(&coarse, finish)[0], coarse.rules.step, "steps longer than that stay");
}

#[test]
fn a_scene_keeps_its_occupancy_if_that_of_the_end_costs_too_much() {
    let mut scene = colorful();
    let mut occupancy = Occupancy::empty(scene.bounds, UVec3::splat(3));
    (0..27).for_each(|n| occupancy.set(UVec3::new(n % 3, n / 3 % 3, n / 9)));
    scene.occupancy = Some(occupancy);
    let views = noisy(&views(&scene));
    let goal = ShrinkGoal::Parameters(scene.nonzero_parameter_count() * 3 / 4);
    let occupancy_with = |max_loss: f64| {
        let finish = FinishConfig { min_transmittance: 0.5, max_loss, ..FinishConfig::default() };
        let tuning = Tuning { steps: 30, config: TrainConfig { finish, ..config() } };
        shrunk(&scene, &views, goal, &tuning).scene.occupancy
    };
    assert_eq!(occupancy_with(1e-6), scene.occupancy);
    assert_ne!(occupancy_with(100.0), scene.occupancy);
}

#[test]
fn threads_and_interruptions_change_nothing() {
    let scene = colorful();
    let views = views(&scene);
    let goal = ShrinkGoal::Parameters(scene.nonzero_parameter_count() * 3 / 4);
    let tuning = Tuning { steps: 30, config: config() };
    let of_threads = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| shrunk(&scene, &views, goal, &tuning)).scene
    };
    let whole = of_threads(1);
    assert!(whole == of_threads(3));

    let goal_of_loss = ShrinkGoal::Loss(20.0);
    for goal in [goal, goal_of_loss] {
        let mut trainer = shrink(scene.clone(), &views, goal, &tuning).unwrap();
        (0..10).for_each(|_| drop(trainer.step().unwrap()));
        let (bytes, halfway) = (trainer.checkpoint().to_bytes(&[]), trainer.scene());
        let mut resumed = Trainer::resume(Checkpoint::from_bytes(&bytes).unwrap().0, halfway, &views).unwrap();
        (10..30).for_each(|_| _ = (trainer.step().unwrap(), resumed.step().unwrap()));
        assert!(trainer.scene() == resumed.scene() && resumed.scene().provenance.steps == scene.provenance.steps + 30);
    }
    assert!(matches!(shrink(scene, &[], goal, &tuning), Err(TrainError::NoRays { .. })));
}

#[test]
fn cells_hold_all_parameters_and_only_where_something_is_seen() {
    let scene = colorful();
    let background = scene.frame.background;
    let rays: Vec<Ray> = (0..3)
        .flat_map(|i| (0..576).map(move |p| scenes::camera(24, f64::from(i)).ray(p % 24, p / 24).unwrap()))
        .collect();
    let targets =
        vec![Target { color: [0.25, 0.5, 0.75], background, view: 0, distance: 0.0, weight: 1.0 }; rays.len()];
    let batch = RayBatch { rays, targets };
    let sum = |map: &CellMap, value: fn(&Cell) -> f64| map.cells.iter().map(value).sum::<f64>();
    let held = |scene: &Scene| {
        let shared: usize = scene.scales.iter().map(|s| s.appearance_matrix.weights.len()).sum();
        (scene.nonzero_parameter_count() - shared as u64 - scene.decoder.parameter_count()) as f64
    };
    let map = CellMap::new(&scene, &scene.bounds, &batch, 16);
    let all = sum(&map, |c| c.parameters) + map.unseen_parameters;
    assert!((all - held(&scene)).abs() < 1e-6 * all, "{all} of {}", held(&scene));
    for cell in &map.cells {
        assert!(cell.parameters == 0.0 || cell.weight > 0.0, "{cell:?}");
        assert!(cell.deviation().is_none_or(|d| d < 1e-6), "all photographs show one color: {cell:?}");
    }
    let opacities: f64 = CpuRenderer::unlimited(&scene).trace(&batch.rays).iter().map(|p| f64::from(p.opacity)).sum();
    let seen = sum(&map, |c| c.weight);
    assert!((seen - opacities).abs() < 0.01 * opacities, "{seen} of {opacities}");
    let front = map.from_the_front(|c| c.weight);
    assert_eq!([front.len(), front[0].len()], [map.size[2], map.size[0]]);
    assert!((front.iter().flatten().sum::<f64>() - seen).abs() < 1e-9 * seen);

    let mut other = scene.clone();
    other.scales[0].factors.appearance[0].values.fill(0.0);
    let fewer = CellMap::new(&other, &scene.bounds, &batch, 16);
    let left = sum(&fewer, |c| c.parameters) + fewer.unseen_parameters;
    assert!(left < all - 1.0 && (left - held(&other)).abs() < 1e-6 * all, "{left}");
}

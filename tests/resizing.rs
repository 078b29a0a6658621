//! Shrinking and growing of trained scenes.
#![cfg(feature = "toolkit")]

mod scenes;

use strivec::dataset::{Pixels, View};
use strivec::geometry::Ray;
use strivec::measure::{Cell, CellMap};
use strivec::model::{Factors, Scale, Scene};
use strivec::psnr::psnr_of_mse;
use strivec::render::{CpuRenderer, Renderer};
use strivec::train::{
    RayBatch, ResizeStep, Resized, ShrinkGoal, Target, TrainConfig, TrainError, Trainer, Tuning, grow, shrink, upsample,
};

/// As presets have it: a density feature of 0 is empty.
fn config() -> TrainConfig {
    let mut config = scenes::config();
    config.batch_rays = 256;
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
fn views(scene: &Scene) -> Vec<View> {
    let renderer = CpuRenderer::new(scene);
    let view = |i: u32| {
        let camera = scenes::camera(24, f64::from(i));
        let pixels = renderer.render(&camera).pixels;
        View::new(i.to_string(), camera, Pixels::opaque(pixels.iter().map(|p| p.color)))
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
        factors.density = widened(&factors.density, factors.density_rank as usize);
        factors.appearance = widened(&factors.appearance, factors.appearance_rank as usize);
        let matrix = &mut scale.appearance_matrix;
        matrix.weights = matrix
            .weights
            .chunks_exact(matrix.rank as usize)
            .flat_map(|row| std::iter::repeat_n(0.3, more).chain(row.iter().copied()))
            .collect();
        factors.density_rank += more as u32;
        factors.appearance_rank += more as u32;
        matrix.rank += more as u32;
    }
    scene.check().unwrap();
    scene
}

fn shrunk(scene: &Scene, views: &[View], goal: ShrinkGoal, steps: u64) -> Resized {
    let tuning = Tuning { steps, config: config() };
    shrink::<TrainError>(scene.clone(), views, goal, &tuning, &mut |_| Ok(())).unwrap()
}

/// PSNR of `scene` on `views`, in dB.
fn psnr(scene: &Scene, views: &[View]) -> f64 {
    let renderer = CpuRenderer::new(scene);
    let error = |view: &View| {
        let photograph = view.pixels.colors(scene.frame.background);
        let pairs = renderer.render(&view.camera).pixels.into_iter().zip(photograph);
        pairs.flat_map(|(p, q)| (0..3).map(move |c| f64::from(p.color[c] - q[c]).powi(2))).sum::<f64>()
    };
    let pixels: usize = views.iter().map(|view| view.pixels.len()).sum();
    psnr_of_mse(views.iter().map(error).sum::<f64>() / (3 * pixels) as f64)
}

fn ranks(scale: &Scale) -> [u32; 2] {
    [scale.factors.density_rank, scale.factors.appearance_rank]
}

#[test]
fn what_does_nothing_goes_first() {
    let scene = colorful();
    let views = views(&scene);
    let wide = with_idle_components(&scene, 3);
    let goal = ShrinkGoal::Parameters(scene.nonzero_parameter_count());
    let small = shrunk(&wide, &views, goal, 2);
    println!("{:?} parameters, {:?} dB, {:?}", small.parameters, small.psnr, small.rounds);
    small.scene.check().unwrap();
    assert_eq!(small.parameters, [wide.nonzero_parameter_count(), small.scene.nonzero_parameter_count()]);
    assert!(small.parameters[1] <= scene.nonzero_parameter_count() && small.psnr[0] > 60.0);
    for round in &small.rounds {
        assert!(round.psnr_at_once > 72.0, "a visible component was removed: {round:?}");
    }
    for (small, scale) in small.scene.scales.iter().zip(&scene.scales) {
        let [before, after] = [scale, small].map(ranks);
        assert!((0..2).all(|part| after[part] <= before[part]), "no more ranks than are of use: {after:?}");
    }

    // Removing half of the useful components costs PSNR at once, so the comparison is sensitive.
    let half = shrunk(&scene, &views, ShrinkGoal::Parameters(scene.nonzero_parameter_count() / 2), 2);
    assert!(half.rounds.last().unwrap().psnr_at_once < 65.0, "{:?}", half.rounds);
}

#[test]
fn training_gives_up_what_does_nothing() {
    let scene = colorful();
    let views = views(&scene);
    let wide = with_idle_components(&scene, 3);
    let lean = |most: u64| {
        let mut config = config();
        (config.steps, config.factor_learning_rate, config.network_learning_rate) = (40, 1e-5, 1e-5);
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
            let rows = Factors::rows(scale.cloud.resolution);
            let rank = scale.factors.appearance_rank as usize;
            let nonzero = Factors::nonzero_components(&scale.factors.appearance, rows, rank);
            assert!(nonzero.chunks_exact(rank).all(|of_tensor| of_tensor.is_sorted_by(|a, b| a >= b)));
        }
        (lean.nonzero_parameter_count(), psnr(&lean, &views))
    };
    // The appearance matrices keep the columns of what was given up.
    let columns: u64 = wide.scales.iter().map(|s| s.appearance_matrix.weights.len() as u64).sum();
    let most = scene.nonzero_parameter_count() + columns;
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
    let small = shrunk(&scene, &views, ShrinkGoal::Parameters(most), 60);
    println!("{:?} parameters, {:?} dB, {:?}", small.parameters, small.psnr, small.rounds);
    assert!(small.parameters[1] <= most);
    let trained = 60 * (small.rounds.len() as u64 + 2);
    assert_eq!(small.scene.provenance.steps, scene.provenance.steps + trained);
    for round in &small.rounds {
        assert!(round.psnr > round.psnr_at_once, "{round:?}");
    }
    // Training must not restore a removed component by itself.
    let shared: u64 = small.scene.scales.iter().map(|s| s.appearance_matrix.weights.len() as u64).sum();
    let held: usize = (small.scene.scales.iter())
        .map(|s| {
            let rows = Factors::rows(s.cloud.resolution);
            let of = |values: &[f32], rank: u32| {
                Factors::nonzero_components(values, rows, rank as usize).iter().filter(|h| **h).count()
            };
            rows * (of(&s.factors.density, s.factors.density_rank)
                + of(&s.factors.appearance, s.factors.appearance_rank))
        })
        .sum();
    assert_eq!(held as u64 + shared + small.scene.decoder.parameter_count(), small.parameters[1]);
}

#[test]
fn a_loss_is_not_exceeded_and_a_small_scene_stays_as_it_is() {
    let scene = colorful();
    let views = views(&scene);
    let wide = with_idle_components(&scene, 4);
    // The photographs are exact, so that even the first steps of training cost much.
    let small = shrunk(&wide, &views, ShrinkGoal::Loss(60.0), 2);
    println!("{:?} parameters, {:?} dB, {:?}", small.parameters, small.psnr, small.rounds);
    assert!(small.psnr[0] - small.psnr[1] <= 60.0 && small.parameters[1] < small.parameters[0]);
    assert!(small.rounds.iter().any(|r| !r.is_taken), "it went on until it was too much");

    let same = shrunk(&scene, &views, ShrinkGoal::Parameters(u64::MAX), 2);
    assert!(same.rounds.is_empty() && same.scene == scene);
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
    factors.density = upsample(&factors.density, factors.density_rank as usize, from, to);
    factors.appearance = upsample(&factors.appearance, factors.appearance_rank as usize, from, to);
    scale.cloud.resolution = to;
    fine.check().unwrap();
    let small = shrunk(&fine, &views, ShrinkGoal::Parameters(fine.nonzero_parameter_count() / 2), 2);
    println!("{:?} parameters, {:?} dB, {:?}", small.parameters, small.psnr, small.rounds);
    let found = small.scene.scales[1].cloud.resolution;
    assert!((0..3).all(|a| found[a] < to[a]), "{found:?} of {to:?}");
    assert_eq!(small.scene.scales[0].cloud.resolution, scene.scales[0].cloud.resolution, "these cells are needed");
}

#[test]
fn a_scene_grows_where_its_error_is() {
    let scene = colorful();
    let views = views(&scene);
    // Half of the tensors, those on one side, are left without components.
    let mut small = scene.clone();
    for scale in &mut small.scales {
        let (tensors, bare): (usize, Vec<bool>) =
            (scale.cloud.len(), scale.cloud.centers().map(|c| c.x < 0.0).collect());
        for values in [&mut scale.factors.density, &mut scale.factors.appearance] {
            let len = values.len() / tensors;
            for (tensor, _) in values.chunks_exact_mut(len).zip(&bare).filter(|(_, bare)| **bare) {
                tensor.fill(0.0);
            }
        }
    }
    let most = scene.nonzero_parameter_count() * 3 / 4;
    let tuning = Tuning { steps: 30, config: config() };
    let grown = grow::<TrainError>(small.clone(), &views, most, &tuning, &mut |_| Ok(())).unwrap();
    println!("{:?} parameters, {:?} dB, {:?}", grown.parameters, grown.psnr, grown.rounds);
    grown.scene.check().unwrap();
    assert!(grown.parameters[0] < grown.parameters[1] && grown.parameters[1] <= most);
    assert!(grown.psnr[1] > grown.psnr[0] + 3.0);
    let first = &grown.rounds[0];
    assert!((first.psnr_at_once - grown.psnr[0]).abs() < 0.01, "new components change nothing at once: {first:?}");
    // The new components are mostly on the side that lacked them.
    let held = |scene: &Scene, is_bare: bool| -> usize {
        let of_scale = |s: &Scale| {
            let rows = Factors::rows(s.cloud.resolution);
            let of = |values: &[f32], rank: u32| {
                let held = Factors::nonzero_components(values, rows, rank as usize);
                let of_tensor = |(n, held): (usize, &[bool])| {
                    if (s.cloud.center(n).x < 0.0) == is_bare { held.iter().filter(|h| **h).count() } else { 0 }
                };
                held.chunks_exact(rank as usize).enumerate().map(of_tensor).sum::<usize>()
            };
            let f = &s.factors;
            rows * (of(&f.density, f.density_rank) + of(&f.appearance, f.appearance_rank))
        };
        scene.scales.iter().map(of_scale).sum()
    };
    let [bare, other] = [true, false].map(|side| held(&grown.scene, side) as i64 - held(&small, side) as i64);
    assert!(2 * bare > 3 * other, "{bare} and {other}");
}

#[test]
fn cells_that_are_too_coarse_become_finer() {
    let scene = colorful();
    let views = views(&scene);
    let mut coarse = scene.clone();
    for scale in &mut coarse.scales {
        let (from, factors) = (scale.cloud.resolution, &mut scale.factors);
        let to = from.map(|cells| cells.div_ceil(2));
        factors.density = upsample(&factors.density, factors.density_rank as usize, from, to);
        factors.appearance = upsample(&factors.appearance, factors.appearance_rank as usize, from, to);
        scale.cloud.resolution = to;
    }
    let tuning = Tuning { steps: 40, config: config() };
    let most = 3 * coarse.nonzero_parameter_count();
    let grown = grow::<TrainError>(coarse.clone(), &views, most, &tuning, &mut |_| Ok(())).unwrap();
    println!("{:?} parameters, {:?} dB, {:?}", grown.parameters, grown.psnr, grown.rounds);
    grown.scene.check().unwrap();
    let is_finer = |n: usize| grown.scene.scales[n].cloud.resolution > coarse.scales[n].cloud.resolution;
    assert!((0..scene.scales.len()).any(is_finer));
    assert!(grown.psnr[1] > grown.psnr[0] + 1.0);
    assert!((grown.rounds[0].psnr_at_once - grown.psnr[0]).abs() < 0.5, "finer cells change little at once");
}

#[test]
fn threads_change_nothing_and_an_interruption_ends_it() {
    let scene = colorful();
    let views = views(&scene);
    let goal = ShrinkGoal::Parameters(scene.nonzero_parameter_count() * 3 / 4);
    let of_threads = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| shrunk(&scene, &views, goal, 3)).scene
    };
    assert!(of_threads(1) == of_threads(3));

    #[derive(Debug)]
    enum Ended {
        Train,
        Here,
    }
    impl From<TrainError> for Ended {
        fn from(_: TrainError) -> Self {
            Self::Train
        }
    }
    let tuning = Tuning { steps: 5, config: config() };
    let mut stop = |step: &ResizeStep| if step.steps[0] == 2 { Err(Ended::Here) } else { Ok(()) };
    assert!(matches!(shrink(scene.clone(), &views, goal, &tuning, &mut stop), Err(Ended::Here)));
    let nowhere: Result<Resized, Ended> = shrink(scene, &[], goal, &tuning, &mut |_| Ok(()));
    assert!(matches!(nowhere, Err(Ended::Train)), "no ray meets the scene");
}

#[test]
fn cells_hold_all_parameters_and_only_where_something_is_seen() {
    let scene = colorful();
    let background = scene.frame.background;
    let rays: Vec<Ray> = (0..3)
        .flat_map(|i| (0..576).map(move |p| scenes::camera(24, f64::from(i)).ray(p % 24, p / 24).unwrap()))
        .collect();
    let targets = vec![Target { color: [0.25, 0.5, 0.75], background, view: 0, distance: 0.0 }; rays.len()];
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
    let opacities: f64 = CpuRenderer::new(&scene).trace(&batch.rays).iter().map(|p| f64::from(p.opacity)).sum();
    let seen = sum(&map, |c| c.weight);
    assert!((seen - opacities).abs() < 0.01 * opacities, "{seen} of {opacities}");
    let front = map.from_the_front(|c| c.weight);
    assert_eq!([front.len(), front[0].len()], [map.size[2], map.size[0]]);
    assert!((front.iter().flatten().sum::<f64>() - seen).abs() < 1e-9 * seen);

    let mut other = scene.clone();
    other.scales[0].factors.appearance.fill(0.0);
    let fewer = CellMap::new(&other, &scene.bounds, &batch, 16);
    let left = sum(&fewer, |c| c.parameters) + fewer.unseen_parameters;
    assert!(left < all - 1.0 && (left - held(&other)).abs() < 1e-6 * all, "{left}");
}

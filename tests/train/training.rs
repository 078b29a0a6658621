//! Training as a whole: it learns, and its results do not depend on threads or interruptions.

use crate::scenes;

use glam::{DMat3, DQuat, DVec3, UVec3};
use strivec_capture::dataset::{Photograph, Pixels};
use strivec_field::Field;
use strivec_field::render::{CpuRenderer, Pixel, Renderer};
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Encoding};
use strivec_format::geometry::Camera;
use strivec_format::model::{FactorKind, Occupancy, Scene};
use strivec_format::psnr::psnr_of_mse;
use strivec_format::random::Random;
use strivec_train::{Checkpoint, Exposure, FinishConfig, LeanConfig, RaySampler, TrainConfig, Trainer};

/// Views of a scene of random tensors.
fn views() -> Vec<Photograph> {
    let mut config = scenes::config();
    config.seed = 77;
    let scene = scenes::scene(&config);
    let renderer = CpuRenderer::unlimited(&scene);
    (0..8)
        .map(|i| {
            let camera = scenes::camera(24, f64::from(i));
            let pixels = Pixels::opaque(renderer.render(&camera).pixels.iter().map(|p| p.color));
            Photograph::new(i.to_string(), camera, pixels)
        })
        .collect()
}

/// About half of the parameters that the scene has at its last resolution.
const HALF: u64 = 20_000;

/// A schedule in which everything happens: two occupancies (the first shrinks the bounds), two upsamplings, fits of the
/// exposures, half of the components given up in five rounds, and other rules in the end.
fn config() -> TrainConfig {
    let mut config = scenes::config();
    config.schedule.steps = 24;
    config.sampling.batch_rays = 200;
    config.schedule.occupancy_at = vec![8, 16];
    config.sampling.refilter_rays = true;
    config.photographs.exposure = Exposure::On;
    config.schedule.upsample_at = vec![8, 12];
    for scale in &mut config.scales {
        let [first] = scale.resolutions[..] else { panic!("one resolution") };
        scale.resolutions = vec![first, first.map(|d| d + 1), first.map(|d| 2 * d)];
    }
    config.lean.max_parameters = Some(HALF);
    (config.lean.during, config.lean.rounds) = ([0.2, 0.9], 5);
    config.finish = FinishConfig { from: 0.5, min_alpha: 0.01, ..FinishConfig::off() };
    config
}

/// The file of `scene`, exactly.
fn file(scene: &Scene) -> Vec<u8> {
    container::encode(scene, &EncodeOptions { zstd_level: Some(1), ..EncodeOptions::uniform(Encoding::F32) }).unwrap()
}

fn trainer(views: &[Photograph]) -> Trainer<'_> {
    let config = config();
    let scene = scenes::scene(&config);
    Trainer::new(config, scene, views).unwrap()
}

fn run_to(trainer: &mut Trainer<'_>, step: u64) {
    while trainer.steps_done() < step {
        trainer.step().unwrap();
    }
}

#[test]
fn one_two_and_three_threads_make_the_same_file() {
    let views = views();
    let files: Vec<Vec<u8>> = [1, 2, 3]
        .into_iter()
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut trainer = trainer(&views);
                run_to(&mut trainer, config().schedule.steps);
                file(&trainer.scene())
            })
        })
        .collect();
    assert!(files[0] == files[1] && files[0] == files[2]);

    let mut shorter = trainer(&views);
    run_to(&mut shorter, config().schedule.steps - 1);
    assert!(files[0] != file(&shorter.scene()), "the comparison sees one step's difference");
}

#[test]
fn a_run_resumed_at_any_point_of_the_schedule_ends_in_the_same_file() {
    let views = views();
    let mut whole = trainer(&views);
    run_to(&mut whole, config().schedule.steps);
    assert!(whole.scene().occupancy.is_some(), "the occupancy is part of what must survive");
    let [all, held] = [whole.scene().parameter_count(), whole.scene().nonzero_parameter_count()];
    println!("{held} of {all} parameters are held");
    assert!(held <= HALF && HALF < all && held > HALF * 9 / 10);
    for stop in [1, 5, 8, 11, 13, 16, 20] {
        let mut first = trainer(&views);
        run_to(&mut first, stop);
        let state = first.checkpoint().to_bytes(&file(&first.scene()));
        drop(first);
        let (checkpoint, scene) = Checkpoint::from_bytes(&state).unwrap();
        let mut second = Trainer::resume(checkpoint, container::decode(&scene).unwrap(), &views).unwrap();
        assert_eq!(second.steps_done(), stop);
        run_to(&mut second, config().schedule.steps);
        assert!(file(&whole.scene()) == file(&second.scene()), "resumed after step {stop}");
    }
}

/// A run whose scene counts on one side only from the start, so that pruning has something to remove.
fn pruning_trainer(views: &[Photograph], prune: bool) -> Trainer<'_> {
    let mut config = TrainConfig { lean: LeanConfig::off(), ..config() };
    config.schedule.prune = prune;
    let mut scene = scenes::scene(&config);
    let mut occupancy = Occupancy::empty(scene.bounds, UVec3::splat(13));
    for z in 0..13 {
        for y in 0..13 {
            (0..5).for_each(|x| occupancy.set(UVec3::new(x, y, z)));
        }
    }
    scene.occupancy = Some(occupancy);
    Trainer::new(config, scene, views).unwrap()
}

#[test]
fn a_run_that_prunes_is_smaller_the_same_on_any_threads_and_goes_on_to_the_same_file() {
    let views = views();
    let on = |threads, prune| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut trainer = pruning_trainer(&views, prune);
            let tensors = |t: &Trainer| t.scene().scales.iter().map(|s| s.cloud.len()).collect::<Vec<_>>();
            let before = tensors(&trainer);
            run_to(&mut trainer, config().schedule.steps);
            (before, tensors(&trainer), file(&trainer.scene()))
        })
    };
    let (before, after, whole) = on(2, true);
    println!("{before:?} tensors become {after:?}");
    assert!(before[1..].iter().zip(&after[1..]).all(|(before, after)| after < before));
    assert!(on(1, true).2 == whole);
    let (_, all, unpruned) = on(2, false);
    assert!(all == before && unpruned.len() > whole.len());
    for stop in [7, 8, 11, 16] {
        let mut first = pruning_trainer(&views, true);
        run_to(&mut first, stop);
        let state = first.checkpoint().to_bytes(&file(&first.scene()));
        drop(first);
        let (checkpoint, scene) = Checkpoint::from_bytes(&state).unwrap();
        let mut second = Trainer::resume(checkpoint, container::decode(&scene).unwrap(), &views).unwrap();
        run_to(&mut second, config().schedule.steps);
        assert!(file(&second.scene()) == whole, "resumed after step {stop}");
    }
}

#[test]
fn clearing_what_is_unused_depends_on_no_thread_and_on_no_interruption() {
    let views = views();
    let on = |threads, resume| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut trainer = pruning_trainer(&views, false);
            run_to(&mut trainer, config().schedule.steps);
            if resume {
                let state = trainer.checkpoint().to_bytes(&file(&trainer.scene()));
                let (checkpoint, scene) = Checkpoint::from_bytes(&state).unwrap();
                trainer = Trainer::resume(checkpoint, container::decode(&scene).unwrap(), &views).unwrap();
            }
            let mut scene = trainer.scene();
            let dead = trainer.prune_dead_components(&mut scene).unwrap();
            (dead, file(&scene), file(&trainer.scene()))
        })
    };
    let (dead, pruned, whole) = on(2, false);
    println!("{dead:?}, {} bytes of {}", pruned.len(), whole.len());
    assert!(dead.tensors_dropped > 0 && pruned.len() < whole.len());
    for (threads, resume) in [(1, false), (3, false), (2, true)] {
        let (same, file, _) = on(threads, resume);
        assert!(same == dead && file == pruned, "{threads} threads, resumed: {resume}");
    }
}

#[test]
fn a_new_occupancy_decides_which_rays_are_drawn() {
    let views = views();
    let counts = [false, true].map(|redraw| {
        let mut config = config();
        config.sampling.refilter_rays = redraw;
        let mut trainer = Trainer::new(config.clone(), scenes::scene(&config), &views).unwrap();
        let before = trainer.ray_count();
        run_to(&mut trainer, 8);
        assert!(trainer.scene().occupancy.is_some());
        let mut meet = RaySampler::new(&views, &trainer.scene().frame, &config).unwrap();
        meet.filter_rays(&Field::<f32>::unlimited(&trainer.scene()));
        [before, trainer.ray_count(), meet.active_ray_count()]
    });
    let [[before, kept, meet], [_, redrawn, meet_too]] = counts;
    assert_eq!((before, meet, meet), (kept, meet_too, redrawn));
    assert_ne!(before, meet, "the comparison sees what is redrawn");
}

#[test]
fn the_last_occupancy_is_within_the_one_before_and_leaves_the_pictures_as_they_are() {
    let views = views();
    let scene_of = |min_alpha: f64, max_loss: f64| {
        let mut config = config();
        config.lean = LeanConfig::off();
        config.finish = FinishConfig { from: 0.5, min_alpha, max_loss, ..FinishConfig::off() };
        let scene = scenes::scene(&config);
        let mut trainer = Trainer::new(config, scene, &views).unwrap();
        run_to(&mut trainer, 18);
        trainer.scene()
    };
    let wide = scene_of(0.0, 0.5);
    let of_wide = wide.occupancy.as_ref().unwrap();
    let picture = |scene: &Scene| CpuRenderer::unlimited(scene).render(&scenes::camera(48, 1.0)).pixels;
    let before = picture(&wide);
    let [(kept, psnr), (fewer, lower)] = [(0.016, 0.5), (0.03, 100.0)].map(|(min_alpha, max_loss)| {
        let tight = scene_of(min_alpha, max_loss);
        let occupancy = tight.occupancy.as_ref().unwrap();
        assert!(occupancy.vertices == of_wide.vertices && occupancy.iter().all(|vertex| of_wide.get(vertex)));
        let square = |(a, b): (&Pixel, &Pixel)| (0..3).map(|c| f64::from(a.color[c] - b.color[c]).powi(2)).sum::<f64>();
        let after = picture(&tight);
        let error: f64 = before.iter().zip(&after).map(square).sum();
        (occupancy.count(), psnr_of_mse(error / (3 * after.len()) as f64))
    });
    println!("{kept} and {fewer} of {} vertices, {psnr} and {lower} dB", of_wide.count());
    assert!(kept < of_wide.count() && psnr > 45.0);
    // What is not faint changes pictures, and stays if that costs too much.
    assert!(scene_of(0.03, 0.5) == wide);
    assert!(fewer < kept && lower < 45.0);
}

#[test]
fn a_damaged_state_and_other_photographs_are_named() {
    let mut views = views();
    let mut trainer = trainer(&views);
    run_to(&mut trainer, 2);
    let scene = trainer.scene();
    let state = trainer.checkpoint().to_bytes(&file(&scene));
    let (checkpoint, _) = Checkpoint::from_bytes(&state).unwrap();
    // Settings and counters are in the header: each of its bytes, and some of the rest.
    let header = 8 + u64::from_le_bytes(*state.first_chunk().unwrap()) as usize;
    assert!(header > 1000 && header < state.len() / 2);
    for at in (0..header).chain((header..state.len()).step_by(state.len() / 50)) {
        let mut damaged = state.clone();
        damaged[at] ^= 0x01;
        assert!(Checkpoint::from_bytes(&damaged).is_err(), "a flipped bit at {at} goes unnoticed");
    }
    for at in (0..state.len()).step_by(state.len() / 50) {
        assert!(Checkpoint::from_bytes(&state[..at]).is_err(), "cut at {at}");
    }
    assert!(Checkpoint::from_bytes(&[&state[..], b"0"].concat()).is_err(), "a byte more");
    let mut colors = views[0].pixels.colors([0.0; 3]);
    colors[0][0] += 0.5;
    views[0].pixels = Pixels::opaque(colors);
    let error = Trainer::resume(checkpoint, scene, &views).unwrap_err().to_string();
    assert!(error.contains("photographs"), "{error}");
}

#[test]
fn a_checkpoint_of_another_version_is_named() {
    let views = views();
    let mut trainer = trainer(&views);
    run_to(&mut trainer, 1);
    let state = trainer.checkpoint().to_bytes(&file(&trainer.scene()));
    let replaced = |from: &[u8], to: &[u8]| {
        assert_eq!(from.len(), to.len());
        let at = state.windows(from.len()).position(|window| window == from).unwrap();
        let mut other = state.clone();
        other[at..at + to.len()].copy_from_slice(to);
        Checkpoint::from_bytes(&other).unwrap_err().to_string()
    };
    let rule = "the checkpoint's version must be 1; finish the run with the program that wrote it; found";
    assert_eq!(replaced(b"\"version\":\"1\"", b"\"version\":\"2\""), format!("{rule} 2"));
    assert_eq!(replaced(b"\"version\"", b"\"versio_\""), format!("{rule} an older one"));
}

/// Components with matrices, size and variation of factors in the loss: learned, and resumed to the same file.
#[test]
fn matrices_are_learned_and_resumed() {
    let views = views();
    let mut config = scenes::with_kinds(config(), &[FactorKind::Vm; 3]);
    (config.loss.density_l1, config.loss.density_variation, config.loss.appearance_variation) = (1e-4, 1e-3, 1e-3);
    config.lean.max_parameters = Some(60_000);
    (config.schedule.steps, config.schedule.upsample_at, config.schedule.occupancy_at) =
        (60, vec![10, 20], vec![15, 30]);
    let begun = || Trainer::new(config.clone(), scenes::scene(&config), &views).unwrap();
    let mut whole = begun();
    let errors: Vec<f64> = (0..config.schedule.steps).map(|_| whole.step().unwrap().mean_squared_error).collect();
    let psnr = |part: &[f64]| psnr_of_mse(part.iter().sum::<f64>() / part.len() as f64);
    let (before, after) = (psnr(&errors[..5]), psnr(&errors[55..]));
    let [all, held] = [whole.scene().parameter_count(), whole.scene().nonzero_parameter_count()];
    println!("{before:.2} dB to {after:.2} dB, {held} of {all} parameters");
    assert!(after > before + 3.0 && held <= 60_000 && 60_000 < all);
    for stop in [9, 17, 33, 50] {
        let mut first = begun();
        run_to(&mut first, stop);
        let state = first.checkpoint().to_bytes(&file(&first.scene()));
        let (checkpoint, scene) = Checkpoint::from_bytes(&state).unwrap();
        let mut second = Trainer::resume(checkpoint, container::decode(&scene).unwrap(), &views).unwrap();
        run_to(&mut second, config.schedule.steps);
        assert!(file(&whole.scene()) == file(&second.scene()), "resumed after step {stop}");
    }
}

#[test]
fn the_error_falls() {
    let views = views();
    let mut config = config();
    config.schedule.steps = 300;
    config.schedule.upsample_at = vec![20, 40];
    config.schedule.occupancy_at = vec![30, 60];
    let scene = scenes::scene(&config);
    let mut trainer = Trainer::new(config, scene, &views).unwrap();
    let errors: Vec<f64> = (0..300).map(|_| trainer.step().unwrap().mean_squared_error).collect();
    let psnr = |part: &[f64]| psnr_of_mse(part.iter().sum::<f64>() / part.len() as f64);
    let (before, after) = (psnr(&errors[..10]), psnr(&errors[290..]));
    println!("{before:.2} dB to {after:.2} dB");
    assert!(after > before + 6.0, "{before:.2} dB to {after:.2} dB");
}

#[test]
fn photographs_of_uneven_exposure_give_the_scene_of_their_mean() {
    let even = views();
    let gain = |n: usize| 0.7 + 0.6 * n as f32 / (even.len() - 1) as f32;
    let uneven: Vec<Photograph> = (even.iter().enumerate())
        .map(|(n, view)| {
            let colors = view.pixels.colors([0.0; 3]).into_iter().map(|color| color.map(|v| gain(n) * v));
            Photograph::new(view.name.clone(), view.camera, Pixels::opaque(colors))
        })
        .collect();
    let error_of = |exposure: Exposure| {
        let mut config = scenes::config();
        config.photographs.exposure = exposure;
        config.schedule.steps = 200;
        let mut trainer = Trainer::new(config.clone(), scenes::scene(&config), &uneven).unwrap();
        run_to(&mut trainer, config.schedule.steps);
        let renderer = CpuRenderer::unlimited(&trainer.scene());
        let mut squared = 0.0;
        for view in &even {
            let colors = view.pixels.colors([0.0; 3]);
            for (pixel, color) in renderer.render(&view.camera).pixels.iter().zip(colors) {
                squared += (0..3).map(|c| f64::from(pixel.color[c] - color[c]).powi(2)).sum::<f64>();
            }
        }
        psnr_of_mse(squared / (3 * 24 * 24 * even.len()) as f64)
    };
    let [off, on, auto] = [Exposure::Off, Exposure::On, Exposure::Auto].map(error_of);
    println!("{off:.2} dB without, {on:.2} dB with exposures, {auto:.2} dB by default");
    assert!(on > off + 3.0 && auto > off + 3.0, "{off:.2} {on:.2} {auto:.2}");
}

/// `views`, their cameras turned and moved at random by `degrees` and a length.
fn disturbed(views: &[Photograph], degrees: f64, length: f64) -> Vec<Photograph> {
    let random = Random::new(4, "disturbed");
    let vector = |n: usize| DVec3::from([0, 1, 2].map(|c| random.normal(3 * n as u64 + c)));
    let camera = |(n, view): (usize, &Photograph)| {
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(degrees.to_radians() / 3.0_f64.sqrt() * vector(2 * n)));
        let position = view.camera.position + length / 3.0_f64.sqrt() * vector(2 * n + 1);
        Camera { world_from_camera: view.camera.world_from_camera * turn, position, ..view.camera }
    };
    views.iter().enumerate().map(|n| Photograph { camera: camera(n), ..n.1.clone() }).collect()
}

/// The mean distance in pixels between the places of points of the scene in the pictures of `cameras` and of `views`.
fn pose_error(cameras: &[Camera], views: &[Photograph]) -> f64 {
    let corners = (0..8).map(|n| 0.5 * DVec3::new(f64::from(n & 1), f64::from(n >> 1 & 1), f64::from(n >> 2)) - 0.25);
    let corners: Vec<DVec3> = corners.collect();
    let of_view = |(camera, view): (&Camera, &Photograph)| {
        let apart = |&p: &DVec3| camera.project(p).unwrap().distance(view.camera.project(p).unwrap());
        corners.iter().map(apart).sum::<f64>() / 8.0
    };
    cameras.iter().zip(views).map(of_view).sum::<f64>() / views.len() as f64
}

/// Settings with which poses alone change.
fn frozen() -> TrainConfig {
    let mut config = scenes::config();
    config.optimizer.factor_learning_rate = 1e-12;
    config.optimizer.network_learning_rate = 1e-12;
    config.poses.refine = true;
    config.photographs.exposure = Exposure::Off;
    config.schedule.steps = 30;
    config.sampling.batch_rays = 64;
    config
}

#[test]
fn disturbed_poses_are_found_again_by_a_scene_that_is_right() {
    let exact = views();
    let wrong = disturbed(&exact, 1.0, 0.03);
    let cameras = |views: &[Photograph]| views.iter().map(|view| view.camera).collect::<Vec<_>>();
    let before = pose_error(&cameras(&wrong), &exact);
    let scene = scenes::scene(&TrainConfig { seed: 77, ..scenes::config() });
    let mut trainer = Trainer::new(frozen(), scene, &wrong).unwrap();
    assert!(trainer.refined_cameras().is_none());
    run_to(&mut trainer, 20);
    let after = pose_error(&trainer.refined_cameras().unwrap(), &exact);
    println!("from {before:.4} to {after:.4} pixels");
    assert!(before > 0.3 && after < 0.15 * before, "from {before:.4} to {after:.4} pixels");
}

#[test]
fn a_wrong_focal_length_is_found_again_with_the_poses() {
    let exact = views();
    let mut wrong = disturbed(&exact, 0.5, 0.01);
    wrong.iter_mut().for_each(|view| view.camera.focal = view.camera.focal.map(|focal| 1.04 * focal));
    let scene = || scenes::scene(&TrainConfig { seed: 77, ..scenes::config() });
    let error = |refine_focal_length: bool| {
        let mut config = frozen();
        config.poses.refine_focal_length = refine_focal_length;
        let mut trainer = Trainer::new(config, scene(), &wrong).unwrap();
        run_to(&mut trainer, 25);
        let cameras = trainer.refined_cameras().unwrap();
        let growth = cameras[0].focal[0] / exact[0].camera.focal[0];
        assert!(cameras.iter().zip(&exact).all(|(c, v)| (c.focal[1] / v.camera.focal[1] - growth).abs() < 1e-12));
        (growth - 1.0, pose_error(&cameras, &exact))
    };
    let (fixed, found) = (error(false), error(true));
    println!("focal length and pixels off: {fixed:?} as it is, {found:?} refined");
    assert!((fixed.0 - 0.04).abs() < 1e-12 && found.0.abs() < 0.01, "{fixed:?} {found:?}");
    assert!(found.1 < 0.6 * fixed.1, "{fixed:?} {found:?}");
}

#[test]
fn a_run_that_refines_poses_resumes_to_the_same_file() {
    let wrong = disturbed(&views(), 1.0, 0.03);
    let mut config = config();
    config.poses.refine = true;
    config.poses.refine_focal_length = true;
    config.schedule.steps = 60;
    let state = |trainer: &Trainer<'_>| trainer.checkpoint().to_bytes(&file(&trainer.scene()));
    let mut whole = Trainer::new(config.clone(), scenes::scene(&config), &wrong).unwrap();
    run_to(&mut whole, 3);
    let (checkpoint, scene) = Checkpoint::from_bytes(&state(&whole)).unwrap();
    run_to(&mut whole, 6);
    let mut resumed = Trainer::resume(checkpoint, container::decode(&scene).unwrap(), &wrong).unwrap();
    assert!(resumed.refined_cameras().is_some());
    run_to(&mut resumed, 6);
    assert!(file(&whole.scene()) == file(&resumed.scene()));
    assert_eq!(whole.refined_cameras(), resumed.refined_cameras());
}

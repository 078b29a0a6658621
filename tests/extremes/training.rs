//! Training at the extremes: gradients stay finite, divergence is detected and reported, and the world's scale and
//! place do not change the result.

use std::ops::ControlFlow;

use glam::DVec3;
use strivec_capture::dataset::{Dataset, Photograph, Pixels};
use strivec_capture::prior::VoxelBoxes;
use strivec_field::Field;
use strivec_field::render::{CpuRenderer, Renderer};
use strivec_format::model::{DecoderMode, Scene};
use strivec_format::psnr::psnr_of_mse;
use strivec_train::{
    Backward, BatchRoulette, Target, TrainConfig, TrainError, Trainer, place_scene, reconstruct_prior,
};

use super::compare::rays_through;
use super::made::{KINDS, Made, moved, random};
use crate::scenes;

fn assert_finite_gradients(name: &str, scene: &Scene) {
    let rays = rays_through(scene, 128);
    let targets: Vec<Target> = (0..rays.len())
        .map(|n| Target {
            color: [(n % 3) as f32 / 2.0, 0.25, 0.75],
            background: scene.frame.background,
            view: 0,
            distance: 0.0,
            weight: 1.0,
        })
        .collect();
    let field = Field::<f32>::unlimited(scene);
    let found = Backward::new(&field).gradients(&field, &rays, &targets, BatchRoulette::default());
    assert!(found.loss.is_finite(), "{name}: loss {}", found.loss);
    let groups = [("factors", found.factors.concat().concat()), ("networks", found.networks)];
    for (group, values) in groups {
        let at = values.iter().position(|g| !g.is_finite());
        assert!(at.is_none(), "{name}: {group} gradient {at:?} is {}", values[at.unwrap()]);
    }
}

#[test]
fn gradients_are_finite_at_every_extreme() {
    for (kind, mode) in KINDS.into_iter().flat_map(|kind| DecoderMode::ALL.map(|mode| (kind, mode))) {
        let made = Made { kind, mode, distance_scale: 2.0, ..Made::default() };
        let plain = made.scene(&random);
        for factor in [1e-6, 1.0, 1e6] {
            assert_finite_gradients(
                &format!("scale {factor:e}"),
                &moved(plain.clone(), factor, DVec3::splat(1e6 * factor)),
            );
        }
        for size in [0.0, 1e-20, 1e-6, 10.0, 100.0, 1e4] {
            let of = |_: usize, _: usize, normal: f64| size * normal;
            assert_finite_gradients(&format!("{kind:?}, {mode:?}, density factors of {size:e}"), &made.scene(&of));
            assert_finite_gradients(
                &format!("{kind:?}, {mode:?}, appearance factors of {size:e}"),
                &made.scene_with(&random, &of),
            );
        }
        let mut opaque = plain.clone();
        opaque.rules.distance_scale = 1e6;
        assert_finite_gradients("opaque first sample", &opaque);
        opaque.rules.min_transmittance = 0.0;
        opaque.rules.min_weight = 0.0;
        assert_finite_gradients("transmittance that underflows", &opaque);
        let mut saturated = plain.clone();
        for layer in &mut saturated.decoder.layers {
            layer.weights.iter_mut().for_each(|w| *w *= 1e4);
        }
        assert_finite_gradients("saturated decoder", &saturated);
        for size in [0.0, 1e3, 1e37] {
            let mut sky = scenes::sky(4);
            sky.coefficients.iter_mut().for_each(|c| *c *= size);
            let mut scene = plain.clone();
            scene.rules.sky = Some(sky);
            assert_finite_gradients(&format!("sky coefficients of {size:e}"), &scene);
        }
        let large = Made { kind, mode, ranks: [256, 256], ..Made::default() };
        assert_finite_gradients("rank 256", &large.scene(&|_, _, normal| 0.3 * normal));
        let fine = Made { kind, mode, ranks: [1, 1], resolution: [1024; 3], ..Made::default() };
        assert_finite_gradients("resolution 1024", &fine.scene(&|v, _, _| if v % 2 == 0 { 1.0 } else { -1.0 }));
    }
}

/// Views of a scene of random tensors.
fn views(count: usize) -> Vec<Photograph> {
    let scene = scenes::scene(&TrainConfig { seed: 77, ..scenes::config() });
    let renderer = CpuRenderer::unlimited(&scene);
    let view = |i: usize| {
        let camera = scenes::camera(24, i as f64);
        let pixels = Pixels::opaque(renderer.render(&camera).pixels.iter().map(|p| p.color));
        Photograph::new(i.to_string(), camera, pixels)
    };
    (0..count).map(view).collect()
}

fn config() -> TrainConfig {
    let mut config = scenes::config();
    config.schedule.steps = 200;
    config.sampling.batch_rays = 200;
    config
}

#[test]
fn a_run_that_diverges_is_stopped_within_a_few_steps_and_says_what_to_change() {
    let views = views(8);
    for (name, factor_rate, network_rate) in [
        ("factor_learning_rate", 1e3, 1e-3),
        ("network_learning_rate", 0.02, 1e3),
        ("factor_learning_rate", 1e30, 1e-3),
        ("network_learning_rate", 0.02, 1e30),
    ] {
        let mut config = config();
        config.optimizer.factor_learning_rate = factor_rate;
        config.optimizer.network_learning_rate = network_rate;
        let mut trainer = Trainer::new(config.clone(), scenes::scene(&config), &views).unwrap();
        let error = (0..200).find_map(|_| trainer.step().err()).expect("an error");
        println!("{error}");
        assert!(trainer.steps_done() <= 16, "{name}: found at step {}", trainer.steps_done());
        assert!(matches!(error, TrainError::Diverged { .. }) && error.to_string().contains(name), "{error}");
    }
}

#[test]
fn a_healthy_run_is_not_stopped_and_its_error_falls_also_at_five_times_the_learning_rate() {
    let views = views(8);
    for times in [0.1, 1.0, 5.0] {
        let mut config = config();
        config.optimizer.factor_learning_rate *= times;
        config.optimizer.network_learning_rate *= times;
        let mut trainer = Trainer::new(config.clone(), scenes::scene(&config), &views).unwrap();
        let errors: Vec<f64> = (0..200).map(|_| trainer.step().unwrap().mean_squared_error).collect();
        let psnr = |part: &[f64]| psnr_of_mse(part.iter().sum::<f64>() / part.len() as f64);
        let [first, last] = [&errors[..20], &errors[180..]].map(psnr);
        println!("{times} times the learning rate: {first:.2} dB to {last:.2} dB");
        assert!(last > first + 1.0, "{times} times the learning rate: {first:.2} dB to {last:.2} dB");
    }
}

/// `views` in a world that is `factor` times larger and moved by `offset` of its units.
fn in_world(views: &[Photograph], factor: f64, offset: DVec3) -> Vec<Photograph> {
    let mut views = views.to_vec();
    for view in &mut views {
        view.camera.position = factor * (view.camera.position + offset);
    }
    views
}

#[test]
fn every_world_scale_and_place_trains_to_the_same_error() {
    let seen = views(12);
    let mut config = config();
    config.schedule.steps = 120;
    config.model.step = 1.0;
    config.prior.voxels = 8000;
    config.prior.steps = vec![100];
    config.prior.rays = 512;
    let run = |factor: f64, offset: DVec3| {
        let dataset = Dataset::new("world", in_world(&seen, factor, offset));
        let occupied: VoxelBoxes = reconstruct_prior(&config, &dataset, &mut |_| ControlFlow::Continue(())).unwrap();
        let scene = place_scene(&config, &dataset, &occupied).unwrap();
        let tensors: usize = scene.scales.iter().map(|s| s.cloud.len()).sum();
        let mut trainer = Trainer::new(config.clone(), scene, &dataset.views).unwrap();
        let errors: Vec<f64> = (0..config.schedule.steps).map(|_| trainer.step().unwrap().mean_squared_error).collect();
        let psnr = psnr_of_mse(errors[100..].iter().sum::<f64>() / (errors.len() - 100) as f64);
        println!("world of {factor:e}, {offset} off: {tensors} tensors, {psnr:.3} dB");
        psnr
    };
    // The unchanged world is so close to the canonical box that it is not mapped, and its tensors have another relative
    // size: the reference is therefore a larger world, which is mapped.
    let plain = run(10.0, DVec3::ZERO);
    for (factor, offset) in [(1e-6, 0.0), (1e6, 0.0), (10.0, 1e6), (10.0, -1e6)] {
        let found = run(factor, DVec3::splat(offset));
        assert!((found - plain).abs() < 0.2, "{found:.3} dB at {factor:e}, {offset}, {plain:.3} dB at 10");
    }
}

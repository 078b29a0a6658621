//! Training with a sky: it is learned, also from rays that meet nothing, and runs stay reproducible.

use crate::scenes;

use std::collections::BTreeSet;

use strivec_capture::dataset::{Photograph, Pixels};
use strivec_field::Field;
use strivec_field::render::{CpuRenderer, Renderer};
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Encoding};
use strivec_format::model::Scene;
use strivec_format::random::Random;
use strivec_train::{Checkpoint, RayBatch, RaySampler, TrainConfig, Trainer};

/// Columns and rows of the photographs.
const SIZE: u32 = 24;

/// The scene of the photographs: random tensors in front of a sky.
fn seen() -> Scene {
    let mut scene = scenes::scene(&TrainConfig { seed: 77, ..scenes::config() });
    scene.rules.sky = Some(scenes::sky(1));
    scene
}

fn views() -> Vec<Photograph> {
    let renderer = CpuRenderer::unlimited(&seen());
    let view = |n: u32| {
        let camera = scenes::camera(SIZE, f64::from(n));
        let pixels = Pixels::opaque(renderer.render(&camera).pixels.iter().map(|p| p.color));
        Photograph::new(n.to_string(), camera, pixels)
    };
    (0..8).map(view).collect()
}

fn config(steps: u64) -> TrainConfig {
    let mut config = scenes::config();
    config.schedule.steps = steps;
    config.sampling.batch_rays = 200;
    config.photographs.sky_degree = Some(1);
    config.schedule.occupancy_at = vec![8];
    config
}

fn trainer<'a>(config: &TrainConfig, views: &'a [Photograph]) -> Trainer<'a> {
    Trainer::new(config.clone(), scenes::scene(config), views).unwrap()
}

fn run_to(trainer: &mut Trainer<'_>, step: u64) {
    while trainer.steps_done() < step {
        trainer.step().unwrap();
    }
}

fn file(scene: &Scene) -> Vec<u8> {
    container::encode(scene, &EncodeOptions { zstd_level: Some(1), ..EncodeOptions::uniform(Encoding::F32) }).unwrap()
}

#[test]
fn a_sky_is_learned_and_all_rays_take_part() {
    let views = views();
    let mut with = config(250);
    with.optimizer.sky_learning_rate = 0.2;
    let mut without = with.clone();
    without.photographs.sky_degree = Some(0);
    let [mut sky, mut plain] = [&with, &without].map(|config| trainer(config, &views));
    assert_eq!(sky.ray_count() as u32, 8 * SIZE * SIZE, "rays that meet nothing train the sky");
    assert!(plain.ray_count() < sky.ray_count());
    assert_eq!(sky.scene().rules.sky, with.sky(), "the color of the background at first");
    let rays = {
        let field = Field::unlimited(&sky.scene());
        let mut sampler = RaySampler::new(&views, &seen().frame, &with).unwrap();
        sampler.filter_rays(&field);
        RayBatch::draw(&sampler, &field, &Random::new(1, "judged"), 0, 2000)
    };
    let [before, _] = [&sky, &plain].map(|trainer| rays.psnr(&Field::unlimited(&trainer.scene()), &[]));
    run_to(&mut sky, with.schedule.steps);
    run_to(&mut plain, with.schedule.steps);
    assert_eq!(sky.ray_count() as u32, 8 * SIZE * SIZE, "and are not filtered out with the occupancy");
    let [after, background] = [&sky, &plain].map(|trainer| rays.psnr(&Field::unlimited(&trainer.scene()), &[]));
    println!("{before:.2} dB gray, {after:.2} dB trained, {background:.2} dB on a background");
    assert!(after > before + 6.0 && after > background + 6.0, "{before}, {after}, {background}");
    // Where photographs show nothing else, the sky is that of the photographs.
    let (found, expected) = (sky.scene().rules.sky.unwrap(), scenes::sky(1));
    let field = Field::<f32>::unlimited(&sky.scene());
    let open: Vec<_> = rays.rays.iter().filter(|ray| field.first_sample(ray).is_none()).collect();
    assert!(open.len() > 100, "{}", open.len());
    for ray in open.into_iter().step_by(10) {
        let (found, expected) = (found.color(ray.direction), expected.color(ray.direction));
        assert!((0..3).all(|c| (found[c] - expected[c]).abs() < 0.1), "{found:?}, {expected:?}");
    }
}

#[test]
fn a_run_with_a_sky_ends_in_the_same_file_on_any_threads_and_after_an_interruption() {
    let views = views();
    let config = config(16);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut trainer = trainer(&config, &views);
            run_to(&mut trainer, config.schedule.steps);
            file(&trainer.scene())
        })
    };
    let whole = on(1);
    assert!(whole == on(3));
    for stop in [1, 8, 12] {
        let mut first = trainer(&config, &views);
        run_to(&mut first, stop);
        let state = first.checkpoint().to_bytes(&file(&first.scene()));
        let (checkpoint, scene) = Checkpoint::from_bytes(&state).unwrap();
        let scene = container::decode(&scene).unwrap();
        assert!(scene.rules.sky.as_ref().unwrap().coefficients.iter().any(|c| *c != 0.0));
        let mut second = Trainer::resume(checkpoint.clone(), scene.clone(), &views).unwrap();
        run_to(&mut second, config.schedule.steps);
        assert!(whole == file(&second.scene()), "resumed after step {stop}");
        // The optimizer has moments for the sky.
        let mut other = scene;
        other.rules.sky = None;
        let error = Trainer::resume(checkpoint, other, &views).unwrap_err().to_string();
        assert!(error.contains("network moments"), "{error}");
    }
}

/// Settings cannot contain both, but a scene with a sky can be trained on with settings for random backgrounds.
#[test]
fn a_sky_takes_the_place_of_random_backgrounds() {
    let transparent: Vec<Photograph> = (views().into_iter())
        .map(|view| {
            let pixels = (0..SIZE * SIZE).map(|n| [128, 128, 128, if n % 2 == 0 { 255 } else { 0 }]);
            Photograph::new(view.name, view.camera, Pixels::Rgba8(pixels.collect()))
        })
        .collect();
    let mut config = config(3);
    config.photographs.random_background = true;
    config.photographs.sky_degree = Some(0);
    let mut scene = scenes::scene(&config);
    let errors = |scene: &Scene| {
        let mut trainer = Trainer::new(config.clone(), scene.clone(), &transparent).unwrap();
        (0..2).map(|_| trainer.step().unwrap().mean_squared_error.to_bits()).collect::<BTreeSet<u64>>()
    };
    let random = errors(&scene);
    scene.rules.sky = Some(scenes::sky(1));
    let found = errors(&scene);
    let mut without = config.clone();
    without.photographs.random_background = false;
    let mut expected = Trainer::new(without, scene.clone(), &transparent).unwrap();
    let expected: BTreeSet<u64> = (0..2).map(|_| expected.step().unwrap().mean_squared_error.to_bits()).collect();
    assert!(found == expected && found != random);
}

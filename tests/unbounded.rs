//! Training of unbounded scenes: the prior in contracted space, tensors in the shell, bounds that stay.
#![cfg(feature = "toolkit")]

mod scenes;

use std::ops::ControlFlow;

use glam::DVec3;
use strivec::container::{self, EncodeOptions, Encoding};
use strivec::dataset::{Dataset, Pixels, View};
use strivec::geometry::{Camera, Lattice};
use strivec::prior::{CoarseOptions, VoxelBoxes};
use strivec::psnr::psnr_of_mse;
use strivec::render::{CpuRenderer, Renderer};
use strivec::train::{TrainConfig, Trainer, place_scene, reconstruct_prior};

/// Photographs of walls with stripes 12 units away, seen from around the origin: nothing is in the inner cube.
fn dataset() -> Dataset {
    let views = (0..24)
        .map(|n| {
            let turn = f64::from(n) * 0.7;
            let position = 0.8 * DVec3::new(turn.cos(), turn.sin(), 0.3 * (2.0 * turn).sin());
            let toward = position + DVec3::new((1.9 * turn).cos(), (1.9 * turn).sin(), 0.4 * (3.0 * turn).cos());
            let camera = Camera::looking_at([24, 24], 20.0, position, toward, DVec3::Z);
            let pixels = camera.rays(0..24).map(|ray| {
                let ray = ray.unwrap();
                let reach = (12.0 - ray.direction.signum() * ray.origin) / ray.direction.abs();
                let at = ray.at(reach.min_element());
                let stripe = |v: f64| (0.5 + 0.4 * (0.8 * v).sin()) as f32;
                [stripe(at.x), stripe(at.y), stripe(at.z)]
            });
            View::new(n.to_string(), camera, Pixels::opaque(pixels))
        })
        .collect();
    Dataset::new("walls", views)
}

fn config() -> TrainConfig {
    let mut config = scenes::config();
    config.shell = Some(0.4);
    config.inner_box = Some([DVec3::NEG_ONE, DVec3::ONE]);
    config.near_far = Some([0.05, 1e3]);
    config.field.density_shift = -10.0;
    config.field.distance_scale = 25.0;
    (config.steps, config.batch_rays) = (150, 512);
    config.occupancy_at = vec![100];
    config.scales.truncate(2);
    config.prior = CoarseOptions { voxels: 30_000, steps: vec![60, 200], rays: 512, ..CoarseOptions::default() };
    config
}

#[test]
fn walls_far_outside_the_inner_cube_are_found_and_learned() {
    let (dataset, config) = (dataset(), config());
    let occupied = reconstruct_prior(&config, &dataset, &mut |_| ControlFlow::Continue(())).unwrap();
    let place = |n: usize| occupied.cell_box(n).center().abs().max_element();
    let in_shell = (0..occupied.cells.len()).filter(|&n| place(n) > 1.0).count();
    assert!(2 * in_shell > occupied.cells.len(), "{in_shell} of {}", occupied.cells.len());

    let scene = place_scene(&config, &dataset, &occupied).unwrap();
    let contraction = config.contraction().unwrap();
    assert_eq!((scene.rules.contraction, scene.bounds), (Some(contraction), contraction.bounds()));
    let mut trainer = Trainer::new(config, scene, &dataset.views).unwrap();
    while trainer.steps_done() < trainer.config().steps {
        trainer.step().unwrap();
    }
    let scene = trainer.scene();
    assert!(scene.occupancy.is_some(), "an occupancy was estimated");
    assert_eq!(scene.bounds, contraction.bounds(), "the bounds stay those of the contraction");
    let bytes = container::encode(&scene, &EncodeOptions::uniform(Encoding::F32)).unwrap();
    assert_eq!(container::decode(&bytes).unwrap().rules, scene.rules);

    let renderer = CpuRenderer::new(&scene);
    let (mut squared, mut depths) = (0.0, Vec::new());
    for view in &dataset.views {
        let camera = view.camera.mapped(&scene.frame.model_from_dataset);
        for (n, pixel) in renderer.render(&camera).pixels.iter().enumerate() {
            let color = view.pixels.color(n, [1.0; 3]);
            squared += (0..3).map(|c| f64::from(pixel.color[c] - color[c]).powi(2)).sum::<f64>();
            depths.push(pixel.depth);
        }
    }
    let psnr = psnr_of_mse(squared / (3 * depths.len()) as f64);
    depths.sort_by(f32::total_cmp);
    let median = depths[depths.len() / 2];
    println!("{psnr:.2} dB, median depth {median}");
    assert!(psnr > 20.0, "{psnr} dB");
    assert!((6.0..24.0).contains(&median), "median depth {median}");
}

#[test]
fn geometry_of_files_reaches_contracted_space() {
    let lattice = Lattice { origin: DVec3::splat(11.9), pitch: DVec3::splat(0.2) };
    let wall = VoxelBoxes { lattice, cells: (0..50).map(|n| glam::UVec3::new(0, n, n % 7)).collect() };
    let space = config().unbounded().unwrap();
    let contracted = space.contract_boxes(&wall);
    let scene = place_scene(&config(), &dataset(), &contracted).unwrap();
    for scale in &scene.scales {
        assert!(scale.cloud.centers().all(|center| center.max_element() > 1.0));
    }
}

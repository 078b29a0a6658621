//! Scenes that fill all photographs to their edges: the prior in contracted space, tensors in the shell, bounds that stay;
//! the dataset's points as the prior.

use crate::command::{printed, run, strivec, text};
use crate::scenes;

use std::fs;
use std::ops::ControlFlow;

use glam::{DVec3, UVec3};
use image::{Rgb, RgbImage};
use serde_json::json;
use strivec_capture::dataset::{Dataset, Photograph, Pixels};
use strivec_capture::prior::{CoarseOptions, VoxelBoxes};
use strivec_field::render::{CpuRenderer, Renderer};
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Encoding};
use strivec_format::geometry::{Camera, Contraction, Lattice};
use strivec_format::psnr::psnr_of_mse;
use strivec_train::{TrainConfig, Trainer, covered_share, place_scene, reconstruct_prior};
use tempfile::TempDir;

/// The distance of the walls from the origin.
const WALLS: f64 = 12.0;

/// Photographs of walls with stripes, seen from around the origin: nothing is in the inner cube.
fn dataset() -> Dataset {
    let views = (0..24)
        .map(|n| {
            let turn = f64::from(n) * 0.7;
            let position = 0.8 * DVec3::new(turn.cos(), turn.sin(), 0.3 * (2.0 * turn).sin());
            let toward = position + DVec3::new((1.9 * turn).cos(), (1.9 * turn).sin(), 0.4 * (3.0 * turn).cos());
            let camera = Camera::looking_at([24, 24], 20.0, position, toward, DVec3::Z);
            let pixels = camera.rays(0..24).map(|ray| {
                let ray = ray.unwrap();
                let reach = (WALLS - ray.direction.signum() * ray.origin) / ray.direction.abs();
                let at = ray.at(reach.min_element());
                let stripe = |v: f64| (0.5 + 0.4 * (0.8 * v).sin()) as f32;
                [stripe(at.x), stripe(at.y), stripe(at.z)]
            });
            Photograph::new(n.to_string(), camera, Pixels::opaque(pixels))
        })
        .collect();
    Dataset::new("walls", views)
}

fn config() -> TrainConfig {
    let mut config = scenes::config();
    config.model.contraction = Some(Contraction { shell: 0.4 });
    config.space.inner_box = Some([DVec3::NEG_ONE, DVec3::ONE]);
    config.space.near_far = Some([3.0, 1e3]);
    config.model.density_shift = -10.0;
    config.model.distance_scale = 25.0;
    (config.schedule.steps, config.sampling.batch_rays) = (600, 512);
    config.schedule.occupancy_at = vec![400];
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
    let contraction = config.model.contraction.unwrap();
    assert_eq!((scene.rules.contraction, scene.bounds), (Some(contraction), contraction.bounds()));
    let mut trainer = Trainer::new(config, scene, &dataset.views).unwrap();
    while trainer.steps_done() < trainer.config().schedule.steps {
        trainer.step().unwrap();
    }
    let scene = trainer.scene();
    assert!(scene.occupancy.is_some(), "an occupancy was estimated");
    assert_eq!(scene.bounds, contraction.bounds(), "the bounds stay those of the contraction");
    let bytes = container::encode(&scene, &EncodeOptions::uniform(Encoding::F32)).unwrap();
    assert_eq!(container::decode(&bytes).unwrap().rules, scene.rules);

    let renderer = CpuRenderer::unlimited(&scene);
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
    let colors: Vec<f64> =
        dataset.views.iter().flat_map(|v| v.pixels.colors([1.0; 3])).flatten().map(f64::from).collect();
    let mean = colors.iter().sum::<f64>() / colors.len() as f64;
    let gray = psnr_of_mse(colors.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / colors.len() as f64);
    println!("{psnr:.2} dB, {gray:.2} dB of a gray picture, median depth {median}");
    assert!(psnr > gray + 2.0, "{psnr} dB, {gray} dB of a gray picture");
    assert!((6.0..24.0).contains(&median), "median depth {median}");
}

/// Centers of a grid of squares on all walls but those of +x, which are there in the `share` of squares only.
fn points(share: f64) -> Vec<DVec3> {
    const SIDE: i32 = 40;
    let at = |n: i32| WALLS * (f64::from(2 * n + 1) / f64::from(SIDE) - 1.0);
    let squares = (0..SIDE * SIDE).map(|n| [at(n % SIDE), at(n / SIDE)]);
    squares
        .flat_map(|[a, b]| {
            let wall = |end: f64| [DVec3::new(end, a, b), DVec3::new(a, end, b), DVec3::new(a, b, end)];
            wall(WALLS).into_iter().chain(wall(-WALLS))
        })
        .filter(|point| point.x < WALLS || point.z / WALLS < 2.0 * share - 1.0)
        .collect()
}

/// A folder with the walls, [`points`] of `share`, and settings.toml.
fn written(share: f64) -> TempDir {
    let folder = TempDir::new().unwrap();
    let frames: Vec<_> = (dataset().views.iter())
        .map(|view| {
            let picture = RgbImage::from_fn(24, 24, |x, y| {
                Rgb(view.pixels.color((24 * y + x) as usize, [1.0; 3]).map(|c| (255.0 * c) as u8))
            });
            let name = format!("{}.png", view.name);
            picture.save(folder.path().join(&name)).unwrap();
            let (axes, place) = (view.camera.world_from_camera, view.camera.position);
            let rows = [0, 1, 2].map(|r| [axes.x_axis[r], axes.y_axis[r], axes.z_axis[r], place[r]]);
            let matrix = [rows[0], rows[1], rows[2], [0.0, 0.0, 0.0, 1.0]];
            json!({ "file_path": name, "transform_matrix": matrix })
        })
        .collect();
    let transforms = json!({ "fl_x": 20.0, "fl_y": 20.0, "cx": 12.0, "cy": 12.0, "w": 24, "h": 24,
        "ply_file_path": "points.ply", "frames": frames });
    fs::write(folder.path().join("transforms.json"), transforms.to_string()).unwrap();
    let points = points(share);
    let mut ply = format!("ply\nformat ascii 1.0\nelement vertex {}\n", points.len());
    ply += "property float x\nproperty float y\nproperty float z\nend_header\n";
    ply.extend(points.iter().map(|p| format!("{} {} {}\n", p.x, p.y, p.z)));
    fs::write(folder.path().join("points.ply"), ply).unwrap();
    let mut settings = config();
    settings.model.contraction = None;
    settings.space.inner_box = None;
    settings.space.near_far = None;
    fs::write(folder.path().join("settings.toml"), settings.to_toml()).unwrap();
    folder
}

/// The messages of `strivec plan` for the walls with [`points`] of `share`.
fn planned(share: f64) -> String {
    let folder = written(share);
    let planned = strivec(folder.path(), &["plan", ".", "--config", "settings.toml"]);
    printed(&planned);
    text(&planned.stderr)
}

#[test]
fn a_trained_file_has_viewpoints_where_its_photographs_were_taken() {
    let folder = written(1.0);
    let mut settings = config();
    settings.schedule.steps = 2;
    settings.schedule.occupancy_at = vec![];
    settings.model.contraction = Some(Contraction { shell: 0.4 });
    settings.space.inner_box = None;
    settings.space.near_far = None;
    fs::write(folder.path().join("settings.toml"), settings.to_toml()).unwrap();
    let train = ["train", ".", "--config", "settings.toml", "-o", "walls.strivec"];
    run(folder.path(), &[&train[..], &["--prior", "points.ply", "--quiet"]].concat());
    let bytes = fs::read(folder.path().join("walls.strivec")).unwrap();
    let file = container::decode_scene_file(&bytes, container::Limits::default()).unwrap();
    let views = file.metadata.views.unwrap();
    let dataset_from_model = file.scene.frame.model_from_dataset.inverse();
    for pose in &views.path {
        let place = dataset_from_model.point(pose.position);
        assert!(place.length() < 1.0, "{place}");
        assert!((pose.rotation * DVec3::Y).z > 0.8, "up is up");
    }
}

#[test]
fn points_are_the_prior_where_tensors_around_them_meet_the_rays() {
    let said = planned(1.0);
    assert!(said.contains("cells of the dataset's points, which 100.0 % of rays meet"), "{said}");
    let said = planned(0.3);
    assert!(said.contains("photographs tell the rest") && said.contains("occupied voxels in"), "{said}");
}

#[test]
fn the_share_of_rays_that_meet_tensors_is_that_of_the_covered_walls() {
    let mut config = config();
    config.model.contraction = None;
    config.space.inner_box = None;
    config.space.near_far = Some([0.5, 40.0]);
    let lattice = Lattice { origin: DVec3::splat(-15.3), pitch: DVec3::splat(0.6) };
    let cells = |points: Vec<DVec3>| {
        let mut cells: Vec<UVec3> = points.iter().map(|&p| lattice.cell_of(p).as_uvec3()).collect();
        cells.sort_by_key(|c| [c.z, c.y, c.x]);
        cells.dedup();
        VoxelBoxes { lattice, cells }
    };
    let share = |part: f64| covered_share(&config, &dataset(), &cells(points(part))).unwrap();
    assert_eq!(share(1.0), 1.0);
    let [half, none] = [share(0.5), share(0.0)];
    assert!(none < half && half < 1.0 && none > 0.5, "{none} without a wall, {half} with half of it");
}

#[test]
fn geometry_of_files_reaches_contracted_space() {
    let lattice = Lattice { origin: DVec3::splat(11.9), pitch: DVec3::splat(0.2) };
    let wall = VoxelBoxes { lattice, cells: (0..50).map(|n| UVec3::new(0, n, n % 7)).collect() };
    let space = config().unbounded().unwrap();
    let contracted = space.contract_boxes(&wall);
    let scene = place_scene(&config(), &dataset(), &contracted).unwrap();
    for scale in &scene.scales {
        assert!(scale.cloud.centers().all(|center| center.max_element() > 1.0));
    }
}

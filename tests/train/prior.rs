//! Occupied space from photographs of a box that is known exactly, and tensors placed on it.

use crate::data;

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use glam::{DQuat, DVec3, IVec3, UVec3};
use strivec_capture::dataset::{Dataset, LoadOptions, Photograph, Pixels, load};
use strivec_capture::prior::coarse::reconstruct;
use strivec_capture::prior::{CoarseOptions, Error, ScaleShape, VoxelBoxes, canonical_map, place_on_boxes};
use strivec_format::geometry::{Aabb, Camera, Lattice, Ray, Similarity};
use strivec_format::model::{Placement, TensorCloud};
use strivec_train::{BootstrapOptions, PrepareError, TrainConfig, bootstrap_prior};

const SOLID: Aabb = Aabb { min: DVec3::new(-0.5, -0.3, -0.2), max: DVec3::new(0.4, 0.4, 0.5) };

/// A box whose faces have different colors, on white, seen from all around; `scale` is the world's.
fn photographs(views: u32, size: u32, scale: f64) -> Dataset {
    let solid = Aabb { min: scale * SOLID.min, max: scale * SOLID.max };
    let view = |n: u32| {
        // A golden spiral: even over the sphere, and never straight from above.
        let (height, angle) = (1.8 * (f64::from(n) + 0.5) / f64::from(views) - 0.9, 2.4 * f64::from(n));
        let radius = (1.0 - height * height).sqrt();
        let position = 3.0 * scale * DVec3::new(radius * angle.cos(), radius * angle.sin(), height);
        let camera = Camera::looking_at([size, size], 1.3 * f64::from(size), position, DVec3::ZERO, DVec3::Z);
        let pixels = Pixels::opaque((0..size * size).map(|p| color(&solid, &camera.ray(p % size, p / size).unwrap())));
        Photograph::new(format!("r_{n}"), camera, pixels)
    };
    Dataset::new("box", (0..views).map(view).collect())
}

fn color(solid: &Aabb, ray: &Ray) -> [f32; 3] {
    let Some((entry, _)) = solid.intersect(ray) else { return [1.0; 3] };
    let inside = (ray.at(entry) - solid.center()) / (0.5 * solid.size());
    let axis = (0..3).max_by(|&a, &b| inside[a].abs().total_cmp(&inside[b].abs())).unwrap_or(0);
    let mut color = [0.1; 3];
    color[axis] = if inside[axis] > 0.0 { 0.9 } else { 0.5 };
    color
}

fn small_options() -> CoarseOptions {
    CoarseOptions { voxels: 27_000, steps: vec![150, 150], rays: 512, visibility_stride: 1, ..CoarseOptions::default() }
}

fn run(dataset: &Dataset, options: &CoarseOptions) -> Result<VoxelBoxes, Error> {
    reconstruct(dataset, options, 7, &mut |_| ControlFlow::Continue(()))
}

#[test]
fn coarse_reconstruction_covers_the_surface_of_a_known_box_and_little_else() {
    let options = CoarseOptions { steps: vec![150, 400], ..small_options() };
    let boxes = run(&photographs(24, 40, 1.0), &options).unwrap();
    let pitch = boxes.lattice.pitch.x;
    let occupied: BTreeSet<_> = boxes.cells.iter().map(|c| c.as_ivec3().to_array()).collect();
    let (mut covered, mut all) = (0, 0);
    for n in 0..20_000_u32 {
        // Points on the six faces, a quarter of a voxel inside.
        let (axis, high) = (n as usize % 3, n / 3 % 2 == 1);
        let fraction = DVec3::new(f64::from(n) * 0.754_877_67, f64::from(n) * 0.569_840_29, f64::from(n) * 0.618_034);
        let mut point = SOLID.min + fraction.fract() * SOLID.size();
        point[axis] = if high { SOLID.max[axis] - 0.25 * pitch } else { SOLID.min[axis] + 0.25 * pitch };
        all += 1;
        covered += u32::from(occupied.contains(&boxes.lattice.cell_of(point).to_array()));
    }
    assert!(f64::from(covered) > 0.999 * f64::from(all), "{covered} of {all} surface points are covered");
    let margin = SOLID.grown(DVec3::splat(2.0 * pitch));
    let outside = boxes.boxes().filter(|b| !margin.contains(b.center())).count();
    let count = boxes.cells.len();
    assert!(outside * 50 < count, "{outside} of {count} voxels lie more than two voxels away");
    assert!(boxes.cells.is_sorted_by(|a, b| [a.z, a.y, a.x] < [b.z, b.y, b.x]), "strictly ascending by (z, y, x)");
}

#[test]
fn coarse_reconstruction_has_the_same_bits_on_any_number_of_threads_and_at_any_world_scale() {
    let options = CoarseOptions { steps: vec![60, 60], occupied_alpha: 1e-5, ..small_options() };
    let on = |threads, scale| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut fit = Vec::new();
        let boxes = pool.install(|| {
            reconstruct(&photographs(12, 24, scale), &options, 7, &mut |p| {
                fit.push(p.psnr.to_bits());
                ControlFlow::Continue(())
            })
        });
        (boxes.unwrap(), fit)
    };
    let one = on(1, 1.0);
    assert_eq!(one.1.len(), 120);
    for threads in [2, 3] {
        assert_eq!(on(threads, 1.0), one, "{threads} threads");
    }
    // A power of two scales every number exactly.
    let small = on(2, 2.0_f64.powi(-20)).0;
    assert_eq!(small.cells, one.0.cells);
    let other = reconstruct(&photographs(12, 24, 1.0), &options, 8, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_ne!(other, one.0, "another seed is another reconstruction, or this test compares nothing");
}

#[test]
fn coarse_reconstruction_names_what_is_wrong() {
    let dataset = photographs(6, 16, 1.0);
    let options = CoarseOptions { steps: vec![20], ..small_options() };
    let mut empty = dataset.clone();
    empty.views.iter_mut().for_each(|v| v.pixels = Pixels::opaque(vec![[1.0; 3]; v.pixels.len()]));
    let error = run(&empty, &options).unwrap_err();
    assert!(matches!(error, Error::EmptyReconstruction { steps: 20, .. }), "{error}");
    assert!(error.to_string().contains("background"), "{error}");

    let none = Dataset::new("none", vec![]);
    assert_eq!(run(&none, &options), Err(Error::NoViews { dataset: "none".into() }));

    let mut short = dataset.clone();
    short.views[3].pixels = Pixels::opaque(vec![[1.0; 3]; 16 * 16 - 1]);
    assert!(matches!(run(&short, &options), Err(Error::View { view, .. }) if view == "r_3"));

    for broken in [
        CoarseOptions { steps: vec![], ..options.clone() },
        CoarseOptions { rays: 0, ..options.clone() },
        CoarseOptions { learning_rate: f64::NAN, ..options.clone() },
        CoarseOptions { background: [2.0, 0.0, 0.0], ..options.clone() },
        CoarseOptions { near: Some(5.0), far: Some(4.0), ..options.clone() },
    ] {
        assert!(matches!(run(&dataset, &broken), Err(Error::Option { .. })), "{broken:?}");
    }

    let cancelled = reconstruct(&dataset, &options, 1, &mut |p| match p.step {
        5 => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    });
    assert_eq!(cancelled, Err(Error::Cancelled { step: 5 }));
}

#[test]
fn one_view_and_parallel_views_give_a_solid_box_and_empty_pictures_are_an_error() {
    let one = Dataset::new("one", photographs(6, 24, 1.0).views[..1].to_vec());
    let mut parallel = photographs(3, 24, 1.0);
    let mut empty = parallel.clone();
    for (n, view) in parallel.views.iter_mut().enumerate() {
        let position = DVec3::new(0.2 * n as f64, -3.0, 0.0);
        view.camera = Camera::looking_at([24, 24], 31.2, position, position + DVec3::Y, DVec3::Z);
        view.pixels = Pixels::opaque((0..576).map(|p| color(&SOLID, &view.camera.ray(p % 24, p / 24).unwrap())));
    }
    let options = CoarseOptions { steps: vec![80], ..small_options() };
    for (name, dataset) in [("one view", one), ("parallel views", parallel)] {
        let boxes = run(&dataset, &options).unwrap_or_else(|e| panic!("{name}: {e}"));
        // Without parallax the depth is free; but the found cells still overlap the box.
        assert!(boxes.bounds().is_solid(), "{name}");
        assert!(boxes.bounds().intersection(&SOLID).is_solid(), "{name}: {:?}", boxes.bounds());
    }
    for view in &mut empty.views {
        view.pixels = Pixels::opaque([[1.0; 3]; 576]);
    }
    let error = run(&empty, &options).unwrap_err();
    assert!(matches!(error, Error::EmptyReconstruction { .. }), "{error}");
}

#[test]
fn options_survive_json_and_refuse_unknown_fields() {
    let options = CoarseOptions { rays: 77, ..CoarseOptions::default() };
    let json = serde_json::to_string(&options).unwrap();
    assert_eq!(serde_json::from_str::<CoarseOptions>(&json).unwrap(), options);
    assert_eq!(serde_json::from_str::<CoarseOptions>("{}").unwrap(), CoarseOptions::default());
    assert!(serde_json::from_str::<CoarseOptions>(r#"{"ray": 5}"#).is_err());
}

fn voxels(origin: DVec3, pitch: f64, cells: &[[u32; 3]]) -> VoxelBoxes {
    let lattice = Lattice { origin, pitch: DVec3::splat(pitch) };
    VoxelBoxes { lattice, cells: cells.iter().map(|&c| c.into()).collect() }
}

fn cells(cloud: &TensorCloud) -> &[UVec3] {
    match &cloud.placement {
        Placement::Lattice { cells, .. } => cells,
        Placement::Explicit { .. } => panic!("not on a lattice"),
    }
}

fn block(size: [u32; 3]) -> Vec<UVec3> {
    let [nx, ny, nz] = size;
    (0..nx * ny * nz).map(|n| UVec3::new(n % nx, n / nx % ny, n / (nx * ny))).collect()
}

#[test]
fn boxes_that_end_on_faces_do_not_occupy_the_next_cell() {
    // 0.1 and its multiples are not representable: faces meet only up to rounding, on either side.
    for origin in [DVec3::ZERO, DVec3::splat(0.1), DVec3::new(-0.7, 12.3, 1e4)] {
        let boxes = voxels(origin, 0.1, &[[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [4, 0, 0], [5, 0, 0]]);
        let same = place_on_boxes(&boxes, &ScaleShape::cubic(0.1, 0.15, 7)).unwrap();
        assert_eq!(cells(&same), block([6, 1, 1]), "as large as the boxes, from {origin}");
        let finer = place_on_boxes(&boxes, &ScaleShape::cubic(0.05, 0.075, 7)).unwrap();
        assert_eq!(cells(&finer), block([12, 2, 2]), "half as large, from {origin}");
        let coarser = place_on_boxes(&boxes, &ScaleShape::cubic(0.3, 0.45, 7)).unwrap();
        assert_eq!(cells(&coarser), block([2, 1, 1]), "three times as large, from {origin}");
    }
}

#[test]
fn boxes_inside_a_cell_and_across_many_occupy_what_they_overlap() {
    let tiny = voxels(DVec3::ZERO, 0.01, &[[0, 0, 0], [105, 0, 0], [105, 3, 250]]);
    let cloud = place_on_boxes(&tiny, &ScaleShape::cubic(1.0, 1.5, 3)).unwrap();
    assert_eq!(cells(&cloud), [UVec3::ZERO, UVec3::X, UVec3::new(1, 0, 2)]);
    assert_eq!(cloud.center(2), DVec3::new(1.5, 0.5, 2.5));
    assert_eq!((cloud.half_edge, cloud.resolution), (DVec3::splat(0.75), [3; 3]));

    let large = voxels(DVec3::splat(-2.0), 1.0, &[[0, 0, 0]]);
    let shape = ScaleShape { pitch: [0.3, 0.5, 2.0], edge: [0.4, 0.6, 2.5], resolution: [1, 2, 3] };
    let cloud = place_on_boxes(&large, &shape).unwrap();
    assert_eq!(cells(&cloud), block([4, 2, 1]), "4 cells of 0.3 overlap a box of 1, the last in part");

    // Every point of a box is covered by the cell of some tensor, however fine or coarse the lattice.
    let boxes = voxels(DVec3::new(0.3, -0.2, 0.1), 0.0713, &[[0, 0, 0], [4, 1, 0], [2, 2, 3]]);
    for pitch in [0.031, 0.0713, 0.2] {
        let cloud = place_on_boxes(&boxes, &ScaleShape::cubic(pitch, pitch, 3)).unwrap();
        let half = DVec3::splat(0.5 * pitch * (1.0 + 1e-5));
        for b in boxes.boxes() {
            for n in 0..1000 {
                let fraction = DVec3::new(f64::from(n % 10), f64::from(n / 10 % 10), f64::from(n / 100)) / 9.0;
                let point = b.min + fraction * b.size();
                assert!(cloud.centers().any(|c| Aabb::around(c, half).contains(point)), "{point} at pitch {pitch}");
            }
        }
    }
}

#[test]
fn placement_refuses_nothing_broken_shapes_and_endless_lattices() {
    let shape = ScaleShape::cubic(0.1, 0.2, 4);
    let nothing = place_on_boxes(&voxels(DVec3::ZERO, 1.0, &[]), &shape);
    assert_eq!(nothing, Err(Error::NothingToPlace { what: "occupied box" }));
    let broken = place_on_boxes(&voxels(DVec3::new(0.0, f64::NAN, 0.0), 1.0, &[[0, 0, 0]]), &shape).unwrap_err();
    assert!(matches!(broken, Error::NotFinite { what: "occupied box", index: 0, .. }), "{broken}");
    let one = voxels(DVec3::ZERO, 1.0, &[[0, 0, 0]]);
    for broken in [
        ScaleShape { pitch: [0.0, 1.0, 1.0], ..shape },
        ScaleShape { edge: [1.0, f64::NAN, 1.0], ..shape },
        ScaleShape { resolution: [4, 4, 0], ..shape },
    ] {
        assert!(matches!(place_on_boxes(&one, &broken), Err(Error::Option { .. })), "{broken:?}");
    }
    for pitch in [1e-4, 1e-12] {
        let error = place_on_boxes(&one, &ScaleShape::cubic(pitch, pitch, 1)).unwrap_err();
        assert!(matches!(error, Error::TooManyCells { .. }), "{error}");
    }
    let apart = voxels(DVec3::ZERO, 1e9, &[[0, 0, 0], [1, 1, 1]]);
    assert!(matches!(place_on_boxes(&apart, &shape), Err(Error::TooManyCells { .. })), "past 2^31 cells");
}

#[test]
fn world_scale_and_origin_do_not_change_the_placement() {
    let mut state = 1_u64;
    let mut cell = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        UVec3::new((state >> 40) as u32 % 48, (state >> 48) as u32 % 30, (state >> 56) as u32 % 25)
    };
    let mut cells_of_prior: Vec<_> = (0..300).map(|_| cell()).chain([UVec3::ZERO, UVec3::new(47, 29, 24)]).collect();
    cells_of_prior.sort_by_key(|c| [c.z, c.y, c.x]);
    cells_of_prior.dedup();
    // 48 voxels of 0.05 along x: half extent 1.2 about 0, where the map is the identity.
    let lattice = Lattice { origin: -0.05 * DVec3::new(24.0, 15.0, 12.5), pitch: DVec3::splat(0.05) };
    let canonical = VoxelBoxes { lattice, cells: cells_of_prior };
    assert_eq!(canonical_map(&canonical.bounds(), 1.2).unwrap(), Similarity::IDENTITY);
    let shapes = [0.4, 0.2, 0.1].map(|pitch| ScaleShape::cubic(pitch, 1.5 * pitch, 7));
    let placed = |boxes: &VoxelBoxes| shapes.map(|s| cells(&place_on_boxes(boxes, &s).unwrap()).to_vec());
    let expected = placed(&canonical);
    for exponent in -6..=6 {
        for offset in [DVec3::ZERO, DVec3::new(100.0, -3.0, 0.3)] {
            let scale = 10.0_f64.powi(exponent);
            let world = Similarity { scale, rotation: DQuat::IDENTITY, translation: scale * offset };
            let boxes = canonical.mapped(&world);
            let map = canonical_map(&boxes.bounds(), 1.2).unwrap();
            assert_eq!(placed(&boxes.mapped(&map)), expected, "scale {scale:e}, offset {offset}");
        }
    }
}

#[test]
fn lego_is_found_without_a_hole_and_keeps_its_units() {
    let Some(folder) = data::folder("lego") else { return };
    let small = LoadOptions { downscale: 8, ..LoadOptions::default() };
    let dataset = load(&folder, "train", &small).unwrap();
    let options = CoarseOptions { steps: vec![200, 200], rays: 1024, visibility_stride: 2, ..CoarseOptions::default() };
    let boxes = run(&dataset, &options).unwrap();
    let bounds = boxes.bounds();
    assert_eq!(canonical_map(&bounds, 1.2).unwrap(), Similarity::IDENTITY, "{bounds:?}");
    assert!(bounds.size().max_element() < 2.8, "floaters: {bounds:?}");

    let occupied: BTreeSet<_> = boxes.cells.iter().map(|c| c.as_ivec3().to_array()).collect();
    let step = 0.2 * boxes.lattice.pitch.x;
    let hits = |ray: &Ray| {
        let Some((entry, exit)) = bounds.intersect(ray) else { return false };
        let samples = (0..).map(|k| entry + step * f64::from(k)).take_while(|&t| t < exit);
        samples.map(|t| boxes.lattice.cell_of(ray.at(t)).to_array()).any(|cell| occupied.contains(&cell))
    };
    let (mut object, mut missed, mut empty, mut fog) = (0, 0, 0, 0);
    for view in dataset.views.iter().step_by(5) {
        for (n, color) in view.pixels.colors([1.0; 3]).iter().enumerate() {
            let ray = view.camera.ray(n as u32 % view.camera.width, n as u32 / view.camera.width).unwrap();
            if color.iter().any(|&c| c < 0.7) {
                object += 1;
                missed += u32::from(!hits(&ray));
            } else if *color == [1.0; 3] {
                empty += 1;
                fog += u32::from(hits(&ray));
            }
        }
    }
    println!("{missed} of {object} object pixels missed, {fog} of {empty} empty ones hit");
    assert!(object > 10_000 && missed * 1000 < object, "{missed} of {object} object pixels see no voxel");
    assert!(f64::from(fog) < 0.25 * f64::from(empty), "{fog} of {empty} empty pixels see voxels");
}

/// Settings of a bootstrap that takes seconds, as with [`small_options`].
fn small_bootstrap() -> TrainConfig {
    let bootstrap =
        BootstrapOptions { steps: vec![100, 300], batch_rays: 512, resolution: 16, ..BootstrapOptions::default() };
    TrainConfig { bootstrap, seed: 7, ..TrainConfig::preset("48").unwrap() }
}

#[test]
fn eight_tensors_find_the_surface_of_a_known_box() {
    let boxes = bootstrap_prior(&small_bootstrap(), &photographs(24, 40, 1.0), &mut |_| ControlFlow::Continue(()));
    let boxes = boxes.unwrap();
    let pitch = boxes.lattice.pitch.x;
    let occupied: BTreeSet<_> = boxes.cells.iter().map(|c| c.as_ivec3().to_array()).collect();
    let is_near = |point: DVec3| {
        let cell = boxes.lattice.cell_of(point);
        (0..27).any(|n| occupied.contains(&(cell + IVec3::new(n % 3, n / 3 % 3, n / 9) - 1).to_array()))
    };
    let (mut near, all) = (0, 20_000_u32);
    for n in 0..all {
        let (axis, high) = (n as usize % 3, n / 3 % 2 == 1);
        let fraction = DVec3::new(f64::from(n) * 0.754_877_67, f64::from(n) * 0.569_840_29, f64::from(n) * 0.618_034);
        let mut point = SOLID.min + fraction.fract() * SOLID.size();
        point[axis] = if high { SOLID.max[axis] } else { SOLID.min[axis] };
        near += u32::from(is_near(point));
    }
    let exact = SOLID.grown(DVec3::splat(pitch)).size().element_product() / pitch.powi(3);
    println!("{near} of {all} within a voxel; {} voxels of {exact:.0}, {pitch:.3} wide", boxes.cells.len());
    assert!(f64::from(near) > 0.98 * f64::from(all), "{near} of {all} surface points are within a voxel of one");
    assert!((boxes.cells.len() as f64) < 3.0 * exact, "{} voxels, {exact:.0} would do", boxes.cells.len());
    assert!(boxes.cells.is_sorted_by(|a, b| [a.z, a.y, a.x] < [b.z, b.y, b.x]), "strictly ascending by (z, y, x)");
}

#[test]
fn eight_tensors_find_the_same_on_any_number_of_threads_and_stop_when_told() {
    let dataset = photographs(12, 24, 1.0);
    let mut config = small_bootstrap();
    // The first round finds nothing yet; the second continues in the same box.
    config.bootstrap.steps = vec![20, 250];
    let on = |threads: usize, config: &TrainConfig| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bootstrap_prior(config, &dataset, &mut |_| ControlFlow::Continue(())).unwrap())
    };
    let one = on(1, &config);
    assert_eq!(on(2, &config), one);
    assert_eq!(on(3, &config), one);
    let other = TrainConfig { seed: 8, ..config.clone() };
    assert_ne!(on(2, &other), one, "another seed is another prior, or this test compares nothing");

    let cancelled = bootstrap_prior(&config, &dataset, &mut |p| match p.step {
        5 => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    });
    assert!(matches!(cancelled, Err(PrepareError::Prior(Error::Cancelled { step: 5 }))));
}

#[test]
fn eight_tensors_name_what_is_wrong() {
    let run = |config: &TrainConfig, dataset: &Dataset| {
        bootstrap_prior(config, dataset, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string()
    };
    let dataset = photographs(6, 16, 1.0);
    let mut config = small_bootstrap();
    config.bootstrap.steps = vec![20];
    let mut empty = dataset.clone();
    empty.views.iter_mut().for_each(|v| v.pixels = Pixels::opaque(vec![[1.0; 3]; v.pixels.len()]));
    let error = run(&config, &empty);
    assert!(error.contains("empty after 20 steps") && error.contains("background"), "{error}");
    let none = Dataset::new("none", vec![]);
    assert!(run(&config, &none).contains("no views"));
    let mut short = dataset.clone();
    short.views[3].pixels = Pixels::opaque(vec![[1.0; 3]; 16 * 16 - 1]);
    assert!(run(&config, &short).contains("r_3"));
    config.space.near_far = Some([5.0, 4.0]);
    assert!(run(&config, &dataset).contains("near"));
    for (text, place) in [
        ("steps = []", "bootstrap.steps"),
        ("components = 0", "bootstrap.components"),
        ("resolution = 4", "bootstrap.resolution"),
        ("min_visibility_weight = 1.0", "bootstrap.min_visibility_weight"),
    ] {
        let error = TrainConfig::from_toml(&format!("[bootstrap]\n{text}"), None).unwrap_err().to_string();
        assert!(error.contains(place), "{error}");
    }
}

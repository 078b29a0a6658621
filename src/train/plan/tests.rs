use glam::{DVec3, UVec3};

use super::*;
use crate::LeanConfig;
use strivec_format::geometry::Lattice;

/// A hollow ball of voxels about `aside`, of radius 1 before `unit`.
fn shell(unit: f64, aside: DVec3) -> VoxelBoxes {
    const CELLS: u32 = 30;
    let pitch = 2.0 * unit / f64::from(CELLS);
    let lattice = Lattice { origin: unit * (aside - 1.0), pitch: DVec3::splat(pitch) };
    let in_shell = |c: &UVec3| {
        let radius = ((c.as_dvec3() + 0.5) / f64::from(CELLS) * 2.0 - 1.0).length();
        (0.85..1.0).contains(&radius)
    };
    let all = (0..CELLS).flat_map(|z| (0..CELLS).flat_map(move |y| (0..CELLS).map(move |x| UVec3::new(x, y, z))));
    VoxelBoxes { lattice, cells: all.filter(in_shell).collect() }
}

/// Cameras around it, four units from its middle, with pictures of `size`×`size`.
fn cameras(unit: f64, aside: DVec3, size: u32) -> Vec<Camera> {
    (0..8)
        .map(|n| {
            let (sin, cos) = (0.7 + f64::from(n)).sin_cos();
            let position = unit * (aside + 4.0 * DVec3::new(0.8 * cos, 0.8 * sin, 0.6));
            Camera::looking_at([size; 2], 1.39 * f64::from(size), position, unit * aside, DVec3::Z)
        })
        .collect()
}

fn preset() -> TrainConfig {
    TrainConfig { lean: LeanConfig::off(), ..TrainConfig::preset("24").unwrap() }
}

fn planned(config: &TrainConfig, occupied: &VoxelBoxes) -> Plan {
    let cameras = cameras(1.0, DVec3::ZERO, 200);
    plan(config, &cameras, PhotographMemory::Bytes, occupied, &MachineSpeed::REFERENCE).unwrap()
}

#[test]
fn the_unit_and_place_of_a_scene_do_not_matter() {
    let fitted = |unit: f64, aside: DVec3| {
        let (config, seen, reasons) =
            fit_to_photographs(&preset(), &cameras(unit, aside, 200), &shell(unit, aside)).unwrap();
        let plan = planned(&config, &seen);
        let tensors: Vec<_> = plan.scales.iter().map(|s| (s.tensors, s.resolution, s.density_rank)).collect();
        (tensors, seen.cells, config.schedule.upsample_at, reasons.len())
    };
    let here = fitted(1.0, DVec3::ZERO);
    assert_eq!(here.0.len(), 3);
    for unit in [0.01, 1000.0] {
        assert_eq!(fitted(unit, DVec3::ZERO), here, "unit {unit}");
        assert_eq!(fitted(unit, DVec3::new(3.0, -5.0, 7.0)), here, "unit {unit}, elsewhere");
    }
}

#[test]
fn cells_are_as_fine_as_pixels_and_no_finer() {
    // A pixel at the nearest cells, about 3 away, is 3/(1.39·size); the ball's tensors are 0.5 wide.
    for (size, expected) in [(100, [18, 9]), (200, [35, 18])] {
        let (config, _, reasons) =
            fit_to_photographs(&preset(), &cameras(1.0, DVec3::ZERO, size), &shell(1.0, DVec3::ZERO)).unwrap();
        let pixel = 3.0 / (1.39 * f64::from(size));
        for (scale, expected) in config.scales.iter().zip(expected) {
            let [cells, ..] = last(scale);
            assert!(cells.abs_diff(expected) <= 2, "{size}: {cells} cells, about {expected}");
            assert!(scale.edge[0] / f64::from(cells) > pixel, "{size}: cells below a pixel");
        }
        assert!(reasons.iter().any(|r| r.contains("a pixel is")), "{reasons:?}");
    }
    // Pictures of few pixels need no fine tensors; pictures of many pixels get twice the preset's cells.
    let fit = |size| fit_to_photographs(&preset(), &cameras(1.0, DVec3::ZERO, size), &shell(1.0, DVec3::ZERO)).unwrap();
    let (config, _, reasons) = fit(64);
    assert_eq!(config.scales.len(), 2, "{reasons:?}");
    assert!(config.schedule.upsample_at.is_empty() && config.scales[0].resolutions.len() == 1);
    assert!(config.scales[1].density_rank < 24, "{reasons:?}");
    assert!(reasons.iter().any(|r| r.starts_with("scale 2 left out")), "{reasons:?}");
    let (config, _, reasons) = fit(8000);
    assert_eq!(last(&config.scales[0]), [242; 3]);
    assert!(reasons.iter().any(|r| r.ends_with("as tensors have at most twice the settings' cells")), "{reasons:?}");
}

#[test]
fn unseen_cells_are_left_out() {
    let (mut occupied, cameras) = (shell(1.0, DVec3::ZERO), cameras(1.0, DVec3::ZERO, 200));
    let in_sight = occupied.cells.len();
    // Far above the view of all cameras, in the order of cells.
    let above = [UVec3::new(15, 15, 90), UVec3::new(16, 15, 90)];
    occupied.cells.extend(above);
    let (_, seen, reasons) = fit_to_photographs(&preset(), &cameras, &occupied).unwrap();
    assert_eq!(seen, shell(1.0, DVec3::ZERO));
    assert_eq!(reasons[0], format!("2 of {} occupied cells left out: no photograph shows them", in_sight + 2));
    let plan = planned(&preset(), &occupied);
    assert!(plan.reasons.iter().any(|r| r.starts_with("2 of ")), "{:?}", plan.reasons);

    occupied.cells = above.into();
    let error = fit_to_photographs(&preset(), &cameras, &occupied).unwrap_err().to_string();
    assert_eq!(error, "there is no occupied cell that a camera sees to place tensors on");
}

#[test]
fn a_cell_at_a_picture_s_edge_counts_as_seen() {
    let camera = Camera::looking_at([100; 2], 100.0, DVec3::new(0.0, -4.0, 0.0), DVec3::ZERO, DVec3::Z);
    // The picture is 4 wide where the cells are; cells of 0.2 have a sphere of radius 0.17.
    let lattice = Lattice { origin: DVec3::splat(-0.1), pitch: DVec3::splat(0.2) };
    let cells = vec![UVec3::ZERO, UVec3::new(10, 0, 0), UVec3::new(11, 0, 0), UVec3::new(20, 0, 0)];
    let mut config = preset();
    config.space.near_far = Some([1.0, 10.0]);
    let of = |config: &TrainConfig| {
        let footprints = Footprints::of(config, &[camera], &VoxelBoxes { lattice, cells: cells.clone() });
        [0, 1, 2, 3].map(|n| footprints.is_seen(n))
    };
    assert_eq!(of(&config), [true, true, false, false]);
    config.space.near_far = Some([5.0, 10.0]);
    assert_eq!(of(&config), [false; 4]);
    let one = VoxelBoxes { lattice, cells: vec![UVec3::ZERO] };
    let pixel = Footprints::of(&preset(), &[camera], &one).near_pixel().unwrap();
    assert!((pixel - 0.04).abs() < 1e-12, "{pixel}");
}

#[test]
fn budgets_are_kept_and_more_is_never_less() {
    let (config, occupied) = (preset(), shell(1.0, DVec3::ZERO));
    let whole = planned(&config, &occupied);
    let fitted = |budget| fit_to_budget(&config, &occupied, budget);
    let mut before = 0;
    for percent in [4, 6, 10, 20, 30, 45, 60, 75, 90, 99] {
        let most = whole.parameters * percent / 100;
        let (config, reductions) = fitted(Budget { parameters: Some(most), ..Budget::default() }).unwrap();
        config.check().unwrap();
        let plan = planned(&config, &occupied);
        assert!(plan.parameters <= most, "{percent} %: {} of {most}", plan.parameters);
        assert!(plan.parameters >= before && plan.parameters > most / 2, "{percent} %: {}", plan.parameters);
        assert!(!reductions.is_empty());
        before = plan.parameters;
        let bytes = whole.file_bytes * percent / 100;
        let (config, _) = fitted(Budget { file_bytes: Some(bytes), ..Budget::default() }).unwrap();
        assert!(planned(&config, &occupied).file_bytes <= bytes);
    }
    for enough in [Budget::default(), Budget { parameters: Some(whole.parameters), file_bytes: Some(u64::MAX) }] {
        assert_eq!(fitted(enough).unwrap(), (config.clone(), Vec::new()));
    }
}

#[test]
fn reductions_come_in_their_order_and_the_smallest_size_is_named() {
    let (config, occupied) = (preset(), shell(1.0, DVec3::ZERO));
    let whole = planned(&config, &occupied).parameters;
    let reductions = |parameters| {
        fit_to_budget(&config, &occupied, Budget { parameters: Some(parameters), file_bytes: None }).unwrap().1
    };
    let [cells, appearance] = [reductions(whole * 9 / 10), reductions(whole / 2)];
    assert_eq!(cells.len(), 1, "{cells:?}");
    assert!(cells[0].starts_with("reduced cells per tensor: ") && cells[0].ends_with(" instead of 121, 61 and 31"));
    assert_eq!(appearance[0], "reduced cells per tensor: 79, 40 and 20 instead of 121, 61 and 31");
    assert!(appearance[1].starts_with("reduced appearance components: ") && appearance.len() == 2, "{appearance:?}");

    let refuse = |parameters| {
        fit_to_budget(&config, &occupied, Budget { parameters: Some(parameters), file_bytes: None })
            .unwrap_err()
            .to_string()
    };
    let error = refuse(10);
    let least: u64 = error.split_whitespace().find_map(|word| word.parse().ok()).unwrap();
    assert!(error.starts_with("`budget` must be at least ") && error.ends_with("; found 10 parameters"), "{error}");
    assert_eq!(reductions(least)[0], "removed the finest 2 of 3 scales");
    refuse(least - 1);
}

#[test]
fn the_schedule_keeps_its_proportions() {
    let preset = &preset().scales[0].resolutions;
    assert_eq!(&ending_in(preset, [121; 3]), preset);
    let shorter = ending_in(preset, [43, 29, 10]);
    assert_eq!((shorter[0], shorter[5]), ([29, 29, 10], [43, 29, 10]));
    assert!(shorter.windows(2).all(|w| (0..3).all(|a| w[0][a] <= w[1][a])), "{shorter:?}");
    assert_eq!(ending_in(&[[7; 3]], [5; 3]), [[5; 3]]);

    let mut config = TrainConfig::preset("24").unwrap();
    config.scales.iter_mut().for_each(|s| s.resolutions = ending_in(&s.resolutions, [7; 3]));
    without_idle_upsamplings(&mut config);
    config.check().unwrap();
    assert!(config.schedule.upsample_at.is_empty());
}

/// The estimates against the measured bytes and minutes of runs on lego (`docs/experiments/`).
#[test]
fn estimates_are_near_measurements() {
    let measured = |preset: &str, refilter_rays: bool, bytes: f64, minutes: f64| {
        let config = TrainConfig::preset(preset).unwrap().with_steps(30_000);
        // The presets of three scales had the paper's when they were measured.
        let scales = TrainConfig::preset(if preset == "24" { "24" } else { "48" }).unwrap().scales;
        let mut config = TrainConfig { scales, ..config };
        config.sampling.refilter_rays = refilter_rays;
        config.sampling.batch_rays = 4096;
        let scales = scale_plans(&config, &[92, 518, 3128]);
        let decoder = initial_decoder(&config).parameter_count();
        let file = cost::file_bytes(&config, &scales, decoder) as f64 / (bytes * 1e6);
        let time = cost::minutes(&config, &scales, &MachineSpeed::REFERENCE) / minutes;
        let parameters = total(&scales, decoder);
        println!(
            "{preset} {refilter_rays}: {parameters} parameters, file {file:.3}, minutes {time:.2} of the measured"
        );
        assert!((0.97..1.03).contains(&file), "{preset}: {file}");
        assert!((0.7..1.4).contains(&time), "{preset}: {time}");
    };
    // Bytes at the peak of short runs: 100 pictures of 800x800, and of 200x200.
    let memory = |parameters, edge: u64, held| cost::memory_bytes(parameters, 100 * edge * edge, held) as f64 / 1e6;
    assert!((0.9..1.1).contains(&(memory(28_889_363, 800, PhotographMemory::Bytes) / 1464.0)));
    assert!((0.8..1.2).contains(&(memory(6_282_491, 200, PhotographMemory::Floats) / 264.0)));

    measured("48", false, 50.00, 60.2);
    measured("48", true, 50.09, 87.4);
    measured("best", false, 50.00, 60.5);
    measured("best", true, 50.09, 74.9);
    measured("per-ray", false, 49.93, 41.4);
    measured("24", false, 30.82, 65.2);
}

//! Presets, their TOML form, and errors of settings.

use glam::{DVec3, UVec3};

use super::{Preset, ScaleConfig, TrainConfig};
use strivec_capture::prior::{ScaleShape, VoxelBoxes, place_on_boxes};
use strivec_format::geometry::Lattice;
use strivec_format::model::{Coverage, DecoderMode, Form, Reduction};

#[test]
fn every_preset_survives_its_own_toml() {
    for preset in Preset::ALL.map(Preset::config) {
        preset.check().unwrap();
        assert_eq!(TrainConfig::from_toml(&preset.to_toml(), None).unwrap(), preset);
    }
}

#[test]
fn a_file_that_names_a_preset_gets_its_scales() {
    let config = TrainConfig::from_toml("preset = \"fast\"\nschedule.steps = 100", None).unwrap();
    assert_eq!((config.scales.len(), config.scales[0].top_k, config.schedule.steps), (2, 2, 100));
    let mode = |text| TrainConfig::from_toml(text, None).unwrap().decoder.mode;
    assert_eq!(mode("preset = \"per-ray\"\n[decoder]\nfeatures = 9"), DecoderMode::PerRay);
    assert_eq!(mode("preset = \"48\"\n[decoder]\nfeatures = 9"), DecoderMode::PerSample);
    assert_eq!(mode("[decoder]\nfeatures = 9"), DecoderMode::Residual);
    let text = "preset = \"per-ray\"\nseed = 7\n[decoder]\nmode = \"residual\"";
    assert_eq!(mode(text), DecoderMode::Residual);
    let per_ray = TrainConfig::preset("per-ray").unwrap();
    assert_eq!(TrainConfig::from_toml(text, Some("per-ray")).unwrap(), TrainConfig { seed: 7, ..per_ray });
}

#[test]
fn unknown_fields_and_senseless_values_are_named() {
    let message = |text| TrainConfig::from_toml(text, None).unwrap_err().to_string();
    assert!(message("stepz = 3").contains("stepz"));
    assert!(message("schedule.steps = 0").contains("schedule.steps"));
    assert!(message("space.half_extent = 0.0").contains("half_extent"));
    assert!(message("preset = \"7\"").contains("12, 24"));
    assert!(message("photographs.background = [2.0, 0.0, 0.0]").contains("background"));
    assert!(message("optimizer.sky_learning_rate = 0.0").contains("sky_learning_rate"));
    assert!(message("photographs.sky_degree = 5").contains("0 to 4"));
    assert!(message("[photographs]\nsky_degree = 2\nrandom_background = true").contains("random_background"));
    assert!(message("[decoder]\nmode = \"residual\"\nfeatures = 2").contains("at least 3"));
    // What would be made of these would take more memory than there is.
    assert!(message("sampling.batch_rays = 4000000000").ends_with("must be 1 to 1048576; found 4000000000"));
    assert!(message("bootstrap.batch_rays = 4000000000").ends_with("must be 1 to 1048576; found 4000000000"));
    assert!(message("decoder.hidden = [64, 1000000000]").ends_with("must be 1 to 1024; found 1000000000"));
    assert!(message("decoder.features = 100000").ends_with("must be 1 to 256; found 100000"));
    assert!(message("decoder.direction_frequencies = 17").ends_with("must be 0 to 16; found 17"));
    let mut config = TrainConfig::preset("fast").unwrap();
    config.scales[0].density_rank = 1 << 30;
    assert!(config.check().unwrap_err().to_string().contains("1 to 512"));
    for mode in DecoderMode::ALL.map(DecoderMode::name) {
        assert!(message("[decoder]\nmode = \"each\"").contains(mode), "{mode}");
    }
}

#[test]
fn cells_of_the_scan_preset_are_as_fine_as_those_of_48() {
    let (scan, usual) = (TrainConfig::preset("scannet").unwrap(), TrainConfig::preset("48").unwrap());
    assert_eq!((scan.schedule.steps, scan.schedule.upsample_at.len(), scan.scales.len()), (100_000, 5, 4));
    let finest = |config: &TrainConfig, upsampled: usize| {
        let scale = config.scales.last().unwrap();
        scale.edge[0] / f64::from(scale.resolutions[upsampled][0]) / scale.pitch[0]
    };
    for upsampled in 0..6 {
        let ratio = finest(&scan, upsampled) / finest(&usual, upsampled);
        assert!((0.9..1.1).contains(&ratio), "{upsampled}: {ratio}");
        let cell = |scale: &ScaleConfig| scale.edge[0] / f64::from(scale.resolutions[upsampled][0]);
        let ratio = cell(&scan.scales[0]) / cell(&scan.scales[3]);
        assert!((0.9..1.1).contains(&ratio), "{upsampled}: {ratio}");
    }
}

#[test]
fn scaling_the_steps_scales_the_schedule() {
    let config = TrainConfig::preset("24").unwrap().with_steps(3000);
    assert_eq!(config.schedule.upsample_at, [200, 300, 400, 550, 700]);
    assert_eq!(config.schedule.occupancy_at, [300, 400, 800, 1600, 2400]);
    assert_eq!(config.finish.from, 1000.0 / 3000.0);
    let short = TrainConfig::preset("scannet").unwrap().with_steps(1000);
    assert_eq!((short.schedule.occupancy_at, short.finish.from), (vec![300, 533, 800], 1.0));
    assert!((config.lean.max_loss - 0.06 * 0.1_f64.sqrt()).abs() < 1e-12, "{}", config.lean.max_loss);
    assert_eq!(TrainConfig::preset("24").unwrap().with_steps(60_000).lean.max_loss, 0.06);
}

#[test]
fn settings_that_name_no_preset_are_those_of_the_default_preset() {
    let preset = Preset::default().config();
    assert_eq!(TrainConfig::default(), preset);
    assert_eq!(TrainConfig::from_toml("", None).unwrap(), preset);
    assert_ne!(TrainConfig::preset("48").unwrap(), preset);
}

#[test]
fn rules_are_named_as_the_model_names_them() {
    let text = "[model]\ncoverage = \"any\"\naggregation = \"clamped\"\ndensity_reduction = \"mean\"";
    let field = TrainConfig::from_toml(text, None).unwrap().model;
    assert_eq!((field.coverage, field.density_reduction), (Coverage::Any, Reduction::Mean));
    assert_eq!((field.appearance_reduction, field.density_shift), (Reduction::Sum, -10.0));
    let error = TrainConfig::from_toml("[model]\ncoverage = \"some\"", None).unwrap_err().to_string();
    assert!(error.contains("all") && error.contains("any"), "{error}");
}

#[test]
fn the_documents_settings_are_valid() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/configs");
    let files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|file| file.unwrap().path()).collect();
    assert!(files.len() >= 2, "{files:?}");
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        TrainConfig::from_toml(&text, None).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    }
}

/// The settings of the document `name`.
fn of_document(name: &str) -> TrainConfig {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../docs/configs/{name}.toml"));
    TrainConfig::from_toml(&std::fs::read_to_string(path).unwrap(), None).unwrap()
}

#[test]
fn a_tensor_over_the_whole_scene_has_its_box_and_as_many_cells_as_a_cube() {
    let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::splat(0.1) };
    let cells = [UVec3::ZERO, UVec3::new(9, 19, 39)].to_vec();
    let occupied = VoxelBoxes { lattice, cells };
    let config = of_document("tensorf-vm").fitted(&occupied).unwrap();
    let scale = &config.scales[0];
    assert!((scale.edge[1] / scale.edge[0] - 2.0).abs() < 1e-9 && (scale.edge[2] / scale.edge[0] - 4.0).abs() < 1e-9);
    // One and two times the cube's; half of it is a number and a half.
    let cells = |n: usize| [scale.resolutions[n][1], scale.resolutions[n][2]];
    assert_eq!([cells(0), cells(5)], [[127, 254], [299, 598]]);
    assert!([149, 150].contains(&scale.resolutions[5][0]), "{:?}", scale.resolutions);
    let map = config.model_from_prior(&occupied.bounds()).unwrap();
    let shape = ScaleShape { pitch: scale.pitch, edge: scale.edge, resolution: scale.resolutions[0] };
    assert_eq!(place_on_boxes(&occupied.mapped(&map), &shape).unwrap().len(), 1);
    assert_eq!(config.fitted(&occupied).unwrap(), config, "once");
    let ranks = |name: &str| of_document(name).scales[0].forms();
    assert_eq!(ranks("tensorf-vm")[1], [(Form::Vm(0), 48), (Form::Vm(1), 48), (Form::Vm(2), 48)]);
    assert_eq!(ranks("tensorf-cp")[1], [(Form::Cp, 288)]);
}

#[test]
fn every_setting_can_be_set_and_survives_its_own_toml() {
    let complete = super::toml::complete();
    let text = complete.to_toml();
    assert_eq!(TrainConfig::from_toml(&text, None).unwrap(), complete);
}

#[test]
fn assignments_override_the_text_and_the_preset() {
    let set = |assignments: &[&str]| {
        let assignments: Vec<String> = assignments.iter().map(ToString::to_string).collect();
        TrainConfig::from_toml("[lean]\nmax_loss = 0.5", Some("48")).unwrap().with_assignments(&assignments)
    };
    let config =
        set(&["lean.max_loss=0.25", "scales.0.top_k = 1", "photographs.exposure=off", "model.step=1"]).unwrap();
    assert_eq!((config.lean.max_loss, config.scales[0].top_k, config.scales[1].top_k), (0.25, 1, 4));
    assert_eq!((config.photographs.exposure, config.model.step), (crate::Exposure::Off, 1.0));
    assert_eq!(set(&["model.contraction.shell=0.3"]).unwrap().model.contraction.map(|c| c.shell), Some(0.3));
    let message = |assignment: &str| set(&[assignment]).unwrap_err().to_string();
    for (assignment, parts) in [
        ("lean.max_los=1", &["`lean.max_los`", "`lean.max_loss`"][..]),
        ("lean.max_loss=-1", &["`lean.max_loss`", "at least 0", "-1"]),
        ("lean.max_loss=much", &["lean.max_loss", "\"much\""]),
        ("lean.max_loss", &["KEY=VALUE"]),
        ("scales.7.top_k=1", &["scales"]),
        ("scales.0.rank=1", &["`scales.0.rank`"]),
        ("model.min_weight=1", &["`model.min_weight`", "[0, 1)"]),
        ("model.sky=1", &["`photographs.sky_degree`"]),
        ("preset=fast", &["`preset`"]),
    ] {
        let message = message(assignment);
        assert!(parts.iter().all(|part| message.contains(part)), "{assignment}: {message}");
    }
}

#[test]
fn keys_that_moved_are_refused_with_their_new_names() {
    let message = |text: &str| TrainConfig::from_toml(text, None).unwrap_err().to_string();
    for (text, now) in [
        ("steps = 3", "`schedule.steps`"),
        ("batch_rays = 3", "`sampling.batch_rays`"),
        ("refine_poses = true", "`poses.refine`"),
        ("max_photograph_side = 9", "`photographs.max_side`"),
        ("shell = 0.4", "`model.contraction.shell`"),
        ("background = [0.0, 0.0, 0.0]", "`photographs.background`"),
        ("[field]\ncoverage = \"any\"", "`model`"),
        ("[model]\nstep_cells = 0.5", "`model.step`"),
    ] {
        assert!(message(text).contains(now), "{text}: {}", message(text));
    }
}

#[test]
fn unknown_presets_are_refused_with_near_names() {
    let message = "bst".parse::<Preset>().unwrap_err().to_string();
    assert!(message.contains("did you mean best?") && message.contains("360"), "{message}");
    let names = Preset::ALL.map(|preset| (preset.name(), preset.name().parse::<Preset>().unwrap()));
    assert!(Preset::ALL.iter().zip(names).all(|(preset, (_, parsed))| *preset == parsed), "{names:?}");
}

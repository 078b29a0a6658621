//! Pruning of scenes: of tensors whose boxes are empty, and of components that no ray depends on.

use crate::scenes;

use glam::{DVec3, UVec3};
use strivec_capture::dataset::{Photograph, Pixels};
use strivec_field::Field;
use strivec_field::render::{CpuRenderer, ReferenceRenderer, Renderer};
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Encoding};
use strivec_format::geometry::Ray;
use strivec_format::model::{Coverage, Form, Occupancy, Placement, Scale, Scene};
use strivec_format::random::Random;
use strivec_train::{MAX_LOSS, RaySampler, TrainConfig, TrainError, prune_dead_components, prune_unoccupied};

/// A scene that counts on one side only, with its centers on lattices or listed.
fn one_sided(coverage: Coverage, listed: bool) -> Scene {
    let mut scene = scenes::scene(&scenes::config());
    scene.rules.coverage = coverage;
    let mut occupancy = Occupancy::empty(scene.bounds, UVec3::new(21, 19, 17));
    for z in 3..12 {
        for y in 0..19 {
            (2..5).for_each(|x| occupancy.set(UVec3::new(x, y, z)));
        }
    }
    scene.occupancy = Some(occupancy);
    if listed {
        for scale in &mut scene.scales {
            scale.cloud.placement = Placement::Explicit { centers: scale.cloud.centers().collect() };
        }
    }
    scene.check().unwrap();
    scene
}

fn rays() -> Vec<Ray> {
    let cameras = (0..4).map(|i| scenes::camera(12, f64::from(i)));
    cameras.flat_map(|camera| (0..144).map(move |p| camera.ray(p % 12, p / 12).unwrap())).collect()
}

/// Colors and depths in the reference renderer, as bits.
fn reference(scene: &Scene, rays: &[Ray]) -> Vec<[u64; 5]> {
    let renderer = ReferenceRenderer::new(scene);
    let bits = |ray| {
        let trace = renderer.trace_one(ray);
        let [r, g, b] = trace.color;
        [r, g, b, trace.opacity, trace.depth].map(f64::to_bits)
    };
    rays.iter().map(bits).collect()
}

#[test]
fn pruned_tensors_were_in_no_picture() {
    let rays = rays();
    for (coverage, listed) in [(Coverage::All, false), (Coverage::All, true), (Coverage::Any, false)] {
        let scene = one_sided(coverage, listed);
        let mut pruned = scene.clone();
        let kept = prune_unoccupied(&mut pruned);
        pruned.check().unwrap();
        for ((before, after), kept) in scene.scales.iter().zip(&pruned.scales).zip(&kept) {
            println!("{} of {} tensors stay", after.cloud.len(), before.cloud.len());
            assert_eq!(after.cloud.len(), kept.len());
            let rows = Form::Cp.rows(before.cloud.resolution) * before.factors.appearance_rank() as usize;
            for (n, &was) in kept.iter().enumerate() {
                assert_eq!(after.cloud.center(n), before.cloud.center(was));
                let of =
                    |scale: &Scale, n: usize| scale.factors.appearance[0].values[n * rows..(n + 1) * rows].to_vec();
                assert_eq!(of(after, n), of(before, was));
            }
        }
        let fine = |scene: &Scene| scene.scales[1..].iter().map(|s| s.cloud.len()).sum::<usize>();
        assert!(2 * fine(&pruned) < fine(&scene), "most of the fine tensors are elsewhere");
        assert_eq!(reference(&scene, &rays), reference(&pruned, &rays), "{coverage:?}");
        let [fast, fast_pruned] = [&scene, &pruned].map(|s| CpuRenderer::unlimited(s).trace(&rays));
        for (a, b) in fast.iter().zip(&fast_pruned) {
            // Other lists of candidates are added up in another order.
            assert!((0..3).all(|c| (a.color[c] - b.color[c]).abs() < 1e-5), "{a:?} and {b:?}");
        }

        // Removing one tensor more is visible, so the comparison is sensitive.
        let finest = pruned.scales.last_mut().unwrap();
        let within = |n: usize| scene.occupancy.as_ref().unwrap().contains(finest.cloud.center(n));
        let seen = (0..finest.cloud.len()).find(|&n| within(n)).unwrap();
        let others: Vec<usize> = (0..finest.cloud.len()).filter(|&n| n != seen).collect();
        finest.keep_tensors(&others);
        assert_ne!(reference(&scene, &rays), reference(&pruned, &rays), "{coverage:?}");
    }
}

#[test]
fn without_an_occupancy_all_stay_and_of_each_scale_at_least_one() {
    let mut scene = scenes::scene(&scenes::config());
    let before = scene.clone();
    prune_unoccupied(&mut scene);
    assert_eq!(scene, before);
    scene.occupancy = Some(Occupancy::empty(scene.bounds, UVec3::splat(4)));
    let rays = rays();
    let picture = reference(&scene, &rays);
    assert!(prune_unoccupied(&mut scene).iter().all(|kept| kept[..] == [0]));
    scene.check().unwrap();
    assert_eq!(reference(&scene, &rays), picture);
}

/// As presets have it: a density feature of 0 is empty.
fn config() -> TrainConfig {
    let mut config = scenes::config();
    config.model.density_shift = -10.0;
    config.model.distance_scale = 25.0;
    config.scales.truncate(2);
    config
}

/// Sets the density feature of each tensor of `scale` to `feature` of its center, constant in the box.
fn set_features(scale: &mut Scale, feature: impl Fn(DVec3) -> f64) {
    let rank = scale.factors.density_rank() as usize;
    let rows = Form::Cp.rows(scale.cloud.resolution);
    let of_x = scale.cloud.resolution[0] as usize + 1;
    for n in 0..scale.cloud.len() {
        let value = feature(scale.cloud.center(n)) / rank as f64;
        let tensor = &mut scale.factors.density[0].values[n * rows * rank..(n + 1) * rows * rank];
        tensor.fill(1.0);
        tensor[..of_x * rank].fill(value as f32);
    }
}

/// Photographs of `scene` with noise that reduces their PSNR to about 30 dB.
fn views(scene: &Scene) -> Vec<Photograph> {
    let renderer = CpuRenderer::unlimited(scene);
    let noise = Random::new(1, "noise");
    (0..6_u32)
        .map(|i| {
            let camera = scenes::camera(32, f64::from(i));
            let noise = noise.substream(u64::from(i));
            let pixels = renderer.render(&camera).pixels;
            let pixels = (0..).zip(&pixels).map(|(n, p)| p.color.map(|c| c + 0.1 * (noise.uniform(n) as f32 - 0.5)));
            let pixels = Pixels::opaque(pixels);
            Photograph::new(i.to_string(), camera, pixels)
        })
        .collect()
}

fn prune_dead(scene: &mut Scene) -> strivec_train::DeadComponents {
    let views = views(scene);
    let mut sampler = RaySampler::new(&views, &scene.frame, &config()).unwrap();
    sampler.filter_rays(&Field::<f32>::unlimited(scene));
    prune_dead_components(scene, &sampler, &[], 3).unwrap()
}

/// True if all density, or all appearance, of tensor `n` is exactly zero.
fn is_clear(scale: &Scale, n: usize) -> [bool; 2] {
    let tensors = scale.cloud.len();
    [&scale.factors.density[0].values, &scale.factors.appearance[0].values].map(|values| {
        let len = values.len() / tensors;
        values[n * len..(n + 1) * len].iter().all(|v| v.to_bits() == 0)
    })
}

#[test]
fn tensors_of_empty_space_are_cleared_and_others_are_not() {
    let mut scene = scenes::scene(&config());
    for scale in &mut scene.scales {
        set_features(scale, |center| if center.x < -0.1 { 15.0 } else { 0.05 });
    }
    let before = scene.clone();
    let dead = prune_dead(&mut scene);
    println!("{dead:?}");
    scene.check().unwrap();
    assert!(dead.tensors_dropped > 10 && dead.psnr_after >= dead.psnr_before - MAX_LOSS, "{dead:?}");
    let (mut tensors, mut components, mut numbers) = (0, 0, 0);
    for (scale, was) in scene.scales.iter().zip(&before.scales) {
        let rows = Form::Cp.rows(scale.cloud.resolution) as u64;
        for n in 0..scale.cloud.len() {
            let [density, appearance] = is_clear(scale, n);
            let ranks = [scale.factors.density_rank(), scale.factors.appearance_rank()].map(u64::from);
            tensors += u64::from(density && appearance);
            components += u64::from(density) * ranks[0] + u64::from(appearance) * ranks[1];
            numbers += rows * (u64::from(density) * ranks[0] + u64::from(appearance) * ranks[1]);
            let center = scale.cloud.center(n);
            if center.x > 0.45 {
                assert!(density && appearance, "nothing is at {center}");
            }
        }
        assert_eq!((&scale.cloud, &scale.appearance_matrix), (&was.cloud, &was.appearance_matrix));
    }
    assert_eq!((tensors, components, numbers), {
        let u = &dead;
        (u.tensors_dropped, u.components_dropped, u.parameters_saved)
    });
    let size = |scene| container::encode(scene, &EncodeOptions::uniform(Encoding::F16)).unwrap().len();
    assert!(size(&scene) < size(&before));

    // All remaining components are used.
    let once = scene.clone();
    let again = prune_dead(&mut scene);
    assert_eq!((again.components_dropped, again.psnr_after.to_bits()), (0, again.psnr_before.to_bits()));
    assert_eq!(scene, once);
}

#[test]
fn what_keeps_a_sample_empty_stays() {
    let mut scene = scenes::scene(&config());
    set_features(&mut scene.scales[0], |_| 25.0);
    set_features(&mut scene.scales[1], |center| if center.x > 0.0 { -60.0 } else { 0.0 });
    let before = scene.clone();
    let dead = prune_dead(&mut scene);
    println!("{dead:?}");
    assert!(dead.psnr_after >= dead.psnr_before - MAX_LOSS, "{dead:?}");
    let fine = &scene.scales[1];
    let hollow: Vec<usize> = (0..fine.cloud.len()).filter(|&n| fine.cloud.center(n).x > 0.3).collect();
    assert!(hollow.iter().all(|&n| !is_clear(fine, n)[0]), "without them the coarse scale shows");
    assert!(hollow.iter().any(|&n| is_clear(fine, n)[1]), "no color is seen there");
    assert_eq!(before.scales[1].cloud, fine.cloud);
}

#[test]
fn components_too_small_to_matter_are_cleared_unless_they_do_matter() {
    let mut scene = scenes::scene(&config());
    for scale in &mut scene.scales {
        set_features(scale, |_| 12.0);
        let rank = scale.factors.appearance_rank() as usize;
        scale.factors.appearance[0].values.iter_mut().step_by(rank).for_each(|v| *v *= 0.02);
    }
    let mut amplified = scene.clone();
    let dead = prune_dead(&mut scene);
    println!("{dead:?}");
    assert!(dead.psnr_after >= dead.psnr_before - MAX_LOSS, "{dead:?}");
    let small = |scene: &Scene| {
        let scale = &scene.scales[0];
        let len = scale.factors.appearance[0].values.len() / scale.cloud.len();
        let rank = scale.factors.appearance_rank() as usize;
        let used: Vec<usize> = (0..scale.cloud.len()).filter(|&n| !is_clear(scale, n)[1]).collect();
        let clear = |n: &&usize| {
            scale.factors.appearance[0].values[**n * len..(**n + 1) * len].iter().step_by(rank).all(|&v| v == 0.0)
        };
        (used.iter().filter(clear).count(), used.len())
    };
    let (cleared, used) = small(&scene);
    assert!(cleared == used && used > 10, "{cleared} of {used}");

    // A network for which they are everything.
    for scale in &mut amplified.scales {
        let rank = scale.factors.appearance_rank() as usize;
        scale.factors.appearance[0]
            .values
            .iter_mut()
            .enumerate()
            .filter(|(i, _)| i % rank > 0)
            .for_each(|(_, v)| *v = 0.0);
    }
    let features = amplified.features() as usize;
    let first = &mut amplified.decoder.layers[0];
    for row in first.weights.chunks_exact_mut(first.inputs as usize) {
        row[..features].iter_mut().for_each(|w| *w *= 1e7);
        row[features..].fill(0.0);
    }
    let dead = prune_dead(&mut amplified);
    println!("{dead:?}");
    let (cleared, used) = small(&amplified);
    assert!(cleared == 0 && used > 10, "{cleared} of {used}");
    assert!(dead.psnr_after >= dead.psnr_before - MAX_LOSS, "{dead:?}");
}

#[test]
fn a_scene_that_no_photograph_depends_on_is_an_error() {
    let mut scene = scenes::scene(&config());
    let views = views(&scene);
    for scale in &mut scene.scales {
        set_features(scale, |_| 0.05);
    }
    scene.provenance.steps = 60;
    let mut sampler = RaySampler::new(&views, &scene.frame, &config()).unwrap();
    sampler.filter_rays(&Field::<f32>::unlimited(&scene));
    let error = prune_dead_components(&mut scene, &sampler, &[], 3).unwrap_err();
    assert!(matches!(error, TrainError::EmptyScene { steps: 60 }), "{error}");
    let text = error.to_string();
    assert!(text.contains("60 steps") && text.contains("more steps") && text.contains("prior"), "{text}");
}

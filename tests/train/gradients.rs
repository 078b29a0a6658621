//! Every gradient against central differences in f64, on rays far from any threshold.

use crate::scenes;

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use strivec_field::render::ReferenceRenderer;
use strivec_field::{Activations, Field, Real, Roulette, Samples};
use strivec_format::color_map::ColorMap;
use strivec_format::geometry::Ray;
use strivec_format::model::{Aggregation, Coverage, DecoderMode, FactorKind, Reduction, Scene};
use strivec_format::random::Random;
use strivec_train::{Backward, BatchRoulette, Gradients, Target, TrainConfig, network_parts};

/// Rays whose decisions a perturbation of the parameters by the difference's step does not reach.
const MIN_MARGIN: f64 = 1e-4;

/// Minimum distance of samples from a vertex, in cells: nearer ones have gradients in proportion to that distance,
/// which f32 resolves only to about 5e-7.
const MIN_FRACTION: f64 = 1e-3;

/// `count` rays that meet tensors; if there is a sky, also some that meet none.
fn rays_far_from_decisions(scene: &Scene, count: usize) -> Vec<Ray> {
    let mut on_background = scene.clone();
    on_background.rules.sky = None;
    let renderer = ReferenceRenderer::new(&on_background);
    let field = Field::<f64>::unlimited(scene);
    let random = Random::new(1, "gradient test rays");
    let mut rays: Vec<Ray> = (0..200 * count as u64)
        .map(|i| {
            scenes::camera(64, random.uniform(3 * i) * 6.0)
                .ray_through(64.0 * random.uniform(3 * i + 1), 64.0 * random.uniform(3 * i + 2))
                .unwrap()
        })
        .filter(|ray| {
            let trace = renderer.trace_one(ray);
            trace.margin > MIN_MARGIN && trace.opacity > 0.05 && vertex_distance(scene, &field, ray) > MIN_FRACTION
        })
        .take(count)
        .collect();
    assert_eq!(rays.len(), count, "enough rays with a margin");
    if scene.rules.sky.is_some() {
        let away = |n: usize| Ray { direction: -rays[n].direction, ..rays[n] };
        rays.extend((0..count / 8).map(away).collect::<Vec<_>>());
    }
    rays
}

/// The smallest distance of a sample from a vertex of a tensor that it aggregates, in cells.
fn vertex_distance(scene: &Scene, field: &Field<f64>, ray: &Ray) -> f64 {
    let mut samples = Samples::default();
    field.march(&[*ray], &mut samples);
    let scales = scene.scales.len();
    let mut smallest = f64::INFINITY;
    for (sample, position) in samples.positions.iter().enumerate() {
        for (s, scale) in scene.scales.iter().enumerate() {
            for pair in samples.contributions_of(sample, s, scales) {
                let center = scale.cloud.center((pair.tensor - field.scales[s].first_tensor) as usize);
                let offset = DVec3::from_array(*position) + field.origin - center;
                let cells = (offset + scale.cloud.half_edge) / scale.cloud.cell_size();
                smallest = smallest.min((cells - cells.round()).abs().min_element());
            }
        }
    }
    smallest
}

fn targets(count: usize) -> Vec<Target> {
    let random = Random::new(2, "gradient test targets");
    let color = |i: u64| [0, 1, 2].map(|c| random.uniform(3 * i + c) as f32);
    (0..count as u64)
        .map(|i| Target {
            color: color(2 * i),
            background: color(2 * i + 1),
            view: (i % 3) as u32,
            distance: 0.0,
            weight: 0.5 + random.uniform(1_000_000 + i) as f32,
        })
        .collect()
}

/// The color maps of three photographs.
fn color_maps() -> Vec<ColorMap> {
    let random = Random::new(5, "color maps");
    let entry = |i: u64| 0.4 * (random.uniform(i) - 0.5);
    (0..3)
        .map(|n| ColorMap {
            matrix: DMat3::IDENTITY + DMat3::from_cols_array(&std::array::from_fn(|i| entry(12 * n + i as u64))),
            offset: DVec3::from([9, 10, 11].map(|i| entry(12 * n + i))),
        })
        .collect()
}

/// The groups of parameters, as (name, analytic gradient, how to reach the parameters).
type Reach = Box<dyn Fn(&mut Field<f64>, usize) -> &mut f64>;

fn groups(scene: &Scene, gradients: &Gradients<f64>) -> Vec<(String, Vec<f64>, Reach)> {
    let mut groups: Vec<(String, Vec<f64>, Reach)> = Vec::new();
    let mut field = Field::<f64>::unlimited(scene);
    for (s, scale) in scene.scales.iter().enumerate() {
        for (b, (block, values)) in field.scales[s].blocks().zip(&gradients.factors[s]).enumerate() {
            for (factor, rows) in block.form().factors(scale.cloud.resolution).into_iter().enumerate() {
                let held = block.held();
                let of_tensor = |n| held.values(n).skip(rows.start * held.count(n)).take(rows.len() * held.count(n));
                let places: Vec<usize> = (0..held.tensors()).flat_map(of_tensor).collect();
                let of_factor = places.iter().map(|&i| values[i]).collect();
                let reach: Reach = Box::new(move |field, i| {
                    let block = field.scales[s].blocks_mut().nth(b).expect("a block");
                    &mut block.values_mut()[places[i]]
                });
                let name = if b < scale.factors.density.len() { "density" } else { "appearance" };
                groups.push((format!("scale {s} {name} {:?} factor {factor}", block.form()), of_factor, reach));
            }
        }
    }
    let mut at = 0;
    let lens: Vec<usize> = network_parts(&mut field).map(|p| p.len()).collect();
    for (part, len) in lens.into_iter().enumerate() {
        let values = gradients.networks[at..at + len].to_vec();
        at += len;
        let reach: Reach = Box::new(move |field, i| &mut network_parts(field).nth(part).expect("the part exists")[i]);
        groups.push((format!("network part {part}"), values, reach));
    }
    groups
}

/// The largest |analytic − numeric| / max(|numeric|, 1e-6 of the group's largest) of a group, over a sample of its
/// entries that always holds the largest; and the same if the analytic gradients had the other sign.
fn worst_errors(
    values: &[f64],
    reach: &Reach,
    field: &mut Field<f64>,
    first_step: f64,
    losses: &mut dyn FnMut(&Field<f64>) -> Vec<f64>,
) -> [f64; 2] {
    let largest = largest(values);
    let mut worst = [0.0f64; 2];
    for i in sampled_entries(values) {
        let numeric = central_difference(field, reach, i, first_step, losses);
        for (worst, value) in worst.iter_mut().zip([values[i], -values[i]]) {
            *worst = worst.max((value - numeric).abs() / numeric.abs().max(1e-6 * largest));
        }
    }
    worst
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| v.abs().max(m))
}

/// Entries that have a gradient, from the largest to the smallest in equal strides.
fn sampled_entries(values: &[f64]) -> Vec<usize> {
    let mut entries: Vec<usize> = (0..values.len()).filter(|&i| values[i] != 0.0).collect();
    assert!(!entries.is_empty(), "some entry has a gradient");
    entries.sort_by(|&a, &b| values[b].abs().total_cmp(&values[a].abs()));
    let stride = entries.len().div_ceil(12);
    entries.into_iter().step_by(stride).collect()
}

/// Ridders' method: central differences of shrinking step, extrapolated; the estimate with the smallest error. Large
/// steps drown in curvature or cross a kink of the decoder, small ones in rounding.
fn central_difference(
    field: &mut Field<f64>,
    reach: &Reach,
    i: usize,
    first_step: f64,
    losses: &mut dyn FnMut(&Field<f64>) -> Vec<f64>,
) -> f64 {
    const SHRINK: f64 = 2.0;
    let start = *reach(field, i);
    let mut at = |offset: f64| {
        *reach(field, i) = start + offset;
        losses(field)
    };
    // Ray by ray, so that those that the parameter does not reach add no rounding.
    let mut difference = |h: f64| at(h).iter().zip(at(-h)).map(|(above, below)| above - below).sum::<f64>() / (2.0 * h);
    let mut step = first_step;
    let mut previous: Vec<f64> = Vec::new();
    let (mut best, mut best_error) = (0.0, f64::INFINITY);
    for _ in 0..9 {
        let mut row = vec![difference(step)];
        let mut factor = SHRINK * SHRINK;
        for k in 0..previous.len() {
            let extrapolated = (row[k] * factor - previous[k]) / (factor - 1.0);
            factor *= SHRINK * SHRINK;
            let error = (extrapolated - row[k]).abs().max((extrapolated - previous[k]).abs());
            if error < best_error {
                (best, best_error) = (extrapolated, error);
            }
            row.push(extrapolated);
        }
        // Once rounding takes over, a small difference is an accident.
        if let (Some(new), Some(old)) = (row.last(), previous.last())
            && (new - old).abs() > 2.0 * best_error
        {
            break;
        }
        previous = row;
        step /= SHRINK;
    }
    *reach(field, i) = start;
    best
}

/// A scene whose colors depend strongly on its factors, so that their gradients stand out from rounding; and whose
/// factors are positive, so that no product of two is close to zero by chance, which f32 could not distinguish from
/// zero.
fn scene(config: &TrainConfig) -> Scene {
    let mut scene = scenes::scene(config);
    for scale in &mut scene.scales {
        scale.appearance_matrix.weights.iter_mut().for_each(|w| *w *= 4.0);
        let factors = scale.factors.blocks_mut().flat_map(|block| &mut block.values);
        factors.for_each(|v| *v = 0.3 + 0.4 * v.abs());
    }
    let hidden = scene.decoder.layers.len() - 1;
    for layer in &mut scene.decoder.layers[..hidden] {
        // Two units of three are always on, the third is always off.
        layer.bias.iter_mut().enumerate().for_each(|(i, b)| *b += if i % 3 == 0 { -7.0 } else { 7.0 });
    }
    // The large biases must not saturate the colors.
    scene.decoder.layers[hidden].weights.iter_mut().for_each(|w| *w *= 0.6);
    scene
}

/// Smallest distance of a hidden unit from the kink of its rectifier.
fn kink_distance(field: &Field<f64>, rays: &[Ray]) -> f64 {
    let (mut samples, mut activations) = (Samples::default(), Activations::default());
    field.march(rays, &mut samples);
    field.select_shaded(&samples, None, &mut activations.shaded);
    field.decode(rays, &mut samples, &mut activations);
    let layers = &field.decoder.layers;
    let mut smallest = f64::INFINITY;
    for (layer, inputs) in layers[..layers.len() - 1].iter().zip(&activations.inputs) {
        for input in inputs.chunks_exact(layer.inputs) {
            for (row, bias) in layer.weights.chunks_exact(layer.inputs).zip(&layer.bias) {
                let sum = bias + row.iter().zip(input).map(|(w, x)| w * x).sum::<f64>();
                smallest = smallest.min(sum.abs());
            }
        }
    }
    smallest
}

fn configs() -> Vec<TrainConfig> {
    let mut plain = scenes::config();
    plain.model.density_shift = -6.0;
    let mut other = scenes::config();
    other.model.coverage = Coverage::Any;
    other.model.aggregation = Aggregation::Clamped;
    other.model.density_reduction = Reduction::Mean;
    other.model.appearance_reduction = Reduction::Mean;
    other.model.density_shift = -4.0;
    vec![plain, other]
}

/// Scenes under both sets of rules, in all of the decoder's modes, one that is contracted, one with components of
/// zeros, and two with a sky.
fn cases() -> Vec<Scene> {
    let case = |config: &TrainConfig, mode| {
        let mut scene = scene(config);
        scene.decoder.mode = mode;
        scene
    };
    let mut cases: Vec<Scene> =
        configs().iter().flat_map(|config| DecoderMode::ALL.map(|mode| case(config, mode))).collect();
    cases.push(scenes::contracted(case(&configs()[0], DecoderMode::PerRay)));
    let mut scene = case(&configs()[0], DecoderMode::PerSample);
    scenes::write_zero_components(&mut scene);
    cases.push(scene);
    for (config, mode, degree) in [(1, DecoderMode::PerSample, 4), (0, DecoderMode::Residual, 2)] {
        let mut scene = case(&configs()[config], mode);
        scene.rules.sky = Some(scenes::sky(degree));
        cases.push(scene);
    }
    let matrices = scenes::with_kinds(configs()[0].clone(), &[FactorKind::Vm, FactorKind::Cp, FactorKind::Vm]);
    for mode in [DecoderMode::PerSample, DecoderMode::Residual] {
        cases.push(case(&matrices, mode));
    }
    cases
}

#[test]
fn every_gradient_matches_central_differences_in_f64_and_a_planted_sign_error_does_not() {
    cases().par_iter().enumerate().for_each(|(case, scene)| {
        let rays = rays_far_from_decisions(scene, 16);
        let mut targets = targets(rays.len());
        let mut field = Field::<f64>::unlimited(scene);
        assert!(kink_distance(&field, &rays) > 0.15, "{}", kink_distance(&field, &rays));
        let mut backward = Backward::new(&field);
        if case % 2 == 1 {
            backward.color_maps = color_maps();
        }
        if case % 3 == 1 {
            backward.distance_weight = 0.3;
            let trace = ReferenceRenderer::new(scene);
            for (ray, target) in rays.iter().zip(&mut targets) {
                target.distance = trace.trace_one(ray).depth as f32;
            }
        }
        let gradients = backward.gradients(&field, &rays, &targets, BatchRoulette::default());
        let mut losses = |field: &Field<f64>| {
            let ray_range = |i: usize| backward.loss(field, &rays[i..=i], &targets[i..=i], BatchRoulette::default());
            (0..rays.len()).map(ray_range).map(|loss| loss / rays.len() as f64).collect()
        };
        for (name, values, reach) in groups(scene, &gradients) {
            // A weight of the decoder moves its hidden units further than a factor does.
            let first_step = if name.starts_with("network") { 0.02 } else { 0.16 };
            let [worst, planted] = worst_errors(&values, &reach, &mut field, first_step, &mut losses);
            println!("{name}: {worst:.1e}");
            assert!(worst < 1e-6, "{name}: relative error {worst:e}");
            assert!(planted > 1.0, "{name}: a sign error goes unnoticed ({planted:e})");
        }
    });
}

fn in_f64(factors: &[Vec<Vec<f32>>]) -> Vec<Vec<Vec<f64>>> {
    let block = |values: &Vec<f32>| values.iter().map(|v| v.f64()).collect();
    factors.iter().map(|blocks| blocks.iter().map(block).collect()).collect()
}

#[test]
fn gradients_in_f32_match_those_in_f64() {
    for scene in cases() {
        let rays = rays_far_from_decisions(&scene, 64);
        let targets = targets(rays.len());
        let exact_field = Field::<f64>::unlimited(&scene);
        let exact = Backward::new(&exact_field).gradients(&exact_field, &rays, &targets, BatchRoulette::default());
        let field = Field::<f32>::unlimited(&scene);
        let single = Backward::new(&field).gradients(&field, &rays, &targets, BatchRoulette::default());
        let single = Gradients {
            loss: single.loss.f64(),
            factors: in_f64(&single.factors),
            networks: single.networks.iter().map(|g| g.f64()).collect(),
        };
        let pairs = groups(&scene, &exact).into_iter().zip(groups(&scene, &single));
        for ((name, exact, _), (_, single, _)) in pairs {
            let errors = relative_errors(&exact, &single);
            let worst = sampled_entries(&exact).into_iter().map(|i| errors[i]).fold(0.0, f64::max);
            let mut sorted = errors;
            sorted.sort_by(f64::total_cmp);
            // Small groups may have one such entry, too.
            let most = sorted[sorted.len() - 1 - (sorted.len() / 1000).max(1)];
            println!("{name}: sampled {worst:.1e}, 99.9 % of all {most:.1e}, all {:.1e}", sorted[sorted.len() - 1]);
            assert!(worst < 1e-3 && most < 1e-3, "{name}: relative error {worst:e}, {most:e}");
            let flipped: Vec<f64> = single.iter().map(|v| -v).collect();
            assert!(relative_errors(&exact, &flipped).into_iter().fold(0.0, f64::max) > 1.0, "{name}: sign error");
        }
    }
}

#[test]
fn visibility_away_from_a_known_distance_is_part_of_the_loss() {
    let scene = &cases()[0];
    let rays = rays_far_from_decisions(scene, 16);
    let field = Field::<f64>::unlimited(scene);
    let reference = ReferenceRenderer::new(scene);
    let loss = |weight: f64, share: f64| {
        let mut targets = targets(rays.len());
        for (ray, target) in rays.iter().zip(&mut targets) {
            target.distance = (share * reference.trace_one(ray).depth) as f32;
        }
        let mut backward = Backward::new(&field);
        backward.distance_weight = weight;
        let loss = backward.loss(&field, &rays, &targets, BatchRoulette::default());
        [loss, backward.mean_squared_error()]
    };
    let [plain, mean_squared_error] = loss(0.0, 1.0);
    assert_eq!(plain, mean_squared_error);
    assert_eq!(loss(0.5, 0.0), [plain, plain], "no distance is known");
    assert_eq!(loss(0.5, 1.0)[1], plain);
    let [there, elsewhere] = [1.0, 9.0].map(|share| loss(0.5, share)[0] - plain);
    assert!(there > 0.0 && there < elsewhere, "{there}, {elsewhere}");
    let weights = targets(rays.len()).iter().map(|target| f64::from(target.weight)).sum::<f64>() / rays.len() as f64;
    assert!((elsewhere - 0.5 * weights).abs() < 1e-12, "all visibility is in the wrong place: {elsewhere}");
}

#[test]
fn a_sky_can_learn_from_rays_without_samples_alone() {
    let scene = cases().into_iter().rfind(|scene| scene.rules.sky.is_some()).unwrap();
    let field = Field::<f64>::unlimited(&scene);
    let inside = rays_far_from_decisions(&scene, 16);
    let outside: Vec<Ray> = inside.iter().map(|ray| Ray { origin: ray.origin + 100.0 * DVec3::Z, ..*ray }).collect();
    let rays = [inside, outside].concat();
    let targets = targets(rays.len());
    let of_sky = |rays: &[Ray], targets: &[Target], sky_of_open_rays: bool| {
        let mut backward = Backward::new(&field);
        backward.sky_of_open_rays = sky_of_open_rays;
        let gradients = backward.gradients(&field, rays, targets, BatchRoulette::default()).networks;
        gradients[gradients.len() - field.sky.as_ref().unwrap().coefficients.len()..].to_vec()
    };
    let (open, open_targets): (Vec<Ray>, Vec<Target>) =
        rays.iter().zip(&targets).filter(|(ray, _)| field.first_sample(ray).is_none()).unzip();
    assert!(2 * open.len() >= rays.len() && open.len() < rays.len());
    let share = open.len() as f64 / rays.len() as f64;
    let [found, expected] = [of_sky(&rays, &targets, true), of_sky(&open, &open_targets, false)];
    let worst = found.iter().zip(&expected).map(|(f, e)| (f - share * e).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-15 && expected.iter().any(|e| e.abs() > 1e-4), "{worst:e}");
    assert_ne!(found, of_sky(&rays, &targets, false));
}

#[test]
fn thinned_density_gradients_are_right_on_average() {
    const DRAWS: u64 = 400;
    let scene = &cases()[0];
    let rays = rays_far_from_decisions(scene, 64);
    let targets = targets(rays.len());
    let field = Field::<f64>::unlimited(scene);
    let mut backward = Backward::new(&field);
    let exact = backward
        .gradients(&field, &rays, &targets, BatchRoulette::default())
        .factors
        .into_iter()
        .flat_map(|mut blocks| blocks.swap_remove(0))
        .collect::<Vec<f64>>();
    let mut mean = vec![0.0; exact.len()];
    let mut dropped = 0;
    for draw in 0..DRAWS {
        let roulette = Roulette { below: 1.0, random: Random::new(0, "test").substream(draw), first_ray: 0 };
        let roulette = BatchRoulette { density: Some(roulette), ..BatchRoulette::default() };
        let thinned = backward
            .gradients(&field, &rays, &targets, roulette)
            .factors
            .into_iter()
            .flat_map(|mut blocks| blocks.swap_remove(0))
            .collect::<Vec<f64>>();
        dropped += thinned.iter().zip(&exact).filter(|(t, e)| **t == 0.0 && **e != 0.0).count();
        mean.iter_mut().zip(&thinned).for_each(|(m, t)| *m += t / DRAWS as f64);
    }
    let length = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let error = |scale: f64| {
        let difference = length(&mut mean.iter().zip(&exact).map(|(m, e)| scale * m - e));
        difference / length(&mut exact.iter().copied())
    };
    println!("{dropped} entries dropped in {DRAWS} draws, mean off by {:.1e}", error(1.0));
    assert!(dropped > 0 && error(1.0) < 0.03, "{}", error(1.0));
    assert!(error(1.1) > 0.05, "ten percent too much go unnoticed ({})", error(1.1));
}

/// Entries in which large terms cancel have a relative error in f32 that no arrangement of the sums avoids; they are
/// the last thousandth.
fn relative_errors(exact: &[f64], other: &[f64]) -> Vec<f64> {
    let floor = 1e-6 * largest(exact);
    exact.iter().zip(other).map(|(e, o)| (e - o).abs() / e.abs().max(floor)).collect()
}

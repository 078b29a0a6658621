//! The CPU renderer against the reference, on whole pictures.

use crate::scenes;

use glam::DVec3;
use strivec_field::Field;
use strivec_field::render::{CpuRenderer, Pixel, ReferenceRenderer, Renderer, Trace};
use strivec_format::geometry::{Camera, Ray};
use strivec_format::model::{MARGIN_HORIZON, ReferenceField};
use strivec_format::random::Random;
use strivec_measure::{F32_POSITION_ERROR, parity};
use strivec_train::TrainConfig;

fn cameras() -> [Camera; 2] {
    [scenes::camera(32, 0.4), scenes::camera(32, 2.9)]
}

#[test]
fn single_precision_follows_the_reference_under_every_rule_and_a_planted_difference_shows() {
    for (name, scene) in scenes::rule_cases() {
        let found = parity(&scene, &CpuRenderer::unlimited(&scene), &cameras(), F32_POSITION_ERROR);
        println!("{name}: {found:?}, near {:.2} %", 100.0 * found.near_share());
        assert!(found.clear_rays > 1500 && found.near_share() < 0.1, "{name}: {found:?}");
        assert!(found.clear_maximum < 2e-4, "{name}: {found:?}");
        // The field of random tensors has larger jumps than a trained one.
        assert!(found.near_median < 1e-5 && found.near_999 < 0.5, "{name}: {found:?}");

        let mut planted = scene.clone();
        planted.decoder.layers.last_mut().unwrap().bias[0] += 0.02;
        let changed = parity(&scene, &CpuRenderer::unlimited(&planted), &cameras(), F32_POSITION_ERROR);
        assert!(changed.clear_maximum > 2e-4, "{name}: a planted difference goes unnoticed: {changed:?}");
        let Some(sky) = &mut planted.rules.sky else { continue };
        *sky.coefficients.last_mut().unwrap() += 0.05;
        planted.decoder = scene.decoder.clone();
        let changed = parity(&scene, &CpuRenderer::unlimited(&planted), &cameras(), F32_POSITION_ERROR);
        assert!(changed.clear_maximum > 2e-4, "{name}: another sky goes unnoticed: {changed:?}");
    }
}

/// Everything of a pixel but the sky is that of the same scene on a background.
#[test]
fn a_sky_is_behind_the_scene_and_its_pixels_are_opaque() {
    let plain = scenes::scene(&scenes::config());
    let mut scene = plain.clone();
    scene.rules.sky = Some(scenes::sky(3));
    let sky = scene.rules.sky.as_ref().unwrap();
    let camera = scenes::camera(32, 1.0);
    let rays: Vec<Ray> = camera.rays(0..32).flatten().collect();
    let (fast, reference) = (CpuRenderer::unlimited(&scene), ReferenceRenderer::new(&scene));
    let infos = fast.trace_info(&rays, true);
    let without = CpuRenderer::unlimited(&plain).trace_info(&rays, true);
    let (mut empty, mut mixed) = (0, 0);
    for (n, ray) in rays.iter().enumerate() {
        let exact = reference.trace_one(ray);
        assert_eq!((exact.opacity, infos[n].pixel.opacity), (1.0, 1.0));
        assert_eq!((infos[n].pixel.depth, infos[n].normal), (without[n].pixel.depth, without[n].normal), "{n}");
        let through = f64::from(1.0 - without[n].pixel.opacity);
        let behind = sky.color(ray.direction);
        for c in 0..3 {
            let background = f64::from(plain.frame.background[c]);
            let expected = f64::from(without[n].pixel.color[c]) + through * (behind[c] - background);
            assert!((f64::from(infos[n].pixel.color[c]) - expected).abs() < 1e-6, "{n}, channel {c}");
        }
        empty += usize::from(through == 1.0);
        mixed += usize::from((0.2..0.8).contains(&through));
    }
    assert!(empty > 100 && mixed > 50, "{empty} rays meet nothing, {mixed} see both");
    // Directions matter, and pixels without a ray are on the background.
    let colors = [0, 31].map(|n| infos[n].pixel.color);
    assert_ne!(colors[0], colors[1]);
    for picture in [fast.render(&scenes::bent_camera(40)), reference.render(&scenes::bent_camera(40))] {
        assert_eq!((picture.pixels[0].color, picture.pixels[0].opacity), (scene.frame.background, 0.0));
    }
}

#[test]
fn the_fast_field_in_double_precision_is_the_reference_to_rounding() {
    for (name, scene) in scenes::rule_cases() {
        let found = parity(&scene, &CpuRenderer::from_field(Field::<f64>::unlimited(&scene)), &cameras(), 1e-12);
        // Pixels are f32.
        assert!(found.clear_maximum < 1e-7, "{name}: {found:?}");
    }
}

#[test]
fn pixels_that_a_lens_does_not_see_are_background_and_all_others_are_those_of_their_rays() {
    let scene = scenes::scene(&scenes::config());
    let camera = scenes::bent_camera(40);
    let rays: Vec<Option<Ray>> = camera.rays(0..40).collect();
    let seen: Vec<Ray> = rays.iter().copied().flatten().collect();
    assert!((1000..1500).contains(&seen.len()), "{}", seen.len());
    let (fast, reference) = (CpuRenderer::unlimited(&scene), ReferenceRenderer::new(&scene));
    let of_renderer = |picture: Vec<Pixel>, mut traced: std::vec::IntoIter<Pixel>| {
        for (ray, pixel) in rays.iter().zip(picture) {
            match ray {
                // Chunks of rays differ, and so does rounding.
                Some(_) => {
                    let traced = traced.next().unwrap();
                    assert!((0..3).all(|c| (pixel.color[c] - traced.color[c]).abs() < 1e-6), "{pixel:?} {traced:?}");
                }
                None => assert_eq!((pixel.color, pixel.opacity), (scene.frame.background, 0.0)),
            }
        }
    };
    of_renderer(fast.render(&camera).pixels, fast.trace(&seen).into_iter());
    of_renderer(reference.render(&camera).pixels, reference.trace(&seen).into_iter());
    assert!(fast.trace(&seen).iter().filter(|pixel| pixel.opacity > 0.3).count() > 100, "the scene is in the picture");
    assert_eq!(camera.seen_pixels().unwrap(), rays.iter().map(Option::is_some).collect::<Vec<_>>());
    assert_eq!(scenes::camera(40, 1.0).seen_pixels(), None);
}

/// Largest differences of opacity, and of depth times opacity, on the clear rays: those whose decision margin exceeds
/// the position error. Depth alone is ill-conditioned on rays of little opacity.
fn opacity_and_depth_differences(expected: &[Trace], found: &[Pixel]) -> [f64; 2] {
    let clear = expected.iter().zip(found).filter(|(expected, _)| expected.margin > F32_POSITION_ERROR);
    clear.fold([0.0; 2], |[opacity, depth], (e, f)| {
        let of_opacity = (f64::from(f.opacity) - e.opacity).abs();
        let of_depth = (f64::from(f.depth) - e.depth).abs() * e.opacity;
        [f64::max(opacity, of_opacity), f64::max(depth, of_depth)]
    })
}

#[test]
fn opacity_and_depth_follow_the_reference_and_a_planted_difference_shows() {
    const BOUNDS: [f64; 2] = [2e-4, 1e-3];
    let scene = scenes::scene(&scenes::config());
    let camera = scenes::camera(32, 1.0);
    let rays: Vec<Ray> = (0..1024).map(|n| camera.ray(n % 32, n / 32).unwrap()).collect();
    let reference = ReferenceRenderer::new(&scene);
    let expected: Vec<Trace> = rays.iter().map(|ray| reference.trace_one(ray)).collect();
    let clear = expected.iter().filter(|e| e.margin > F32_POSITION_ERROR).count();
    assert!(clear > 400, "{clear} of {} rays are clear", rays.len());
    assert!(expected.iter().any(|e| e.opacity > 0.3 && e.depth > 2.0 && e.depth < 4.0));
    let traced = CpuRenderer::unlimited(&scene).trace(&rays);
    // Few of all rays, with those near a threshold, fall on the other side of it.
    let differs = |(e, f): &(&Trace, &Pixel)| {
        (f64::from(f.opacity) - e.opacity).abs() > 1e-3 || (f64::from(f.depth) - e.depth).abs() > 1e-2
    };
    assert!(expected.iter().zip(&traced).filter(differs).count() < 20);
    let found = opacity_and_depth_differences(&expected, &traced);
    println!("opacity {:.1e}, depth times opacity {:.1e}", found[0], found[1]);
    assert!(found[0] < BOUNDS[0] && found[1] < BOUNDS[1], "{found:?}");

    let mut denser = scene.clone();
    denser.rules.distance_scale *= 1.01;
    let changed = opacity_and_depth_differences(&expected, &CpuRenderer::unlimited(&denser).trace(&rays));
    assert!(changed[0] > BOUNDS[0], "a planted difference of opacity goes unnoticed: {changed:?}");
    // Rays from further away meet the same samples at larger distances.
    let further: Vec<Ray> = rays.iter().map(|r| Ray { origin: r.at(-0.01), ..*r }).collect();
    let changed = opacity_and_depth_differences(&expected, &CpuRenderer::unlimited(&scene).trace(&further));
    assert!(changed[1] > BOUNDS[1], "a planted difference of depth goes unnoticed: {changed:?}");
}

/// Decision margins: within the margin no decision changes, and just beyond it one often does.
#[test]
fn margins_are_distances_to_the_next_decision() {
    let scene = scenes::scene(&TrainConfig { seed: 3, ..scenes::config() });
    let field = ReferenceField::new(&scene);
    let random = Random::new(8, "margins");
    let mut jumps = 0;
    for i in 0..4000 {
        let position = DVec3::from_array([0, 1, 2].map(|a| 1.6 * random.uniform(8 * i + a) - 0.8));
        let here = field.locate(position);
        let tensors = |p: &strivec_format::model::LocatedPoint| -> Vec<Vec<usize>> {
            p.neighbors
                .iter()
                .map(|n| {
                    let mut t: Vec<_> = n.iter().map(|n| n.tensor).collect();
                    t.sort();
                    t
                })
                .collect()
        };
        let moved = |length: f64| {
            let step = DVec3::from_array(
                [0, 1, 2].map(|a| if random.uniform(8 * i + 3 + a) < 0.5 { -length } else { length }),
            );
            field.locate(position + step)
        };
        assert_eq!(tensors(&here), tensors(&moved(0.99 * here.margin)), "inside the margin of {position}");
        if here.margin < MARGIN_HORIZON {
            jumps += usize::from(tensors(&here) != tensors(&moved(1.01 * here.margin)));
        }
    }
    assert!(jumps > 20, "{jumps} jumps just past the margin");
}

#[test]
fn the_reference_finds_the_neighbors_of_an_exhaustive_search() {
    let scene = scenes::scene(&scenes::config());
    let field = ReferenceField::new(&scene);
    let random = Random::new(9, "search");
    for i in 0..2000 {
        let position = DVec3::from_array([0, 1, 2].map(|a| 2.4 * random.uniform(3 * i + a) - 1.2));
        for (scale, found) in scene.scales.iter().zip(&field.locate(position).neighbors) {
            let mut all: Vec<(f64, usize)> = (scale.cloud.centers().enumerate())
                .filter(|(_, c)| (position - *c).abs().cmple(scale.cloud.half_edge).all())
                .map(|(n, c)| ((position - c).length(), n))
                .collect();
            all.sort_by(|a, b| a.partial_cmp(b).unwrap());
            all.truncate(scale.top_k as usize);
            assert_eq!(all.iter().map(|a| a.1).collect::<Vec<_>>(), found.iter().map(|n| n.tensor).collect::<Vec<_>>());
        }
    }
}

#[test]
fn trace_info_has_the_references_normals_and_the_same_pixels() {
    let scene = scenes::scene(&scenes::config());
    let (renderer, field) = (CpuRenderer::unlimited(&scene), ReferenceField::new(&scene));
    let density = |position: DVec3| {
        let point = field.locate(position);
        if point.covered { field.density(field.density_feature(&point).feature) } else { 0.0 }
    };
    let camera = scenes::camera(40, 0.4);
    let rays: Vec<_> = (0..1600).map(|n| camera.ray(n % 40, n / 40).unwrap()).collect();
    let (pixels, infos) = (renderer.trace(&rays), renderer.trace_info(&rays, true));
    assert!(renderer.trace_info(&rays, false).iter().all(|info| info.normal.is_none()));
    let (mut normals, mut close) = (0, 0);
    for ((ray, pixel), info) in rays.iter().zip(&pixels).zip(&infos) {
        assert_eq!(*pixel, info.pixel);
        assert!(info.samples > 0 || pixel.opacity == 0.0);
        assert!(info.normal.is_none() || pixel.opacity >= 0.5);
        let Some(normal) = info.normal else { continue };
        let (at, h) = (ray.at(f64::from(pixel.depth)), 2.0 * scene.rules.step);
        let fall = DVec3::AXES.map(|axis| density(at - h * axis) - density(at + h * axis));
        normals += 1;
        close += usize::from(DVec3::from(fall).normalize().dot(normal.as_dvec3()) > 0.999);
    }
    // The other rays are near a decision, at which the density jumps.
    assert!(normals > 100 && close * 100 >= normals * 98, "{close} of {normals}");
}

#[test]
fn points_have_the_numbers_of_the_reference() {
    for name in ["occupancy", "contracted", "reductions-mean", "vm"] {
        let path = format!("{}/../../fixtures/v1/{name}.strivec", env!("CARGO_MANIFEST_DIR"));
        let scene = strivec_format::container::decode(&std::fs::read(path).unwrap()).unwrap();
        let field = Field::<f64>::unlimited(&scene);
        let reference = ReferenceField::new(&scene);
        // Beyond the bounds too, and more points than are evaluated together.
        let (center, size) = (scene.bounds.center(), scene.bounds.size());
        let along = |n: u32| 0.11 * (f64::from(n % 11) - 5.03);
        let points: Vec<DVec3> =
            (0..11 * 11 * 11).map(|n| center + size * DVec3::new(along(n), along(n / 11), along(n / 121))).collect();
        let width = field.decoder.features;
        // NaN marks values that are not written.
        let (mut densities, mut appearances) = (vec![f64::NAN; points.len()], vec![f64::NAN; points.len() * width]);
        field.densities(|n| points[n], &mut densities);
        field.appearances(|n| points[n], &mut appearances);
        let mut counting = 0;
        for (n, &point) in points.iter().enumerate() {
            let position = scene.rules.contracted(point);
            let at = reference.locate(position);
            let counts = at.covered && scene.bounds.contains(position) && reference.occupied(position).0;
            let expected = if counts {
                let density = reference.density(reference.density_feature(&at).feature);
                [vec![density], reference.appearance_features(&at)].concat()
            } else {
                vec![0.0; 1 + width]
            };
            counting += usize::from(counts);
            let found = std::iter::once(&densities[n]).chain(&appearances[n * width..][..width]);
            for (found, expected) in found.zip(expected) {
                assert!((found - expected).abs() <= 1e-9 * expected.abs().max(1.0), "{name}: {found}, {expected}");
            }
        }
        assert!((10..points.len()).contains(&counting), "{name}: {counting} of {} points count", points.len());
    }
}

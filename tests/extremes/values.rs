//! Extreme values: density features, optical depths, transmittance, rays, factors, the decoder.

use glam::{DVec3, UVec3};
use strivec_format::container::{EncodeOptions, Encoding, Error, decode, encode};
use strivec_format::geometry::Ray;
use strivec_format::model::{DecoderMode, FactorKind, Occupancy, Scene, Sky};

use super::compare::{Way, errors, expected, rays_through, within};
use super::made::{KINDS, Made, random};
use crate::scenes;

/// A tensor whose density feature is `feature` everywhere.
fn constant(feature: f64, mode: DecoderMode) -> Scene {
    constant_of(FactorKind::Cp, feature, mode)
}

/// A tensor of factors of this kind whose density feature is `feature` everywhere.
fn constant_of(kind: FactorKind, feature: f64, mode: DecoderMode) -> Scene {
    let root = match kind {
        FactorKind::Cp => feature.abs().cbrt(),
        FactorKind::Vm => feature.abs().sqrt(),
    };
    // The first two values are the vertices of the x axis, so one factor alone has the sign.
    let made = Made { kind, ranks: [1, 3], resolution: [1; 3], mode, ..Made::default() };
    let mut scene = made.scene(&|_, _, _| root);
    scene.scales[0].factors.density[0].values[..2].iter_mut().for_each(|v| *v *= feature.signum() as f32);
    scene
}

#[test]
fn density_features_from_minus_ten_thousand_to_ten_thousand() {
    for kind in KINDS {
        for feature in [-1e4, -100.0, -88.0, -87.3, -50.0, -10.0, -1e-6, 0.0, 1e-6, 1.0, 20.0, 88.0, 1e4] {
            let scene = constant_of(kind, feature, DecoderMode::PerSample);
            let name = format!("{kind:?}, density feature {feature:e}");
            within(&name, &scene, &rays_through(&scene, 100), Way::ALL, 1.0);
        }
    }
}

#[test]
fn optical_depths_from_1e_minus_12_to_a_million_and_transmittance_that_underflows() {
    for depth in [1e-12, 1e-9, 1e-6, 1e-3, 1.0, 80.0, 104.0, 1e6] {
        for min_transmittance in [1e-3, 0.0] {
            let mut scene = constant(0.0, DecoderMode::PerSample);
            // σ is ln 2.
            scene.rules.distance_scale = depth / (2.0_f64.ln() * scene.rules.step);
            scene.rules.min_transmittance = min_transmittance;
            scene.rules.min_weight = 0.0;
            let rays = rays_through(&scene, 60);
            within(&format!("optical depth {depth:e}, T from {min_transmittance}"), &scene, &rays, Way::ALL, 1.0);
            // Tiny opacities are also within a relative bound.
            if depth <= 1e-6 {
                for (e, f) in expected(&scene, &rays).iter().zip(Way::CpuF64.trace(&scene, &rays)) {
                    assert!((f64::from(f.opacity) - e.opacity).abs() <= 1e-6 * e.opacity + 1e-13);
                }
            }
        }
    }
}

/// Fog: very many samples, each of which changes the transmittance by less than f32 resolves near 1.
#[test]
fn fog_of_a_hundred_thousand_faint_samples_is_not_lost() {
    for depth in [2e-8, 5e-8, 1e-6] {
        let mut scene = constant(0.0, DecoderMode::PerSample);
        scene.rules.step = 2e-5;
        scene.rules.distance_scale = depth / (2.0_f64.ln() * scene.rules.step);
        // The samples weigh less than the minimum weight: a device's buffers limit the shaded samples of a ray.
        let rays = rays_through(&scene, 4);
        let exact = expected(&scene, &rays);
        for &way in Way::ALL {
            for (e, f) in exact.iter().zip(way.trace(&scene, &rays)) {
                let error = (e.opacity - f64::from(f.opacity)).abs();
                println!("fog of {depth:e}: {way:?} opacity {:e}, off by {error:.1e}", e.opacity);
                assert!(error < 1e-3 * e.opacity + 1e-6, "{way:?}: {} for {}", f.opacity, e.opacity);
                assert!((e.depth - f64::from(f.depth)).abs() < 1e-3, "{way:?}: depth {} for {}", f.depth, e.depth);
            }
        }
    }
}

#[test]
fn rays_that_start_inside_run_along_faces_have_zeros_or_miss() {
    for mode in DecoderMode::ALL {
        let scene = Made { mode, distance_scale: 2.0, ..Made::default() }.scene(&random);
        let axes = [DVec3::X, DVec3::NEG_Y, DVec3::Z, DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.0, -0.6, 0.8)];
        let tiny = DVec3::new(1.0, 1e-300, -1e-40).normalize();
        let origins = [
            ("inside a tensor", DVec3::new(0.11, -0.23, 0.31)),
            ("outside", DVec3::new(-5.01, 5.03, -4.97)),
            ("in front", DVec3::new(-5.01, 0.27, 0.31)),
            ("behind", DVec3::new(5.01, 0.27, 0.31)),
        ];
        let mut rays = Vec::new();
        for (_, origin) in origins {
            for direction in axes.into_iter().chain([tiny, -tiny, DVec3::new(-0.0, 0.0, -1.0)]) {
                rays.push(Ray { origin, direction });
            }
        }
        within("rays inside, outside, behind", &scene, &rays, Way::ALL, 1.0);
        // Along faces, edges and through corners of the tensor and of the bounds: below any margin, but finite.
        let mut along = Vec::new();
        for corner in [DVec3::ONE, DVec3::new(1.0, 0.25, 0.5), scene.bounds.max, DVec3::new(1.0, 1.0, 0.0)] {
            for direction in axes.into_iter().chain([-DVec3::ONE.normalize()]) {
                along.push(Ray { origin: corner - 4.0 * direction, direction });
                along.push(Ray { origin: corner, direction });
            }
        }
        let exact = expected(&scene, &along);
        for &way in Way::ALL {
            let errors = errors(way, &scene, &along, &exact);
            println!("| rays along faces | {way:?} | {mode:?} | {} |", errors.row());
            assert!(errors.clear_maximum() <= way.bound(), "{way:?}: {}", errors.row());
        }
    }
}

#[test]
fn spans_without_length_and_ranges_that_reach_far() {
    let base = Made { distance_scale: 2.0, ..Made::default() }.scene(&random);
    for (near, far) in [(0.0, 1e-9), (1.0, 1.0 + 1e-9), (100.0, 200.0), (0.0, 1e6), (0.0, 1e12), (3.0, 3.5)] {
        let mut scene = base.clone();
        (scene.frame.near, scene.frame.far) = (near, far);
        scene.check().unwrap();
        let rays = rays_through(&scene, 60);
        let exact = expected(&scene, &rays);
        for &way in Way::ALL {
            let found = way.trace(&scene, &rays);
            let far_off = exact.iter().zip(&found).filter(|(e, f)| (e.opacity - f64::from(f.opacity)).abs() > 1e-3);
            assert!(far_off.count() <= 3, "{way:?}, near {near}, far {far}");
        }
    }
    let mut same = base;
    (same.frame.near, same.frame.far) = (2.0, 2.0);
    assert_eq!(same.check().unwrap_err().place.to_string(), "frame near and far");
}

#[test]
fn an_opaque_first_sample_and_rays_through_nothing() {
    for mode in DecoderMode::ALL {
        let mut scene = constant(1e4, mode);
        scene.rules.distance_scale = 1e3;
        let rays = rays_through(&scene, 60);
        within("all-opaque first sample", &scene, &rays, Way::ALL, 1.0);
        assert!(Way::CpuF32.trace(&scene, &rays).iter().any(|p| p.opacity == 1.0));
        // No sample counts.
        scene.occupancy = Some(Occupancy::empty(scene.bounds, UVec3::splat(4)));
        for found in Way::ALL.iter().flat_map(|way| way.trace(&scene, &rays)) {
            assert_eq!((found.color, found.opacity, found.depth), (scene.frame.background, 0.0, 0.0));
        }
    }
}

#[test]
fn factors_at_the_limits_of_f16_and_of_every_quantizer() {
    // The largest and the smallest values of f16, including subnormal ones.
    let extremes = [65504.0, 6.103_515_6e-5, 5.960_464_5e-8, 0.0];
    for (kind, largest) in KINDS.into_iter().flat_map(|kind| extremes.map(|largest| (kind, largest))) {
        let made = Made { kind, ranks: [2, 2], resolution: [3; 3], ..Made::default() };
        let of = |v: usize, r: usize, _: f64| if (v + r).is_multiple_of(2) { largest } else { -largest };
        let scene = made.scene_with(&of, &|_, _, normal| normal);
        let rays = rays_through(&scene, 60);
        let encodings = [Encoding::F32, Encoding::F16].into_iter();
        for encoding in encodings.chain([16, 8, 6, 5, 4, 3].map(Encoding::Grid)) {
            let bytes = match encode(&scene, &EncodeOptions::uniform(encoding)) {
                Ok(bytes) => bytes,
                // Values beyond the range of a grid of few bits are an error, never clamped.
                Err(Error::Overflow { value, largest, .. }) => {
                    assert!(matches!(encoding, Encoding::Grid(_)) && value.abs() > largest, "{encoding:?}");
                    continue;
                }
                Err(error) => panic!("{encoding:?}: {error}"),
            };
            let read = decode(&bytes).unwrap();
            let largest_error =
                (read.scales[0].factors.density[0].values.iter().zip(&scene.scales[0].factors.density[0].values))
                    .map(|(r, s)| (f64::from(*r) - f64::from(*s)).abs())
                    .fold(0.0, f64::max);
            // A quantizer's finest step is 2^-24.
            let allowed = match encoding {
                Encoding::F32 | Encoding::F16 => 0.0,
                Encoding::Grid(bits) => (1.1 * largest / f64::from((1 << (bits - 1)) - 1)).max(6e-8),
            };
            assert!(largest_error <= allowed, "{encoding:?}, {largest:e}: {largest_error:e} > {allowed:e}");
            if encoding == Encoding::F16 {
                within(&format!("factors of ±{largest:e}"), &read, &rays, Way::ALL, 1.0);
            }
        }
    }
}

#[test]
fn a_saturated_decoder_stays_between_0_and_1() {
    for mode in DecoderMode::ALL {
        for size in [1e2_f32, 1e4, 1e10, 1e19] {
            let mut scene = Made { mode, distance_scale: 2.0, ..Made::default() }.scene(&random);
            for layer in &mut scene.decoder.layers {
                layer.weights.iter_mut().chain(&mut layer.bias).for_each(|w| *w *= size);
            }
            let rays = rays_through(&scene, 60);
            let exact = expected(&scene, &rays);
            for &way in Way::ALL {
                let errors = errors(way, &scene, &rays, &exact);
                println!("| decoder weights times {size:e} | {way:?} | {mode:?} | {} |", errors.row());
                for pixel in way.trace(&scene, &rays) {
                    assert!(pixel.color.iter().all(|c| (-1e-5..=1.0 + 1e-5).contains(c)), "{way:?}: {pixel:?}");
                }
                // With larger weights the smallest rounding error changes the color.
                if size == 1e2 {
                    assert!(errors.clear_maximum() < 100.0 * way.bound(), "{way:?}: {}", errors.row());
                }
            }
        }
    }
}

#[test]
fn features_too_large_for_sines_in_f32_stay_finite() {
    for mode in DecoderMode::ALL {
        for size in [1e3, 1e6, 1e12] {
            let root = f64::cbrt(size);
            let scene = Made { mode, distance_scale: 2.0, ..Made::default() }.scene_with(&random, &|_, _, n| root * n);
            let rays = rays_through(&scene, 40);
            let exact = expected(&scene, &rays);
            for &way in Way::ALL {
                let errors = errors(way, &scene, &rays, &exact);
                println!("| features near {size:e} | {way:?} | {mode:?} | {} |", errors.row());
                // Out of the range of 16 bits.
                if way.bound() <= 1e-3 {
                    assert!(errors.clear_maximum() <= 1e-3, "{way:?}, {mode:?}: {}", errors.row());
                }
                for pixel in way.trace(&scene, &rays) {
                    assert!(pixel.color.iter().all(|c| (-1e-5..=1.0 + 1e-5).contains(c)), "{way:?}: {pixel:?}");
                }
            }
        }
    }
}

#[test]
fn factors_whose_products_overflow_f32_give_finite_pixels() {
    let signs = [
        |_: usize, r: usize, _: f64| if r.is_multiple_of(2) { 3e38 } else { -3e38 },
        |v, _, _| if v % 2 == 0 { 3e38 } else { -3e38 },
    ];
    for (kind, of) in KINDS.into_iter().flat_map(|kind| signs.map(|of| (kind, of))) {
        let scene = Made { kind, ranks: [4, 4], ..Made::default() }.scene_with(&of, &of);
        let rays = rays_through(&scene, 40);
        for &way in Way::ALL {
            for pixel in way.trace(&scene, &rays) {
                let numbers = pixel.color.iter().chain([&pixel.opacity, &pixel.depth]);
                assert!(numbers.clone().all(|v| v.is_finite()), "{way:?}: {pixel:?}");
            }
        }
    }
}

#[test]
fn skies_of_every_degree_and_size() {
    let scene_with = |degree, size: f32| {
        let mut scene = Made { distance_scale: 2.0, ..Made::default() }.scene(&random);
        let mut sky = scenes::sky(degree);
        sky.coefficients.iter_mut().for_each(|c| *c *= size);
        scene.rules.sky = Some(sky);
        scene.check().unwrap();
        scene
    };
    for degree in 1..=Sky::MAX_DEGREE {
        for size in [0.0, 1.0, 30.0] {
            let scene = scene_with(degree, size);
            // Half of the rays meet nothing.
            let mut rays = rays_through(&scene, 60);
            rays.extend(rays.clone().iter().map(|ray| Ray { direction: -ray.direction, ..*ray }));
            within(&format!("sky of degree {degree} times {size}"), &scene, &rays, Way::ALL, 1.0);
        }
    }
    let scene = scene_with(2, 1.0);
    let rays = rays_through(&scene, 60);
    let exact = expected(&scene, &rays);
    let mut planted = scene.clone();
    planted.rules.sky.as_mut().unwrap().coefficients[8] += 1.0;
    for &way in Way::ALL {
        assert!(errors(way, &planted, &rays, &exact).clear_maximum() > way.bound(), "{way:?}: another sky");
    }
    // Finite, no more: their sums may cancel.
    for size in [1e20, 1e37] {
        let scene = scene_with(4, size);
        for &way in Way::ALL {
            for pixel in way.trace(&scene, &rays) {
                assert!(pixel.color.iter().all(|c| (-1e-5..=1.0 + 1e-5).contains(c)), "{way:?}: {pixel:?}");
            }
        }
    }
}

/// Terms of a thousand that cancel: f32 does not resolve their sum, as the reference's condition shows.
#[test]
fn errors_of_canceling_factors_are_within_their_condition() {
    let size = 10.0;
    let of = |_: usize, r: usize, normal: f64| if r.is_multiple_of(2) { size } else { -size } + 1e-3 * normal;
    let scene = Made { ranks: [256, 3], mode: DecoderMode::PerSample, ..Made::default() }.scene_with(&of, &random);
    let rays = rays_through(&scene, 200);
    let exact = expected(&scene, &rays);
    let mut bad = 0;
    for (way, epsilon) in [(Way::CpuF64, f64::EPSILON), (Way::CpuF32, f64::from(f32::EPSILON))] {
        for (e, f) in exact.iter().zip(way.trace(&scene, &rays)) {
            let error = (0..3).map(|c| (e.color[c] - f64::from(f.color[c])).abs()).fold(0.0, f64::max);
            if e.margin > way.position_error(&scene) {
                assert!(error < 1e-5 + 4.0 * epsilon * e.condition, "{way:?}: {error} at condition {}", e.condition);
                bad += usize::from(e.condition > 1e4);
            }
        }
    }
    assert!(bad > 20, "{bad} rays are badly conditioned");
    let plain = Made::default().scene(&random);
    let conditions = expected(&plain, &rays_through(&plain, 100));
    assert!(conditions.iter().all(|t| t.condition < 300.0));
}

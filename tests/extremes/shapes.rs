//! Scenes of extreme scale, position, shape and size.

use glam::DVec3;
use strivec_format::model::{DecoderMode, FactorKind, Scene};

use super::compare::{Way, rays_through, within};
use super::made::{KINDS, Made, lattice, moved, random};

fn ordinary(kind: FactorKind, mode: DecoderMode) -> Scene {
    let centers = lattice([4, 4, 4], DVec3::splat(0.4));
    let made =
        Made { centers, half: DVec3::splat(0.3), step: 0.02, distance_scale: 3.0, kind, mode, ..Made::default() };
    made.scene(&random)
}

/// Vectors in all modes, and matrices in one: decoders are the same.
fn kinds_and_modes() -> impl Iterator<Item = (FactorKind, DecoderMode)> {
    let vectors = DecoderMode::ALL.map(|mode| (FactorKind::Cp, mode));
    vectors.into_iter().chain([(FactorKind::Vm, DecoderMode::PerSample)])
}

#[test]
fn world_scales_from_a_millionth_to_a_million_give_the_same_picture() {
    for (kind, factor) in KINDS.into_iter().flat_map(|kind| [1e-6, 1e-3, 1.0, 1e3, 1e6].map(|factor| (kind, factor))) {
        let scene = moved(ordinary(kind, DecoderMode::PerSample), factor, DVec3::ZERO);
        within(&format!("{kind:?}, world scale {factor:e}"), &scene, &rays_through(&scene, 400), Way::ALL, 1.0);
    }
}

#[test]
fn scenes_a_million_units_from_the_origin_give_the_same_picture() {
    for (kind, mode) in kinds_and_modes() {
        let scene = moved(ordinary(kind, mode), 1.0, DVec3::new(1e6, -1e6, 1e6));
        within("1e6 from the origin", &scene, &rays_through(&scene, 400), Way::ALL, 1.0);
    }
}

#[test]
fn slivers_of_one_to_a_thousand_give_the_same_picture() {
    for (n, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
        let thin = DVec3::ONE - 0.999 * axis;
        let centers = lattice([4, 4, 4], 0.4 * thin);
        let made = Made { centers, half: 0.3 * thin, step: 0.002, distance_scale: 30.0, ..Made::default() };
        let scene = made.scene(&random);
        within(&format!("sliver across axis {n}"), &scene, &rays_through(&scene, 300), Way::ALL, 1.0);
        // A needle: thin on the two other axes, many tensors long.
        let needle = 0.001 * DVec3::ONE + 0.999 * axis;
        let counts = [axis.x, axis.y, axis.z].map(|a| if a > 0.0 { 2000 } else { 2 });
        let centers = lattice(counts, 0.001 * DVec3::ONE);
        let made = Made {
            centers,
            half: DVec3::splat(7.5e-4),
            resolution: [2; 3],
            step: 2e-4,
            distance_scale: 500.0,
            ..Made::default()
        };
        let scene = made.scene(&random);
        let mut rays = rays_through(&scene, 300);
        // Rays begin close to the needle, where f32 positions are precise.
        for ray in &mut rays {
            let [entry, _] = scene.bounds.intersect(ray).map_or([0.0; 2], |(a, b)| [a, b]);
            ray.origin = ray.at(entry - 0.01);
        }
        let mut scene = scene;
        scene.frame.far = 0.1;
        within(&format!("needle along axis {n}, {needle}"), &scene, &rays, Way::ALL, 3.0);
    }
}

#[test]
fn one_tensor_and_the_largest_and_smallest_ranks_and_resolutions() {
    for (kind, mode) in kinds_and_modes() {
        for (ranks, resolution) in [([1, 1], 2), ([512, 512], 2), ([1, 1], 1024), ([256, 3], 4), ([3, 256], 1)] {
            let made = Made { kind, ranks, resolution: [resolution; 3], mode, step: 0.03, ..Made::default() };
            // Sums of many products have the same size as sums of few.
            let factors = if kind == FactorKind::Cp { 3.0 } else { 2.0 };
            let share = f64::from(ranks[0]).powf(-0.5 / factors);
            let scene = made.scene(&|_, _, normal| 0.9 * share * normal);
            within(
                &format!("{kind:?}, rank {ranks:?}, resolution {resolution}"),
                &scene,
                &rays_through(&scene, 200),
                Way::ALL,
                1.0,
            );
        }
    }
}

#[test]
fn a_million_tensors_give_the_same_picture() {
    let centers = lattice([100, 100, 100], DVec3::splat(0.02));
    let made = Made {
        centers,
        half: DVec3::splat(0.015),
        resolution: [2; 3],
        ranks: [1, 1],
        step: 0.005,
        distance_scale: 5.0,
        ..Made::default()
    };
    let scene = made.scene(&random);
    within("a million tensors", &scene, &rays_through(&scene, 300), Way::ALL, 2.0);
}

#[test]
fn constant_zero_and_alternating_factors() {
    type Of = fn(usize, usize, f64) -> f64;
    let cases: [(&str, Of); 5] = [
        ("constant factors", |_, _, _| 1.0),
        ("zero factors", |_, _, _| 0.0),
        ("negative zero factors", |_, _, _| -0.0),
        ("factors that alternate by vertex", |v, _, _| if v % 2 == 0 { 1.0 } else { -1.0 }),
        ("factors that alternate by component", |_, r, _| if r % 2 == 0 { 1.0 } else { -1.0 }),
    ];
    for (name, of) in cases {
        for (kind, mode) in kinds_and_modes() {
            let made = Made { kind, ranks: [16, 16], resolution: [31; 3], mode, step: 0.03, ..Made::default() };
            let scene = made.scene_with(&of, &of);
            within(name, &scene, &rays_through(&scene, 200), Way::ALL, 1.0);
        }
    }
}

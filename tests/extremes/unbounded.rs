//! Contracted scenes (spec 4.9): cameras in the inner cube, in its shell and very far away, samples at 1e6 units, rays
//! along faces.

use glam::{DVec3, UVec3};
use strivec_format::geometry::{Aabb, Contraction, Ray};
use strivec_format::model::{DecoderMode, Occupancy, Scene};

use super::compare::{Way, errors, expected, within};
use super::made::{Made, lattice, random};

const PAPER: Contraction = Contraction { shell: 0.4 };

/// Tensors that fill all of contracted space. Half of its cells are empty.
fn scene(mode: DecoderMode) -> Scene {
    let made = Made {
        centers: lattice([4; 3], DVec3::splat(0.77)),
        half: DVec3::splat(0.57),
        mode,
        step: 0.02,
        distance_scale: 1.0,
        ..Made::default()
    };
    let mut scene = made.scene(&random);
    scene.bounds = PAPER.bounds();
    scene.rules.contraction = Some(PAPER);
    (scene.frame.near, scene.frame.far) = (0.01, 1e9);
    let mut occupancy = Occupancy::empty(scene.bounds.grown(DVec3::splat(0.017)), UVec3::splat(30));
    for n in 0..27_000 {
        let vertex = UVec3::new(n % 30, n / 30 % 30, n / 900);
        if (vertex / 5).element_sum().is_multiple_of(3) {
            occupancy.set(vertex);
        }
    }
    scene.occupancy = Some(occupancy);
    scene.check().expect("a valid scene");
    scene
}

/// `count` rays from `distance` units, half of them toward the inner cube, half anywhere.
fn rays(count: usize, distance: f64) -> Vec<Ray> {
    let point = |n: usize, shift: f64| {
        let part = |g: f64| (n as f64 * g + shift).fract() - 0.5;
        DVec3::new(part(0.819_172_513_4), part(0.671_043_606_7), part(0.549_700_477_9))
    };
    (0..count)
        .map(|n| {
            let origin = distance * (point(n, 0.71) + 1e-3).normalize();
            let toward = if n % 2 == 0 { 1.6 * point(n, 0.37) - origin } else { point(n, 0.13) };
            Ray { origin, direction: toward.normalize() }
        })
        .collect()
}

#[test]
fn cameras_anywhere_see_the_references_picture() {
    for mode in DecoderMode::ALL {
        let scene = scene(mode);
        for distance in [0.5, 1.3, 3.0, 30.0, 1e3, 1e6] {
            within(&format!("contracted, from {distance:e} units"), &scene, &rays(200, distance), Way::ALL, 1.0);
        }
    }
}

#[test]
fn a_shell_of_another_width_is_another_picture() {
    let scene = scene(DecoderMode::PerSample);
    let mut planted = scene.clone();
    planted.rules.contraction = Some(Contraction { shell: 0.5 });
    planted.bounds = Contraction { shell: 0.5 }.bounds();
    planted.check().unwrap();
    let rays = rays(200, 1.3);
    let exact = expected(&scene, &rays);
    for &way in Way::ALL {
        let apart = |scene: &Scene| {
            let found = way.trace(scene, &rays);
            let pairs = exact.iter().zip(&found).filter(|(e, _)| e.margin > way.position_error(scene));
            pairs.map(|(e, f)| (e.color[0] - f64::from(f.color[0])).abs()).fold(0.0, f64::max)
        };
        assert!(apart(&scene) <= way.bound() && apart(&planted) > way.bound(), "{way:?}");
    }
}

#[test]
fn rays_along_faces_and_axes_are_finite() {
    let scene = scene(DecoderMode::PerSample);
    let mut rays = Vec::new();
    for corner in [DVec3::ONE, DVec3::new(1.0, 0.25, 0.5), DVec3::new(1.0, 1.0, 0.0), DVec3::splat(1.4), DVec3::ZERO] {
        for direction in [DVec3::X, DVec3::NEG_Y, DVec3::Z, DVec3::ONE.normalize(), DVec3::new(0.0, -0.6, 0.8)] {
            rays.push(Ray { origin: corner - 4.0 * direction, direction });
            rays.push(Ray { origin: corner, direction });
        }
    }
    let exact = expected(&scene, &rays);
    for &way in Way::ALL {
        let errors = errors(way, &scene, &rays, &exact);
        println!("| contracted, along faces | {way:?} | {:?} | {} |", scene.decoder.mode, errors.row());
        assert!(errors.clear_maximum() <= way.bound(), "{way:?}: {}", errors.row());
    }
}

#[test]
fn the_depth_of_a_wall_is_its_distance() {
    for wall in [0.5, 3.0, 20.0, 1e3, 1e6] {
        let mut scene = scene(DecoderMode::PerSample);
        scene.rules.step = 1e-3;
        scene.rules.distance_scale = 1e6;
        // Only what lies beyond the wall counts.
        let face = PAPER.contract(wall * DVec3::X).x;
        let bounds = Aabb { min: DVec3::new(face, -2.0, -2.0), max: DVec3::new(2.0 * 1.4 - face, 2.0, 2.0) };
        let mut occupancy = Occupancy::empty(bounds, UVec3::splat(2));
        occupancy.words[0] = 0xff;
        scene.occupancy = Some(occupancy);
        let origin = DVec3::new(-0.3, 0.2, 0.1);
        let ray = Ray { origin, direction: DVec3::new(1.0, 0.1, -0.05).normalize() };
        let distance = (wall - origin.x) / ray.direction.x;
        let exact = expected(&scene, &[ray])[0];
        // A step of the spacing parameter there, and the rounding of the face.
        let step = scene.rules.step * (1.0 + wall * wall / 2.9) + 1e-15 * wall * wall;
        assert!((exact.depth - distance).abs() <= step, "wall at {wall:e}: {} for {distance}", exact.depth);
        for &way in Way::ALL {
            let found = f64::from(way.trace(&scene, &[ray])[0].depth);
            let rounding = way.rounding() * 30.0 * wall * wall;
            assert!((found - exact.depth).abs() <= step + rounding, "{way:?}, wall at {wall:e}: {found}");
        }
    }
}

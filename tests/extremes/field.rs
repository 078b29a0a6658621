//! The field where its pieces meet: centers, faces, edges, corners, vertices, ties.
//!
//! A ray with a single sample evaluates one point in any renderer. All points and boxes are exact in f32, so
//! differences come from the field's arithmetic alone.

use glam::DVec3;
use strivec_format::geometry::{Aabb, Ray};
use strivec_format::model::{DecoderMode, FactorKind, ReferenceField, Scene};

use super::compare::{Way, expected};
use super::made::{KINDS, Made, random};

/// The distance of the sample of [`probe`], in model units.
const NEAR: f64 = 1.0;

/// The ray whose only sample is at `point`.
fn probe(point: DVec3) -> Ray {
    Ray { origin: point - NEAR * DVec3::X, direction: DVec3::X }
}

/// Five tensors with centers at distance 1 from the origin, and a sixth that overlaps no other.
fn scene(kind: FactorKind, mode: DecoderMode) -> Scene {
    let mut centers = vec![DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z];
    centers.push(DVec3::new(0.0, 0.0, 6.0));
    let made = Made {
        centers,
        half: DVec3::new(1.5, 1.25, 1.75),
        step: 64.0,
        distance_scale: 1.0 / 128.0,
        kind,
        mode,
        ..Made::default()
    };
    let mut scene = made.scene(&random);
    scene.bounds = Aabb { min: DVec3::splat(-16.0), max: DVec3::splat(16.0) };
    scene.frame.near = NEAR;
    scene.frame.far = 2.0;
    scene.check().unwrap();
    scene
}

/// One step of f32 up or down; at 0, a step that is small beside positions near 1.
fn stepped(v: f64, direction: i32) -> f64 {
    let step = 2.0_f64.powi(-40);
    match (v as f32, direction) {
        (0.0, d) => f64::from(d) * step,
        (v, 1) => v.next_up().into(),
        (v, -1) => v.next_down().into(),
        (v, _) => v.into(),
    }
}

/// Points with names, each with the points one step of f32 to either side.
fn points(scene: &Scene) -> Vec<(String, DVec3)> {
    let half = scene.scales[0].cloud.half_edge;
    let mut named: Vec<(String, DVec3)> = Vec::new();
    for center in [DVec3::X, DVec3::NEG_Y, DVec3::new(0.0, 0.0, 6.0)] {
        // Center, the centers of faces, of edges, and corners.
        for code in 0..27 {
            let at = DVec3::new(f64::from(code % 3 - 1), f64::from(code / 3 % 3 - 1), f64::from(code / 9 - 1));
            named.push((format!("{center} + {at} half edges"), center + at * half));
        }
        for part in [0.5, 0.25, 0.125, -0.75] {
            named.push((format!("{center}: {part} of the box"), center + part * half));
        }
    }
    named.push(("five at equal distances".into(), DVec3::ZERO));
    named.push(("two at equal distances".into(), DVec3::new(0.25, 0.25, 0.5)));
    named.push(("covered by one alone".into(), DVec3::new(0.25, 0.5, 6.5)));
    named.push(("covered by none".into(), DVec3::new(0.0, 9.0, 0.0)));
    let beside = |(name, p): &(String, DVec3)| {
        let mut around = vec![(name.clone(), *p)];
        for a in 0..3 {
            for d in [-1, 1] {
                let mut q = *p;
                q[a] = stepped(q[a], d);
                around.push((format!("{name}, axis {a} by {d}"), q));
            }
        }
        for d in [-1, 1] {
            around.push((format!("{name}, all by {d}"), DVec3::from_array(p.to_array().map(|v| stepped(v, d)))));
        }
        around
    };
    named.iter().flat_map(beside).collect()
}

/// True if `found` is the reference's value at `point` or, if a decision is closer than f32 resolves, at a displacement
/// of the position error.
fn agrees(scene: &Scene, point: DVec3, found: [f32; 4], bound: f64) -> bool {
    const BESIDE: f64 = 1e-6;
    let margin = ReferenceField::new(scene).locate(point).margin;
    let codes = if margin < BESIDE { 27 } else { 1 };
    let steps =
        (0..codes).map(|n| DVec3::new([0.0, 1.0, -1.0][n % 3], [0.0, 1.0, -1.0][n / 3 % 3], [0.0, 1.0, -1.0][n / 9]));
    let rays: Vec<Ray> = steps.map(|step| probe(point + BESIDE * step)).collect();
    expected(scene, &rays).iter().any(|e| {
        let values = [e.color[0], e.color[1], e.color[2], e.opacity];
        values.iter().zip(found).all(|(e, f)| (e - f64::from(f)).abs() < bound)
    })
}

/// The names of the points at which `way` on `planted` disagrees with the reference on `scene`.
fn disagreements(scene: &Scene, planted: &Scene, way: Way, bound: f64) -> Vec<String> {
    let points = points(scene);
    let rays: Vec<Ray> = points.iter().map(|(_, p)| probe(*p)).collect();
    let found = way.trace(planted, &rays);
    let wrong = points.iter().zip(found).filter(|((_, point), found)| {
        let [r, g, b] = found.color;
        !agrees(scene, *point, [r, g, b, found.opacity], bound)
    });
    wrong.map(|((name, _), _)| name.clone()).collect()
}

#[test]
fn every_renderer_agrees_on_centers_faces_edges_corners_vertices_and_ties() {
    for (kind, mode) in KINDS.into_iter().flat_map(|kind| DecoderMode::ALL.map(|mode| (kind, mode))) {
        let scene = scene(kind, mode);
        for &way in Way::ALL {
            let bound = way.bound().max(1e-6);
            let wrong = disagreements(&scene, &scene, way, bound);
            assert!(wrong.is_empty(), "{way:?}, {kind:?}, {mode:?}: {wrong:?}");
        }
        let mut planted = scene.clone();
        planted.scales[0].cloud.half_edge.x -= 0.03125;
        let wrong = disagreements(&scene, &planted, Way::CpuF32, Way::CpuF32.bound());
        assert!(wrong.len() > 8, "boxes a little smaller go unnoticed: {wrong:?}");
    }
}

/// Decisions at faces are exact in f32, not only up to a displacement.
#[test]
fn boxes_are_closed_in_every_precision() {
    let scene = scene(FactorKind::Cp, DecoderMode::PerSample);
    let (center, half) = (DVec3::new(0.0, 0.0, 6.0), scene.scales[0].cloud.half_edge);
    for a in 0..3 {
        for side in [-1.0, 1.0] {
            let mut face = center;
            face[a] += side * half[a];
            let mut beyond = face;
            beyond[a] = stepped(face[a], side as i32);
            for &way in Way::ALL {
                let [on, off] = [face, beyond].map(|p| way.trace(&scene, &[probe(p)])[0].opacity);
                assert!(on > 1e-3 && off == 0.0, "{way:?}, axis {a}, side {side}: {on}, {off}");
            }
        }
    }
}

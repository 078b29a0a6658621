//! Splats: what readers find in the files of every format, and colors by direction.

use crate::scenes;

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use glam::{DQuat, DVec3};
use strivec_export::{Error, Mesh, Space, Splats, SurfaceOptions, surface, write_sog, write_splats, write_spz};
use strivec_field::Field;
use strivec_field::render::CpuRenderer;
use strivec_format::color::byte;
use strivec_format::geometry::{Ray, Similarity};
use strivec_format::model::{DecoderMode, Scene};
use strivec_import::testing::{Seen, seen_with};
use strivec_import::{ReadOptions, ply, splats};

/// A scene whose tensors are a ball of random densities, turned and moved in dataset space.
fn scene() -> Scene {
    let mut config = scenes::config();
    config.decoder.mode = DecoderMode::PerRay;
    let mut scene = scenes::scene(&config);
    scene.frame.model_from_dataset = Similarity {
        scale: 0.5,
        rotation: DQuat::from_rotation_y(0.4) * DQuat::from_rotation_x(-1.1),
        translation: DVec3::new(0.3, -0.2, 0.1),
    };
    scene
}

fn mesh_of(scene: &Scene) -> Mesh {
    surface(scene, &SurfaceOptions { resolution: 40, alpha: 0.02, ..SurfaceOptions::default() }, &|_, _| {}).unwrap()
}

fn splats_of(scene: &Scene, mesh: &Mesh, degree: u32) -> Splats {
    Splats::with_harmonics(mesh, scene, Space::Dataset, degree, &|_, _| {}).unwrap()
}

/// Fails unless `check` fails, on a planted difference.
fn notices(check: impl FnOnce()) {
    assert!(catch_unwind(AssertUnwindSafe(check)).is_err(), "a planted difference goes unnoticed");
}

fn ply_of(splats: &Splats) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_splats(splats, &mut bytes).unwrap();
    bytes
}

fn spz_of(splats: &Splats) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_spz(splats, &mut bytes).unwrap();
    bytes
}

fn sog_of(splats: &Splats) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    write_sog(splats, &mut out).unwrap();
    out.into_inner()
}

#[test]
fn splats_lie_flat_on_the_surface() {
    let mesh = mesh_of(&scene());
    let seen = seen_with(&ply_of(&Splats::new(&mesh)), &ReadOptions::default(), ply::read).unwrap();
    let check = |mesh: &Mesh| {
        assert_eq!(seen.splats.len(), mesh.positions.len());
        let mut area = 0.0;
        for (n, (center, axes)) in seen.splats.iter().enumerate() {
            assert!((center.position - mesh.positions[n]).length() < 1e-6);
            let color = mesh.colors[n].map(|value| byte(value.into()));
            assert!((0..3).all(|c| center.color.unwrap()[c].abs_diff(color[c]) <= 1), "{center:?}, not {color:?}");
            assert!(axes[2].normalize().dot(mesh.normals[n]) > 1.0 - 1e-5, "the short axis is the normal");
            assert!(axes[2].length() < 0.2 * axes[0].length());
            // Two standard deviations of half an edge each.
            area += axes[0].length() * axes[1].length();
        }
        area
    };
    let area: f64 = check(&mesh);
    let mut planted = mesh.clone();
    planted.normals.iter_mut().for_each(|n| *n = DVec3::new(n.y, n.x, n.z));
    notices(|| assert!(check(&planted) > 0.0));
    planted = Mesh { normals: mesh.normals.clone(), ..planted };
    planted.positions.rotate_left(1);
    notices(|| assert!(check(&planted) > 0.0));
    let corners = |triangle: &[u32; 3]| triangle.map(|n| mesh.positions[n as usize]);
    let exact: f64 = mesh.triangles.iter().map(corners).map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum();
    assert!((area / exact - 1.0).abs() < 1e-3, "{area} of {exact}");
}

/// Fails unless the splats of `found` are those of `expected` in any order: centers within `center`, axes within the share
/// `axis` of the longest one, colors within `color`.
fn check_same(expected: &Seen, found: &Seen, center: f64, axis: f64, color: u8) {
    assert_eq!(found.splats.len(), expected.splats.len(), "the number of splats");
    let sorted = |seen: &Seen| {
        let mut splats = seen.splats.clone();
        splats.sort_by(|(a, _), (b, _)| a.position.x.total_cmp(&b.position.x));
        splats
    };
    let found = sorted(found);
    for (point, axes) in &expected.splats {
        let first = found.partition_point(|(other, _)| other.position.x < point.position.x - center);
        let near = found[first..].iter().take_while(|(other, _)| other.position.x <= point.position.x + center);
        let is_same = |(other, other_axes): &&(strivec_import::Point, [DVec3; 3])| {
            let longest = axes.iter().map(|axis| axis.length()).fold(0.0, f64::max);
            let off = |n: usize| axes[n].distance(other_axes[n]).min(axes[n].distance(-other_axes[n]));
            let (a, b) = (point.color.unwrap(), other.color.unwrap());
            point.position.distance(other.position) <= center
                && (0..3).all(|n| off(n) <= axis * longest && a[n].abs_diff(b[n]) <= color)
        };
        assert!(near.clone().any(|other| is_same(&other)), "{point:?} {axes:?}: {:?}", near.collect::<Vec<_>>());
    }
}

#[test]
fn spz_and_sog_hold_the_splats_of_ply() {
    let scene = scene();
    let mesh = mesh_of(&scene);
    let options = ReadOptions::default();
    let half_turn = |mut seen: Seen| {
        let turn = |v: DVec3| DVec3::new(v.x, -v.y, -v.z);
        for (center, axes) in &mut seen.splats {
            center.position = turn(center.position);
            *axes = axes.map(turn);
        }
        seen
    };
    for degree in [0, 3] {
        let splats = splats_of(&scene, &mesh, degree);
        let expected = seen_with(&ply_of(&splats), &options, ply::read).unwrap();
        let spz = half_turn(seen_with(&spz_of(&splats), &options, splats::read_spz).unwrap());
        let sog = seen_with(&sog_of(&splats), &options, splats::read_sog).unwrap();
        let spacing = expected.splats[0].1[0].length();
        // SPZ: a sixteenth of a mean deviation; half of 1/16 of a logarithm, and ninth bits of components. SOG: 16 bits of
        // logarithms, a codebook, and bytes of components.
        for (found, center, axis) in [(&spz, 0.05 * spacing, 0.04), (&sog, 1e-4, 0.12)] {
            check_same(&expected, found, center, axis, 2);
            let plant = |change: fn(&mut (strivec_import::Point, [DVec3; 3]))| {
                let mut planted = Seen { splats: found.splats.clone(), ..Seen::default() };
                planted.splats.iter_mut().step_by(7).for_each(change);
                notices(|| check_same(&expected, &planted, center, axis, 2));
            };
            plant(|(point, _)| point.position.z += 0.05);
            plant(|(_, axes)| axes.rotate_left(1));
            plant(|(point, _)| point.color = Some([255, 0, 255]));
        }
    }
}

#[test]
fn equal_splats_give_equal_bytes() {
    let scene = scene();
    let mesh = mesh_of(&scene);
    let splats = splats_of(&scene, &mesh, 1);
    assert_eq!(splats.len(), mesh.positions.len());
    assert_eq!(spz_of(&splats), spz_of(&splats_of(&scene, &mesh, 1)));
    assert_eq!(sog_of(&splats), sog_of(&splats_of(&scene, &mesh, 1)));
}

/// \[splat\] the coefficients of red, green and blue, in the order of the file: those of degree 0 and 45 more.
fn coefficients(ply: &[u8]) -> Vec<[[f32; 16]; 3]> {
    let start = ply.windows(11).position(|bytes| bytes == b"end_header\n").unwrap() + 11;
    let number = |record: &[u8], n: usize| f32::from_le_bytes(record[4 * n..][..4].try_into().unwrap());
    ply[start..]
        .chunks_exact(4 * 62)
        .map(|record| {
            let of = |c: usize, k: usize| number(record, if k == 0 { 6 + c } else { 9 + 15 * c + k - 1 });
            std::array::from_fn(|c| std::array::from_fn(|k| of(c, k)))
        })
        .collect()
}

/// The color by the constants of the reference implementation (`utils/sh_utils.py`).
fn evaluated(coefficients: &[[f32; 16]; 3], DVec3 { x, y, z }: DVec3) -> [f64; 3] {
    let basis = [
        0.28209479177387814,
        -0.4886025119029199 * y,
        0.4886025119029199 * z,
        -0.4886025119029199 * x,
        1.0925484305920792 * x * y,
        -1.0925484305920792 * y * z,
        0.31539156525252005 * (2.0 * z * z - x * x - y * y),
        -1.0925484305920792 * x * z,
        0.5462742152960396 * (x * x - y * y),
        -0.5900435899266435 * y * (3.0 * x * x - y * y),
        2.890611442640554 * x * y * z,
        -0.4570457994644658 * y * (4.0 * z * z - x * x - y * y),
        0.3731763325901154 * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y),
        -0.4570457994644658 * x * (4.0 * z * z - x * x - y * y),
        1.445305721320277 * z * (x * x - y * y),
        -0.5900435899266435 * x * (x * x - 3.0 * y * y),
    ];
    coefficients.map(|of_channel| 0.5 + of_channel.iter().zip(basis).map(|(&c, y)| f64::from(c) * y).sum::<f64>())
}

#[test]
fn harmonics_follow_the_decoder_better_with_each_degree() {
    let scene = scene();
    let mesh = mesh_of(&scene);
    let map = scene.frame.model_from_dataset;
    let mut field = Field::<f32>::new(&scene).unwrap();
    (field.background, field.rules.min_weight, field.near_far[0]) = ([0.0; 3], 0.0, 0.0);
    let distance = 2.0 * field.rules.step;
    let renderer = CpuRenderer::from_field(field);
    let rays: Vec<Ray> = (mesh.positions.iter().zip(&mesh.normals))
        .map(|(&point, &normal)| {
            let normal = (map.rotation * normal).normalize();
            Ray { origin: map.point(point) + distance * normal, direction: -normal }
        })
        .collect();
    // Directions from outside, in dataset space: those between a normal and a few others.
    let seen = |n: usize| {
        let tilt = [DVec3::X, DVec3::NEG_Y, DVec3::new(0.5, 0.5, -0.5)][n % 3];
        (-mesh.normals[n] + 0.6 * tilt).normalize()
    };
    let directions: Vec<DVec3> = (0..rays.len()).map(seen).collect();
    let exact: Vec<[f64; 3]> = (rays.iter().zip(&directions))
        .map(|(ray, &direction)| {
            let toward = move |_: &Ray, _: usize| (map.rotation * direction).normalize();
            let pixel = renderer.trace_toward(&[*ray], 1, &toward)[0];
            pixel.color.map(|value| f64::from((value / pixel.opacity.max(1e-6)).clamp(0.0, 1.0)))
        })
        .collect();
    let error = |degree: u32, direction: &dyn Fn(usize) -> DVec3| {
        let found = coefficients(&ply_of(&splats_of(&scene, &mesh, degree)));
        assert_eq!(found.len(), exact.len());
        assert!(found.iter().flatten().all(|c| c[(degree as usize + 1).pow(2)..].iter().all(|&value| value == 0.0)));
        let off = |n: usize| {
            let color = evaluated(&found[n], direction(n));
            (0..3).map(|c| (color[c] - exact[n][c]).powi(2)).sum::<f64>()
        };
        ((0..exact.len()).map(off).sum::<f64>() / exact.len() as f64).sqrt()
    };
    let errors = [0, 1, 2, 3].map(|degree| error(degree, &|n| directions[n]));
    assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{errors:?}");
    assert!(errors[3] < 0.4 * errors[0], "{errors:?}");
    let planted = error(3, &|n| DVec3::new(directions[n].y, directions[n].z, directions[n].x));
    assert!(planted > 1.5 * errors[3], "another direction has another color: {planted}, {errors:?}");
}

#[test]
fn splats_that_a_format_cannot_hold_are_refused() {
    let scene = scene();
    let mut mesh = mesh_of(&scene);
    let refused = Splats::with_harmonics(&mesh, &scene, Space::Dataset, 4, &|_, _| {}).unwrap_err();
    assert_eq!(refused.to_string(), "`harmonics` must be 0 to 3; found 4");
    mesh.positions[3].y = -9e6;
    let error = write_spz(&Splats::new(&mesh), Vec::new()).unwrap_err();
    assert!(matches!(error, Error::TooFar { found, .. } if found == 9e6), "{error}");
    mesh.positions[3].y = -8e6;
    write_spz(&Splats::new(&mesh), Vec::new()).unwrap();
}

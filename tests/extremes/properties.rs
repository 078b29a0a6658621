//! The contract as properties of any scene (proptest): what must not change the picture.

use glam::{DQuat, DVec3};
use proptest::prelude::*;
use strivec::container::{EncodeOptions, Encoding, decode, encode};
use strivec::model::{DecoderMode, Placement, Scene};
use strivec::render::{CpuRenderer, ReferenceRenderer, Renderer};

use super::compare::{Way, rays_through};
use super::made::{Made, moved, random};

fn any_mode() -> impl Strategy<Value = DecoderMode> {
    prop::sample::select(DecoderMode::ALL.to_vec())
}

/// A scene of up to a dozen tensors, anywhere in a box.
fn any_scene() -> impl Strategy<Value = Scene> {
    let center = prop::array::uniform3(-1.0..1.0).prop_map(DVec3::from_array);
    (prop::collection::vec(center, 1..12), prop::array::uniform3(0.2..0.8), 1u32..5, 1u32..7, any_mode()).prop_map(
        |(centers, half, top_k, resolution, mode)| {
            let half = DVec3::from_array(half);
            let made = Made {
                centers,
                half,
                top_k,
                mode,
                resolution: [resolution, 3, 2],
                distance_scale: 3.0,
                ..Made::default()
            };
            made.scene(&random)
        },
    )
}

/// The largest difference on rays that are clear in both, of the same rays seen in two scenes.
fn apart(one: &Scene, other: &Scene, map: impl Fn(DVec3) -> DVec3, way: Way) -> f64 {
    let rays = rays_through(one, 40);
    let mapped: Vec<_> = rays
        .iter()
        .map(|r| {
            let (origin, to) = (map(r.origin), map(r.origin + r.direction));
            strivec::geometry::Ray { origin, direction: (to - origin).normalize() }
        })
        .collect();
    let reference = ReferenceRenderer::new(one);
    let limit = way.position_error(one).max(1e-9);
    let pairs = way.trace(one, &rays).into_iter().zip(way.trace(other, &mapped));
    (rays.iter().zip(pairs))
        .filter(|(ray, _)| reference.trace_one(ray).margin > limit)
        .flat_map(|(_, (a, b))| (0..3).map(move |c| f64::from((a.color[c] - b.color[c]).abs())))
        .fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn moving_and_scaling_the_world_changes_no_picture(
        scene in any_scene(),
        power in -6.0..6.0f64,
        offset in prop::array::uniform3(-100.0..100.0f64),
    ) {
        let (factor, offset) = (10.0_f64.powf(power), DVec3::from_array(offset));
        let offset = factor * offset;
        let other = moved(scene.clone(), factor, offset);
        for (way, bound) in [(Way::CpuF64, 1e-6), (Way::CpuF32, 4e-4)] {
            let found = apart(&scene, &other, |p| factor * p + offset, way);
            prop_assert!(found < bound, "{way:?}: {found} at {factor:e}, {offset}");
        }
    }

    #[test]
    fn chunks_and_the_order_in_a_file_change_no_bit(scene in any_scene(), most in 1usize..5) {
        let whole = EncodeOptions { zstd_level: None, ..EncodeOptions::uniform(Encoding::F32) };
        let cut = EncodeOptions { chunk_tensors: most, ..whole.clone() };
        let read = decode(&encode(&scene, &cut).unwrap()).unwrap();
        prop_assert!(read == decode(&encode(&scene, &whole).unwrap()).unwrap());
        let rays = rays_through(&scene, 40);
        prop_assert!(CpuRenderer::new(&scene).trace(&rays) == CpuRenderer::new(&read).trace(&rays));
    }

    #[test]
    fn the_order_of_tensors_changes_no_picture_and_only_one_is_a_scene(scene in any_scene(), swap in 0usize..64) {
        let mut permuted = scene.clone();
        let scale = &mut permuted.scales[0];
        let count = scale.cloud.len();
        let (a, b) = (swap % count, swap / 8 % count);
        prop_assume!(a != b);
        let Placement::Explicit { centers } = &mut scale.cloud.placement else { panic!("explicit centers") };
        centers.swap(a, b);
        for factors in [&mut scale.factors.density, &mut scale.factors.appearance] {
            let len = factors.len() / count;
            (0..len).for_each(|n| factors.swap(a * len + n, b * len + n));
        }
        // No order but the canonical one is a scene; were it one, clear rays would see the same but for the order of sums.
        prop_assert!(permuted.check().unwrap_err().expected.contains("ascending"));
        for (way, bound) in [(Way::CpuF64, 1e-6), (Way::CpuF32, 2e-4)] {
            let found = apart(&scene, &permuted, |p| p, way);
            prop_assert!(found < bound, "{way:?}: {found}");
        }
    }

    #[test]
    fn units_and_axes_of_the_dataset_change_no_picture(scene in any_scene(), scale in 1e-3..1e3f64, angle in -3.0..3.0f64) {
        // The frame alone says how the dataset lies: what is in the model does not move.
        let mut other = scene.clone();
        let map = &mut other.frame.model_from_dataset;
        map.scale = scale;
        map.rotation = DQuat::from_rotation_z(angle);
        other.frame.meters_per_unit = Some(scale);
        let rays = rays_through(&scene, 40);
        prop_assert!(CpuRenderer::new(&scene).trace(&rays) == CpuRenderer::new(&other).trace(&rays));
        // A camera comes to the same place through either frame.
        let map = other.frame.model_from_dataset;
        let camera = crate::scenes::camera(4, angle);
        let back = camera.mapped(&map.inverse()).mapped(&map);
        prop_assert!((back.position - camera.position).length() < 1e-9);
    }

    #[test]
    fn no_number_of_threads_changes_a_bit(scene in any_scene(), threads in 1usize..7) {
        let rays = rays_through(&scene, 600);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| CpuRenderer::new(&scene).trace(&rays))
        };
        prop_assert!(on(threads) == on(2));
    }
}

/// What the properties compare with is seen to fail.
#[test]
fn a_planted_difference_is_one() {
    let scene = Made { distance_scale: 3.0, ..Made::default() }.scene(&random);
    let mut planted = scene.clone();
    planted.rules.distance_scale *= 1.01;
    assert!(apart(&scene, &planted, |p| p, Way::CpuF32) > 4e-4);
}

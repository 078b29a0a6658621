//! Properties of any scene (proptest): changes of the scene that must not change the picture.

use glam::{DQuat, DVec3};
use proptest::prelude::*;
use strivec_capture::dataset::{LoadOptions, load_transforms_cameras};
use strivec_field::render::{CpuRenderer, ReferenceRenderer, Renderer};
use strivec_format::container::{EncodeOptions, Encoding, decode, encode};
use strivec_format::geometry::{Camera, Ray, Similarity};
use strivec_format::model::{DecoderMode, Placement, Scene};

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
            Ray { origin, direction: (to - origin).normalize() }
        })
        .collect();
    let limit = way.position_error(one).max(1e-9);
    largest_difference([one, other], [&rays, &mapped], way, limit)
}

/// The largest difference of color between two scenes, each seen along its own rays, on rays whose decision margin in
/// the first scene is above `limit`, in model units.
fn largest_difference(scenes: [&Scene; 2], rays: [&[Ray]; 2], way: Way, limit: f64) -> f64 {
    let reference = ReferenceRenderer::new(scenes[0]);
    let pairs = way.trace(scenes[0], rays[0]).into_iter().zip(way.trace(scenes[1], rays[1]));
    (rays[0].iter().zip(pairs))
        .filter(|(ray, _)| reference.trace_one(ray).margin > limit)
        .flat_map(|(_, (a, b))| (0..3).map(move |c| f64::from((a.color[c] - b.color[c]).abs())))
        .fold(0.0, f64::max)
}

/// The largest difference on clear rays between a camera in the model's space, and the same camera written to a
/// `transforms.json` in the space of a dataset, `dataset_from_model` away, read back, and mapped into the model's space
/// by the frame's `model_from_dataset`: the way of `strivec render --cameras`.
fn apart_through_datasets(scene: &Scene, dataset_from_model: &Similarity, model_from_dataset: &Similarity) -> f64 {
    let mut other = scene.clone();
    other.frame.model_from_dataset = *model_from_dataset;
    let camera = crate::scenes::camera(6, 0.7);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("transforms_test.json");
    let matrix: Vec<Vec<f64>> = camera.mapped(dataset_from_model).pose().chunks(4).map(<[f64]>::to_vec).collect();
    let json = serde_json::json!({
        "fl_x": camera.focal[0],
        "fl_y": camera.focal[1],
        "w": camera.width,
        "h": camera.height,
        "frames": [{ "file_path": "0", "transform_matrix": matrix }],
    });
    std::fs::write(&file, json.to_string()).unwrap();
    let read = load_transforms_cameras(&file, None, &LoadOptions::default()).unwrap().remove(0).camera;
    let mapped = read.mapped(&other.frame.model_from_dataset);

    let rays_of = |camera: &Camera| -> Vec<_> {
        (0..camera.height)
            .flat_map(|row| (0..camera.width).map(move |column| camera.ray(column, row).unwrap()))
            .collect()
    };
    largest_difference([scene, &other], [&rays_of(&camera), &rays_of(&mapped)], Way::CpuF64, 1e-9)
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
        prop_assert!(CpuRenderer::unlimited(&scene).trace(&rays) == CpuRenderer::unlimited(&read).trace(&rays));
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
        for factors in [&mut scale.factors.density[0].values, &mut scale.factors.appearance[0].values] {
            let len = factors.len() / count;
            (0..len).for_each(|n| factors.swap(a * len + n, b * len + n));
        }
        // Only the canonical order is a valid scene. In another order, clear rays would differ only by the order of
        // sums.
        prop_assert!(permuted.check().unwrap_err().expected.contains("ascending"));
        for (way, bound) in [(Way::CpuF64, 1e-6), (Way::CpuF32, 2e-4)] {
            let found = apart(&scene, &permuted, |p| p, way);
            prop_assert!(found < bound, "{way:?}: {found}");
        }
    }

    #[test]
    fn units_and_axes_of_the_dataset_change_no_picture(scene in any_scene(), scale in 1e-3..1e3f64, angle in -3.0..3.0f64) {
        let dataset = Similarity {
            scale,
            rotation: DQuat::from_rotation_z(angle) * DQuat::from_rotation_x(0.5 * angle),
            translation: scale * DVec3::new(3.0, -1.0, 2.0),
        };
        let found = apart_through_datasets(&scene, &dataset, &dataset.inverse());
        prop_assert!(found < 1e-6, "{found} at {scale:e}, {angle}");
    }

    #[test]
    fn no_number_of_threads_changes_a_bit(scene in any_scene(), threads in 3usize..8) {
        let rays = rays_through(&scene, 600);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| CpuRenderer::unlimited(&scene).trace(&rays))
        };
        let alone = on(1);
        prop_assert!(on(threads) == alone);
        prop_assert!(on(2) == alone);
    }
}

/// The comparisons of the properties fail on a planted difference.
#[test]
fn a_planted_difference_is_one() {
    let scene = Made { distance_scale: 3.0, ..Made::default() }.scene(&random);
    let mut planted = scene.clone();
    planted.rules.distance_scale *= 1.01;
    assert!(apart(&scene, &planted, |p| p, Way::CpuF32) > 4e-4);

    let dataset = Similarity { scale: 2.0, rotation: DQuat::from_rotation_z(0.3), translation: DVec3::X };
    assert!(apart_through_datasets(&scene, &dataset, &dataset.inverse()) < 1e-6);
    let off_by_a_percent = Similarity { scale: 1.01 * dataset.inverse().scale, ..dataset.inverse() };
    assert!(apart_through_datasets(&scene, &dataset, &off_by_a_percent) > 1e-4);
}

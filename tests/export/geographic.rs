//! Exports of a scene millions of units from the origin, as in UTM coordinates: they hold what the same scene's exports near
//! the origin hold, moved.

use crate::formats::{Read, mesh_of, notices, options, read_glb, scene, seen};

use std::collections::HashSet;
use std::io::Cursor;

use glam::DVec3;
use strivec_export::{
    CoarseCoordinates, Mesh, OccupancyOptions, Space, Splats, write_factors, write_glb, write_obj, write_occupancy,
    write_ply, write_splats,
};
use strivec_format::geometry::Similarity;
use strivec_format::model::Scene;
use strivec_import::testing::Seen;
use strivec_import::{arrays, obj, ply};

/// East, north and height of the scene's middle.
const PLACE: DVec3 = DVec3::new(500_000.0, 5_000_000.0, 300.0);
/// The error of f64 at [`PLACE`], after a few operations.
const WIDE_ERROR: f64 = 2e-8;
/// The error of f32 within the scene.
const NARROW_ERROR: f64 = 5e-7;

/// The scene of all tests, moved to `place` in dataset space.
fn scene_at(place: DVec3) -> Scene {
    let mut scene = scene();
    let map = scene.frame.model_from_dataset;
    scene.frame.model_from_dataset = Similarity { translation: map.point(-place), ..map };
    scene
}

/// The number of different values on each axis.
fn distinct(positions: &[DVec3]) -> [usize; 3] {
    let values = |axis: usize| positions.iter().map(|p| p[axis].to_bits()).collect::<HashSet<_>>().len();
    [0, 1, 2].map(values)
}

/// The corners of all triangles, or the points.
fn positions(seen: &Seen) -> Vec<DVec3> {
    seen.triangles.iter().flatten().chain(&seen.points).map(|point| point.position).collect()
}

/// Fails unless the positions `far` are those `near`, moved by `by`.
fn check_places(near: &[DVec3], far: &[DVec3], by: DVec3, error: f64) {
    assert_eq!(far.len(), near.len(), "numbers of coordinates");
    let largest = near.iter().zip(far).map(|(near, far)| (near + by).distance(*far)).fold(0.0, f64::max);
    assert!(largest < error, "moved by another {largest}");
}

/// [`check_places`], and fails unless as many coordinates `far` differ.
fn check_moved(near: &[DVec3], far: &[DVec3], by: DVec3, error: f64) {
    check_places(near, far, by, error);
    for (far, near) in distinct(far).into_iter().zip(distinct(near)) {
        assert!(far * 100 >= near * 99, "{far} different coordinates of {near}");
    }
}

#[test]
fn a_surface_far_away_is_the_same_surface_moved() {
    let [near, far] = [DVec3::ZERO, PLACE].map(|place| mesh_of(&scene_at(place), &options()));
    assert_eq!((&near.triangles, near.colors.len()), (&far.triangles, far.colors.len()));
    check_places(&near.positions, &far.positions, PLACE, WIDE_ERROR);
}

#[test]
fn meshes_and_points_far_away_read_back_with_their_digits() {
    let [near, far] = [DVec3::ZERO, PLACE].map(|place| mesh_of(&scene_at(place), &options()));
    type Write = fn(&Mesh, &mut Vec<u8>);
    let formats: [(&str, Write, Read); 4] = [
        ("mesh as ply", |mesh, out| write_ply(mesh, out).unwrap(), ply::read),
        ("obj", |mesh, out| write_obj(mesh, out).unwrap(), obj::read),
        ("glb", |mesh, out| write_glb(mesh, DVec3::Z, out).unwrap(), read_glb),
        (
            "points as ply",
            |mesh, out| write_ply(&Mesh { triangles: Vec::new(), ..mesh.clone() }, out).unwrap(),
            ply::read,
        ),
    ];
    for (name, write, read) in formats {
        // The node of a glTF file turns z to y.
        let by = if name == "glb" { DVec3::new(PLACE.x, PLACE.z, -PLACE.y) } else { PLACE };
        let [near, far] = [&near, &far].map(|mesh| {
            let mut bytes = Vec::new();
            write(mesh, &mut bytes);
            positions(&seen(&bytes, read))
        });
        println!("{name}: {:?} of {:?} coordinates differ", distinct(&far), distinct(&near));
        check_moved(&near, &far, by, NARROW_ERROR);
        let rounded: Vec<DVec3> = far.iter().map(|p| p.as_vec3().as_dvec3()).collect();
        notices(|| check_moved(&near, &rounded, by, NARROW_ERROR));
        notices(|| check_moved(&near, &rounded, by, 1.0));
    }
}

#[test]
fn the_node_of_a_glb_far_away_is_a_translation_in_32_bits_and_that_of_others_has_none() {
    let json = |place: DVec3| {
        let mut bytes = Vec::new();
        write_glb(&mesh_of(&scene_at(place), &options()), DVec3::Z, &mut bytes).unwrap();
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        serde_json::from_slice::<serde_json::Value>(&bytes[20..20 + length]).unwrap()
    };
    assert_eq!(json(DVec3::ZERO)["nodes"][0].get("translation"), None);
    let far = json(PLACE);
    let translation = far["nodes"][0]["translation"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap());
    let translation: Vec<f64> = translation.collect();
    assert!(translation.iter().all(|&v| f64::from(v as f32) == v), "{translation:?}");
    let largest = ["min", "max"].map(|end| far["accessors"][0][end].as_array().unwrap().clone()).concat();
    assert!(largest.iter().all(|v| v.as_f64().unwrap().abs() < 3.0), "{largest:?}");
}

#[test]
fn the_loss_of_formats_of_32_bits_is_stated() {
    let [near, far] = [DVec3::ZERO, PLACE].map(scene_at);
    for space in [Space::Dataset, Space::Model] {
        assert_eq!(CoarseCoordinates::of_scene(&near, space), None);
    }
    assert_eq!(CoarseCoordinates::of_scene(&far, Space::Model), None);
    let stated = CoarseCoordinates::of_scene(&far, Space::Dataset).expect("a loss");
    assert!(stated.bounds.contains(PLACE) && stated.middle().distance(PLACE) < 1.5, "{stated:?}");
    let mesh = mesh_of(&far, &options());
    assert_eq!(mesh_of(&near, &options()).coarse_coordinates(), None);
    let CoarseCoordinates { spacing, .. } = mesh.coarse_coordinates().expect("a loss");
    assert_eq!((spacing, stated.spacing), (0.5, 0.5));
    let mut bytes = Vec::new();
    write_splats(&Splats::new(&mesh), &mut bytes).unwrap();
    let found = seen(&bytes, ply::read).splats;
    let errors = mesh.positions.iter().zip(&found).map(|(expected, (center, _))| (expected - center.position).abs());
    let largest = errors.fold(DVec3::ZERO, DVec3::max).max_element();
    assert!((0.2..=0.25).contains(&largest), "{largest}");
}

#[test]
fn an_occupancy_far_away_has_the_cells_of_the_same_occupancy_moved() {
    let cells = |place: DVec3| -> Vec<DVec3> {
        let mut out = Cursor::new(Vec::new());
        let options = OccupancyOptions { resolution: Some(30), space: Space::Dataset };
        write_occupancy(&scene_at(place), &options, &mut out).unwrap();
        seen(out.get_ref(), arrays::read).cells.iter().flat_map(|cell| [cell.min, cell.max]).collect()
    };
    let [near, far] = [DVec3::ZERO, PLACE].map(cells);
    assert!(near.len() > 1000, "{}", near.len());
    check_moved(&near, &far, PLACE, WIDE_ERROR);
}

#[test]
fn arrays_are_in_model_space_wherever_the_scene_is() {
    let arrays = |place: DVec3| {
        let mut out = Cursor::new(Vec::new());
        write_factors(&scene_at(place), &mut out).unwrap();
        out.into_inner()
    };
    assert!(arrays(DVec3::ZERO) == arrays(PLACE));
}

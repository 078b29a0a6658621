//! Exports: the surface is where the field has it, and files read back by this project's own readers hold what was
//! written.

use crate::scenes;

use std::collections::HashMap;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use glam::{DQuat, DVec3, UVec3};
use strivec_checkpoints::torch;
use strivec_checkpoints::{Value, write_checkpoint};
use strivec_export::{
    DvgoOptions, Error, Mesh, OccupancyOptions, Space, SurfaceOptions, dvgo_checkpoint, surface, write_glb, write_obj,
    write_occupancy, write_ply,
};
use strivec_format::color::byte;
use strivec_format::geometry::{Aabb, Similarity};
use strivec_format::model::{Occupancy, ReferenceField, Scene};
use strivec_import::testing::{Seen, seen_with};
use strivec_import::{Fault, Input, ReadOptions, Visitor, arrays, gltf, obj, ply};

pub(super) type Read = fn(&mut Input<'_>, &ReadOptions, &mut dyn Visitor) -> Result<(), Fault>;

pub(super) fn read_glb(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    gltf::read(input, &|name| Err(Fault::broken(name, "no other file is needed")), options, visitor)
}

pub(super) fn seen(bytes: &[u8], read: Read) -> Seen {
    seen_with(bytes, &ReadOptions::default(), read).unwrap()
}

/// A scene whose tensors are a ball of random densities, turned and moved in dataset space.
pub(super) fn scene() -> Scene {
    let mut scene = scenes::scene(&scenes::config());
    scene.frame.model_from_dataset = Similarity {
        scale: 0.5,
        rotation: DQuat::from_rotation_y(0.4) * DQuat::from_rotation_x(-1.1),
        translation: DVec3::new(0.3, -0.2, 0.1),
    };
    scene
}

pub(super) fn options() -> SurfaceOptions {
    SurfaceOptions { resolution: 40, alpha: 0.02, ..SurfaceOptions::default() }
}

pub(super) fn mesh_of(scene: &Scene, options: &SurfaceOptions) -> Mesh {
    surface(scene, options, &|_, _| {}).unwrap()
}

/// Fails unless `check` fails, on a planted difference.
pub(super) fn notices(check: impl FnOnce()) {
    assert!(catch_unwind(AssertUnwindSafe(check)).is_err(), "a planted difference goes unnoticed");
}

/// Fails unless each side of a triangle is a side of exactly one other, in the other direction.
fn check_closed(mesh: &Mesh) {
    let mut sides: HashMap<[u32; 2], u32> = HashMap::new();
    for triangle in &mesh.triangles {
        (0..3).for_each(|n| *sides.entry([triangle[n], triangle[(n + 1) % 3]]).or_default() += 1);
    }
    for ([a, b], count) in &sides {
        assert_eq!((*count, sides.get(&[*b, *a])), (1, Some(&1)), "the side from {a} to {b}");
    }
}

/// Fails unless, half a `cell` of tensors' space behind and before its triangles, the opacities of march steps are above
/// and below that of the surface. Few are not, where the field bends within a cell.
fn check_sides(scene: &Scene, mesh: &Mesh, cell: f64) {
    let field = ReferenceField::new(scene);
    let alpha = |point: DVec3| {
        let located = field.locate(point);
        if !scene.bounds.contains(point) || !field.occupied(point).0 || !located.covered {
            return 0.0;
        }
        let density = field.density(field.density_feature(&located).feature);
        1.0 - (-scene.rules.optical_depth(density)).exp()
    };
    let in_model = |n: u32| scene.frame.model_from_dataset.point(mesh.positions[n as usize]);
    let (mut right, mut count) = (0, 0);
    for triangle in mesh.triangles.iter().step_by(7) {
        let [a, b, c] = triangle.map(|n| scene.rules.contracted(in_model(n)));
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let [inside, outside] = [-0.5, 0.5].map(|h| alpha((a + b + c) / 3.0 + h * cell * normal));
        right += u32::from(inside > options().alpha) + u32::from(outside < options().alpha);
        count += 2;
    }
    assert!(count > 300 && right * 100 > count * 90, "{right} of {count}");
}

#[test]
fn a_surface_is_closed_and_has_the_opacity_of_the_field_inside_and_outside() {
    let scene = scene();
    let mesh = mesh_of(&scene, &options());
    let cell = scene.bounds.size().max_element() / 40.0;
    let check_normals = |mesh: &Mesh| {
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|n| mesh.positions[n as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            assert!(triangle.iter().any(|&n| mesh.normals[n as usize].dot(normal) > -1e-6), "{triangle:?}");
        }
    };
    check_closed(&mesh);
    check_sides(&scene, &mesh, cell);
    check_normals(&mesh);
    let mut open = mesh.clone();
    open.triangles.pop();
    notices(|| check_closed(&open));
    let mut turned = mesh.clone();
    turned.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    notices(|| check_sides(&scene, &turned, cell));
    notices(|| check_normals(&turned));
    let mut moved = mesh;
    moved.positions.iter_mut().for_each(|position| position.x += 3.0 * cell);
    notices(|| check_sides(&scene, &moved, cell));
}

#[test]
fn colors_are_those_of_the_decoder_in_their_order() {
    let mut scene = scene();
    let last = scene.decoder.layers.last_mut().unwrap();
    last.weights.fill(0.0);
    let expected = [0.9_f32, 0.4, 0.1];
    last.bias = expected.map(|value| (value / (1.0 - value)).ln()).to_vec();
    let mesh = mesh_of(&scene, &options());
    let is_right = |color: &&[f32; 3]| (0..3).all(|c| (color[c] - expected[c]).abs() < 1e-3);
    let right = mesh.colors.iter().filter(is_right).count();
    assert_eq!(right, mesh.colors.len(), "{:?}", &mesh.colors[..4]);
    let reversed: Vec<[f32; 3]> = mesh.colors.iter().map(|&[r, g, b]| [b, g, r]).collect();
    assert_eq!(reversed.iter().filter(is_right).count(), 0, "planted: channels in another order");
}

#[test]
fn spaces_differ_by_the_map_of_the_frame() {
    let scene = scene();
    let mesh = mesh_of(&scene, &options());
    let in_model = mesh_of(&scene, &SurfaceOptions { space: Space::Model, ..options() });
    assert_eq!((&mesh.triangles, &mesh.colors), (&in_model.triangles, &in_model.colors));
    let map = scene.frame.model_from_dataset;
    let check = |map: &Similarity| {
        for n in 0..mesh.positions.len() {
            assert!((map.point(mesh.positions[n]) - in_model.positions[n]).length() < 1e-12);
            assert!((map.rotation * mesh.normals[n] - in_model.normals[n]).length() < 1e-12);
        }
    };
    check(&map);
    notices(|| check(&Similarity { rotation: map.rotation * DQuat::from_rotation_z(1e-6), ..map }));
    notices(|| check(&Similarity { scale: 0.5 + 1e-9, ..map }));
}

#[test]
fn small_parts_are_removed_as_a_whole() {
    let scene = scene();
    let all = mesh_of(&scene, &options());
    let sizes = sizes_of_parts(&all);
    assert!(sizes.len() > 3, "{sizes:?}");
    let limit = sizes[sizes.len() / 2];
    let kept = mesh_of(&scene, &SurfaceOptions { min_triangles: limit, ..options() });
    check_closed(&kept);
    assert_eq!(sizes_of_parts(&kept), sizes.into_iter().filter(|size| *size >= limit).collect::<Vec<_>>());
    let used = kept.triangles.iter().flatten().collect::<std::collections::HashSet<_>>().len();
    assert_eq!(used, kept.positions.len(), "no vertex is left over");
}

/// The numbers of triangles of the connected parts, ascending.
fn sizes_of_parts(mesh: &Mesh) -> Vec<u32> {
    let mut part: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    loop {
        let before = part.clone();
        for triangle in &mesh.triangles {
            let least = triangle.iter().map(|&n| part[n as usize]).min().unwrap();
            triangle.iter().for_each(|&n| part[n as usize] = least);
        }
        if part == before {
            break;
        }
    }
    let mut sizes = HashMap::<u32, u32>::new();
    mesh.triangles.iter().for_each(|triangle| *sizes.entry(part[triangle[0] as usize]).or_default() += 1);
    let mut sizes: Vec<u32> = sizes.into_values().collect();
    sizes.sort_unstable();
    sizes
}

#[test]
fn an_unbounded_scene_is_its_inner_cube_or_is_mapped_back() {
    let scene = scenes::contracted(scenes::scene(&scenes::config()));
    let options = SurfaceOptions { space: Space::Model, ..options() };
    let reach = |mesh: &Mesh| mesh.positions.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    let inner = mesh_of(&scene, &options);
    check_closed(&inner);
    assert!((0.9..1.1).contains(&reach(&inner)), "{}", reach(&inner));
    let all = mesh_of(&scene, &SurfaceOptions { surroundings: true, resolution: 80, ..options });
    check_closed(&all);
    assert!((1.5..=64.0 + 1e-6).contains(&reach(&all)), "{}", reach(&all));
    check_sides(&scene, &all, scene.bounds.size().max_element() / 80.0);
    // The triangles beyond the inner cube alone.
    let is_beyond = |n: &u32| all.positions[*n as usize].abs().max_element() > 1.2;
    let triangles = all.triangles.iter().copied().filter(|triangle| triangle.iter().all(is_beyond)).collect();
    check_sides(&scene, &Mesh { triangles, ..all.clone() }, scene.bounds.size().max_element() / 80.0);
}

#[test]
fn meshes_and_clouds_read_back() {
    let scene = scene();
    let mesh = mesh_of(&scene, &options());
    let mut files: [Vec<u8>; 3] = Default::default();
    write_ply(&mesh, &mut files[0]).unwrap();
    write_obj(&mesh, &mut files[1]).unwrap();
    write_glb(&mesh, DVec3::Z, &mut files[2]).unwrap();
    let reads: [Read; 3] = [ply::read, obj::read, read_glb];
    // The node of a glTF file turns z to y.
    let turned = DQuat::from_rotation_arc(DVec3::Z, DVec3::Y);
    for ((bytes, read), turn) in files.iter().zip(reads).zip([DQuat::IDENTITY, DQuat::IDENTITY, turned]) {
        let seen = seen(bytes, read);
        let check = |mesh: &Mesh| {
            assert_eq!(seen.triangles.len(), mesh.triangles.len());
            for (found, expected) in seen.triangles.iter().zip(&mesh.triangles) {
                for (corner, &n) in found.iter().zip(expected) {
                    assert!((corner.position - turn * mesh.positions[n as usize]).length() < 1e-6);
                    let color = mesh.colors[n as usize].map(|value| byte(value.into()));
                    let found = corner.color.expect("a color");
                    assert!((0..3).all(|c| found[c].abs_diff(color[c]) <= 1), "{found:?}, not {color:?}");
                }
            }
        };
        check(&mesh);
        let mut planted = mesh.clone();
        planted.positions.iter_mut().for_each(|p| *p = DVec3::new(p.y, p.x, p.z));
        notices(|| check(&planted));
        planted.positions.clone_from(&mesh.positions);
        planted.colors.iter_mut().for_each(|color| color.swap(0, 2));
        notices(|| check(&planted));
    }
    let mut bytes = Vec::new();
    write_ply(&Mesh { triangles: Vec::new(), ..mesh.clone() }, &mut bytes).unwrap();
    let cloud = seen(&bytes, ply::read);
    assert_eq!((cloud.points.len(), cloud.triangles.len()), (mesh.positions.len(), 0));
}

#[test]
fn an_occupancy_reads_back_as_the_scenes_own_cells() {
    let mut scene = scenes::scene(&scenes::config());
    let mut own = Occupancy::empty(scene.bounds.grown(DVec3::splat(0.1)), UVec3::new(20, 21, 19));
    let vertices = (0..20 * 21 * 19).map(|n| UVec3::new(n % 20, n / 20 % 21, n / 420));
    vertices.filter(|vertex| vertex.element_sum() % 7 == 0).for_each(|vertex| own.set(vertex));
    scene.occupancy = Some(own.clone());
    let map = Similarity { scale: 0.5, rotation: DQuat::IDENTITY, translation: DVec3::new(0.3, -0.2, 0.1) };
    scene.frame.model_from_dataset = map;
    let written = |scene: &Scene, resolution| {
        let options = OccupancyOptions { resolution, space: Space::Dataset };
        let mut out = Cursor::new(Vec::new());
        let grid = write_occupancy(scene, &options, &mut out).unwrap();
        let seen = seen(out.get_ref(), arrays::read);
        assert_eq!(seen.cells.len() as u64, grid.occupied);
        seen.cells
    };
    let cells = written(&scene, None);
    let region = scene.bounds.intersection(&scene.scales[0].cloud.bounds());
    let contains = |cells: &[Aabb], point: DVec3| cells.iter().any(|cell| cell.contains(map.inverse().point(point)));
    let check = |cells: &[Aabb]| {
        let mut counts = [0; 2];
        for n in 0..(19 * 20 * 18) {
            let cell = UVec3::new(n % 19, n / 19 % 20, n / 380);
            let middle = own.bounds.min + (cell.as_dvec3() + 0.5) * own.cell_size();
            if region.contains(middle) {
                assert_eq!(contains(cells, middle), own.cell_is_occupied(cell.as_ivec3()), "{cell}");
                counts[usize::from(own.cell_is_occupied(cell.as_ivec3()))] += 1;
            }
        }
        assert!(counts[0] > 10 && counts[1] > 100, "{counts:?}");
    };
    check(&cells);
    let step = cells[0].size() * DVec3::X;
    let moved: Vec<Aabb> = cells.iter().map(|cell| Aabb { min: cell.min + step, max: cell.max + step }).collect();
    notices(|| check(&moved));
    // Turned, and so on cells of its own, it covers all that counts.
    scene.frame.model_from_dataset.rotation = DQuat::from_rotation_z(0.5);
    let cells = written(&scene, Some(30));
    let turned = scene.frame.model_from_dataset.inverse();
    for vertex in own.iter().map(|vertex| own.position(vertex)).filter(|&point| region.contains(point)) {
        assert!(cells.iter().any(|cell| cell.contains(turned.point(vertex))), "{vertex}");
    }
}

#[test]
fn a_dvgo_checkpoint_reads_back_where_the_field_is_dense() {
    let scene = scene();
    let field = ReferenceField::new(&scene);
    let options = DvgoOptions { resolution: 33, space: Space::Dataset };
    let checkpoint = dvgo_checkpoint(&scene, &options, &|_, _| {}).unwrap();
    let bytes = write_checkpoint(Cursor::new(Vec::new()), &checkpoint).unwrap().into_inner();
    let cells = seen(&bytes, torch::read).cells;
    assert!(cells.len() > 1000, "{}", cells.len());
    let edge = cells[0].size();
    assert!(edge.min_element() > 0.95 * edge.max_element(), "{edge}");
    // The opacity over a voxel's edge is at least that of the reader's default.
    let map = scene.frame.model_from_dataset;
    let check = |moved: DVec3| {
        for center in cells.iter().map(|cell| cell.center() + moved) {
            let located = field.locate(map.point(center));
            let density = field.density(field.density_feature(&located).feature);
            let alpha = 1.0 - (-density * scene.rules.distance_scale * edge.x * map.scale).exp();
            assert!(located.covered && alpha > 0.9e-4, "{alpha} at {center}");
        }
    };
    check(DVec3::ZERO);
    notices(|| check(3.0 * edge * DVec3::Y));
}

#[test]
fn a_checkpoint_of_tensorfs_layout_reads_back() {
    // Bits of [z][y][x], the most significant first: (3, 1, 0) and (0, 2, 1) of 4 × 3 × 2.
    let mut bits = [false; 24];
    (bits[7], bits[12 + 8]) = (true, true);
    let packed: Vec<u8> =
        bits.chunks(8).map(|byte| byte.iter().fold(0, |all, &bit| all << 1 | u8::from(bit))).collect();
    let shape = Value::Tuple([1, 1, 2, 3, 4].map(Value::Int).to_vec());
    let root = Value::Dict(vec![
        ("kwargs".into(), Value::Dict(vec![("large".into(), Value::Int(-1 << 40)), ("yes".into(), Value::Bool(true))])),
        ("state_dict".into(), Value::OrderedDict(vec![("n".into(), Value::tensor([], vec![7_i64]))])),
        ("alphaMask.shape".into(), shape),
        ("alphaMask.mask".into(), Value::array([3], packed.clone())),
        ("alphaMask.aabb".into(), Value::tensor([2, 3], vec![0.0_f32, 0.0, 0.0, 3.0, 2.0, 1.0])),
    ]);
    let bytes = write_checkpoint(Cursor::new(Vec::new()), &root).unwrap().into_inner();
    let centers: Vec<_> = seen(&bytes, torch::read).cells.iter().map(|cell| cell.center().to_array()).collect();
    assert_eq!(centers, [[3.0, 1.0, 0.0], [0.0, 2.0, 1.0]]);
    let Value::Dict(mut planted) = root else { unreachable!("a dictionary") };
    let Value::Array(mask) = &mut planted[3].1 else { unreachable!("the mask") };
    mask.numbers = packed.iter().map(|byte: &u8| byte.reverse_bits()).collect::<Vec<u8>>().into();
    let bytes = write_checkpoint(Cursor::new(Vec::new()), &Value::Dict(planted)).unwrap().into_inner();
    let turned: Vec<_> = seen(&bytes, torch::read).cells.iter().map(|cell| cell.center().to_array()).collect();
    assert_ne!(turned, centers, "planted: bits in another order");
    let wrong = Value::tensor([2, 2], vec![0.0_f32; 3]);
    let error = write_checkpoint(Cursor::new(Vec::new()), &wrong).unwrap_err();
    assert_eq!(error.to_string(), "a tensor of shape [2, 2] cannot hold 3 numbers");
}

#[test]
fn wrong_settings_and_empty_surfaces_are_named() {
    let scene = scene();
    let failed = |options: SurfaceOptions| surface(&scene, &options, &|_, _| {}).unwrap_err().to_string();
    let resolution = failed(SurfaceOptions { resolution: 1, ..options() });
    assert_eq!(resolution, "`resolution` must be 2 to 2048; found 1");
    let alpha = failed(SurfaceOptions { alpha: 1.0, ..options() });
    assert_eq!(alpha, "`alpha` must be a number between 0 and 1; found 1");
    let none = surface(&scene, &SurfaceOptions { alpha: 1.0 - 1e-15, ..options() }, &|_, _| {});
    assert!(matches!(none, Err(Error::NoSurface { .. })), "{none:?}");
}

//! Binary glTF 2.0.

use std::borrow::Cow;
use std::io::{self, Write};

use glam::{DQuat, DVec3};
use gltf::binary::{Glb, Header};
use serde_json::{Value, json};

use super::{Error, Mesh};
use strivec_format::geometry::Aabb;

/// glTF's numbers of component types and of buffer view targets.
const USHORT: u32 = 5123;
const UINT: u32 = 5125;
const FLOAT: u32 = 5126;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// Bytes of a vertex, of a triangle, and at most of everything else.
const VERTEX_BYTES: u64 = 32;
const TRIANGLE_BYTES: u64 = 12;
const OTHER_BYTES: u64 = 1 << 16;

/// Writes `mesh` as one binary glTF file: a mesh without lighting (`KHR_materials_unlit`), since its colors are those that
/// the scene shows. Colors are linear, as glTF's are. The vertices keep their axes, and the node turns `up` to glTF's +y. If
/// 32 bits are too few for the positions ([`Mesh::coarse_coordinates`]), they are relative to a place in the middle, to which
/// the node moves them.
///
/// # Errors
///
/// If `out` fails, and [`Error::TooLarge`] for a file of 4 GiB.
pub fn write_glb(mesh: &Mesh, up: DVec3, mut out: impl Write) -> Result<(), Error> {
    let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
    let bytes = VERTEX_BYTES * vertices as u64 + TRIANGLE_BYTES * triangles as u64 + OTHER_BYTES;
    Error::unless_within("bytes of a binary glTF file", u32::MAX.into(), bytes)?;
    let mut binary = Vec::with_capacity(bytes as usize);
    let mut views = Vec::new();
    let mut view = |binary: &[u8], target: u32| {
        let start = views.iter().map(|view: &Value| view["byteLength"].as_u64().unwrap_or(0)).sum::<u64>();
        views.push(
            json!({"buffer": 0, "byteOffset": start, "byteLength": binary.len() as u64 - start, "target": target}),
        );
    };
    let turn = DQuat::from_rotation_arc(up, DVec3::Y);
    // In numbers of 32 bits, since many programs hold transforms so.
    let translation = mesh.coarse_coordinates().map(|coarse| (turn * coarse.middle()).as_vec3().as_dvec3());
    let place = translation.map_or(DVec3::ZERO, |translation| turn.inverse() * translation);
    let mut bounds = Aabb::EMPTY;
    for position in &mesh.positions {
        let position = (position - place).as_vec3();
        bounds = bounds.union(&Aabb::from_points([position.as_dvec3()]));
        binary.extend(position.to_array().map(f32::to_le_bytes).as_flattened());
    }
    view(&binary, VERTICES);
    for normal in &mesh.normals {
        // In f32 unit vectors are as long as glTF requires.
        binary.extend(normal.as_vec3().to_array().map(f32::to_le_bytes).as_flattened());
    }
    view(&binary, VERTICES);
    for &[r, g, b] in &mesh.colors {
        binary.extend([linear(r), linear(g), linear(b), u16::MAX].map(u16::to_le_bytes).as_flattened());
    }
    view(&binary, VERTICES);
    for triangle in &mesh.triangles {
        binary.extend(triangle.map(u32::to_le_bytes).as_flattened());
    }
    view(&binary, INDICES);
    let [min, max] = [bounds.min, bounds.max].map(|corner| corner.to_array());
    let mut node = json!({"mesh": 0, "rotation": turn.to_array()});
    if let Some(translation) = translation {
        node["translation"] = json!(translation.to_array());
    }
    let document = json!({
        "asset": {"version": "2.0", "generator": "strivec"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "materials": [{
            "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1},
            "extensions": {"KHR_materials_unlit": {}},
        }],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2},
            "indices": 3,
            "material": 0,
        }]}],
        "accessors": [
            {"bufferView": 0, "componentType": FLOAT, "count": vertices, "type": "VEC3", "min": min, "max": max},
            {"bufferView": 1, "componentType": FLOAT, "count": vertices, "type": "VEC3"},
            {"bufferView": 2, "componentType": USHORT, "normalized": true, "count": vertices, "type": "VEC4"},
            {"bufferView": 3, "componentType": UINT, "count": 3 * triangles, "type": "SCALAR"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": binary.len()}],
    });
    let glb = Glb {
        header: Header { magic: *b"glTF", version: 2, length: 0 },
        json: Cow::Owned(document.to_string().into_bytes()),
        bin: Some(Cow::Owned(binary)),
    };
    glb.to_writer(&mut out).map_err(|error| match error {
        gltf::Error::Io(error) => error.into(),
        other => Error::Io(io::Error::other(other)),
    })
}

/// The linear value of the sRGB value `value` in \[0, 1\], in units of 1/65535.
fn linear(value: f32) -> u16 {
    let value = f64::from(value);
    let linear = if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) };
    (linear * f64::from(u16::MAX)).round() as u16
}

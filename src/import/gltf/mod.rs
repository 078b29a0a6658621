//! glTF 2 and GLB: the document's parts as `gltf` describes them, their numbers read here.
//!
//! Read: the default scene, else all root nodes, with their transforms; triangles, strips and fans as triangles, points as
//! points; `COLOR_0`, which is linear, as sRGB; sparse, normalized and quantized accessors; buffers in the GLB, in data URIs
//! and in files beside. Lines, materials, textures, cameras, lights, animations, morph targets and skins are passed over (a
//! skinned mesh is read as it stands in the file). Compressed meshes, `EXT_mesh_gpu_instancing` and whatever else the file
//! requires are refused by name. Geometry is handed over in glTF's own space, in which y is up: turning it is the caller's.
//!
//! Of `gltf` only the types of the JSON are used: its own reading panics or sets memory aside on a header's word, its
//! validation panics on a wrong index and refuses attributes of one's own. Held in memory: the JSON and the buffers used.

mod accessor;
mod buffers;
mod container;
mod document;
mod primitive;
mod scene;
#[cfg(test)]
mod tests;

use super::{Fault, Input, ReadOptions, Visitor};
use buffers::Buffers;
pub use buffers::beside;
use document::{Budget, Document};
use primitive::Primitive;

/// Reads `input`; `beside` finds the files that it names.
///
/// # Errors
///
/// If it is not what the format says, and those of `visitor`.
pub fn read(
    input: &mut Input<'_>,
    beside: &dyn Fn(&str) -> Result<Vec<u8>, Fault>,
    options: &ReadOptions,
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    let container::Container { json, blob } = container::read(input)?;
    let document = Document::parse(&json)?;
    drop(json);
    let buffers = Buffers::new(&document, blob, beside);
    let mut budget = Budget::default();
    let mut none = true;
    scene::walk(&document, |index, world| {
        let mesh = document::get(&document.meshes, index, "mesh")?;
        for (n, primitive) in mesh.primitives.iter().enumerate() {
            let place = || format!("primitive {n} of mesh {index}");
            let Some(primitive) = Primitive::of(primitive, &place, &buffers, &mut budget)? else { continue };
            none = false;
            primitive.hand_over(world, options.vertices, &place, &mut budget, input.len(), visitor)?;
            visitor.progress(input.len(), input.len())?;
        }
        Ok(())
    })?;
    if none {
        return Err(Fault::malformed("the scene", "a mesh of triangles or points", "none"));
    }
    Ok(())
}

//! glTF 2 and GLB. The crate `gltf` provides the types of the JSON; the numbers are read here.
//!
//! Read: the default scene, else all root nodes, with their transforms; triangles, strips and fans as triangles, points
//! as points; `COLOR_0`, which is linear, as sRGB; Gaussian splats of `KHR_gaussian_splatting`, also as SPZ; sparse, normalized
//! and quantized accessors; triangles in Draco streams; buffer views compressed by meshoptimizer; buffers in the GLB, in data URIs and in separate files. Lines, materials,
//! textures, cameras, lights, animations, morph targets and skins are ignored: a skinned mesh is read in the pose of the
//! file. `EXT_mesh_gpu_instancing` and other required extensions are errors. Geometry keeps glTF's space, in which y is
//! up; the caller rotates it.
//!
//! Only the JSON types of `gltf` are used: its readers panic on invalid files or allocate what a header declares, and
//! its validation panics on a wrong index and rejects custom attributes. `normalize` removes differences between the
//! format and these types. Memory holds the JSON, the used buffers and what they decompress to.

mod accessor;
mod buffers;
mod container;
mod document;
mod draco;
mod meshopt;
mod normalize;
mod primitive;
mod scene;
mod splats;
#[cfg(test)]
mod tests;

use super::{Fault, Input, ReadOptions, Visitor};
use buffers::Buffers;
use document::{CornerBudget, Document};
use primitive::Primitive;
use splats::SplatPrimitive;

/// Reads `input`; `beside` returns the bytes of the files that it names.
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
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
    let mut budget = CornerBudget::default();
    let mut none = true;
    scene::walk(&document, |index, world| {
        let mesh = document::get(&document.meshes, index, "mesh")?;
        for (n, primitive) in mesh.primitives.iter().enumerate() {
            let place = || format!("primitive {n} of mesh {index}");
            if let Some(splats) = SplatPrimitive::of(primitive, &place, &buffers, &mut budget)? {
                none = false;
                splats.read(world, options, &place, &mut budget, input.len(), visitor)?;
                continue;
            }
            let Some(primitive) = Primitive::of(primitive, &place, &buffers, &mut budget)? else { continue };
            none = false;
            primitive.read(world, options.vertices, &place, &mut budget, input.len(), visitor)?;
            visitor.progress(input.len(), input.len())?;
        }
        Ok(())
    })?;
    if none {
        return Err(Fault::broken("the scene", "it has no mesh of triangles, points or splats"));
    }
    Ok(())
}

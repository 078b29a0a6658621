//! PLY: Stanford's polygon files, meshes and point clouds.
//!
//! The reader is our own, because it streams the body and checks every declared count against the length of the file
//! before it allocates; PLY crates build lists of properties in memory.
//!
//! Read: ASCII and binary of both byte orders, elements in any order, properties in any order and of any type. `vertex`
//! needs `x`, `y` and `z`; its colors are `red`, `green`, `blue` (or `r`…, or `diffuse_red`…) as bytes, or as floats
//! from 0 to 1; other colors are ignored. `face` needs a list `vertex_indices` or `vertex_index`, whose polygons are
//! cut into triangles; `tristrips` has a list `vertex_indices`, in which −1 ends a strip. A file without faces and
//! strips is a point cloud, filtered by `confidence` or `quality`. Vertices with the properties of Gaussian splats,
//! plain or packed, are splats. Everything else is skipped: header lines without a known keyword before the first
//! element, and words after the last property of a line of text. Lines may end in CR alone.
//!
//! Memory holds the vertices of meshes, at the precision of the file, and nothing of point clouds.

mod body;
mod faces;
mod header;
mod splats;
#[cfg(test)]
mod tests;
mod vertices;

use super::{Fault, Input, ReadOptions, Visitor};
use body::BodyReader;
use faces::FaceElement;
use header::{PlyElement, PlyHeader};
use vertices::{VertexProperties, Vertices};

/// Reads `input`.
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let header = PlyHeader::read(input)?;
    let elements = &header.elements;
    let vertex = elements.iter().position(|element| element.name == "vertex");
    let vertex = vertex.ok_or_else(|| Fault::broken("the header", "the element vertex is missing"))?;
    let mut body = BodyReader::new(input, &header);
    if let Some(splats) = splats::SplatProperties::of(&elements[vertex]) {
        return skip_to(vertex, &mut body, elements, visitor)
            .and_then(|()| splats.read(&mut body, &elements[vertex], options, visitor));
    }
    let chunk = elements[..vertex].iter().position(|element| element.name == "chunk");
    if let Some(packed) = splats::PackedSplats::of(&elements[vertex], chunk.map(|chunk| &elements[chunk])) {
        let mut ranges = Vec::new();
        for (n, element) in elements[..vertex].iter().enumerate() {
            if Some(n) == chunk {
                ranges = packed.read_ranges(&mut body, element, visitor)?;
            } else {
                body.skip(element, visitor)?;
            }
        }
        return packed.read(&mut body, &elements[vertex], &ranges, options, visitor);
    }
    let columns = VertexProperties::of(&elements[vertex])?;
    let mut surfaces = Vec::with_capacity(elements.len());
    for element in elements {
        surfaces.push(if options.vertices { None } else { FaceElement::of(element)? });
    }

    let Some(last) = surfaces.iter().rposition(Option::is_some) else {
        skip_to(vertex, &mut body, elements, visitor)?;
        return columns.read_points(&mut body, &elements[vertex], options.min_confidence, visitor);
    };

    // Faces stored before the vertices are read after them.
    let (mut vertices, mut waiting) = (None, Vec::new());
    for (n, element) in elements[..=last.max(vertex)].iter().enumerate() {
        match (&surfaces[n], &vertices) {
            (Some(surface), Some(vertices)) => surface.read(&mut body, element, vertices, visitor)?,
            (Some(surface), None) => {
                waiting.push((surface, element, body.mark()));
                body.skip(element, visitor)?;
            }
            (None, _) if n == vertex => vertices = Some(Vertices::read(&columns, &mut body, element, visitor)?),
            (None, _) => body.skip(element, visitor)?,
        }
    }
    for (surface, element, mark) in waiting {
        body.go_back(&mark)?;
        // The loop above has read the vertices.
        let Some(vertices) = &vertices else { break };
        surface.read(&mut body, element, vertices, visitor)?;
    }
    Ok(())
}

/// Skips the elements before the element `n`.
fn skip_to(
    n: usize,
    body: &mut BodyReader<'_, '_>,
    elements: &[PlyElement],
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    elements[..n].iter().try_for_each(|element| body.skip(element, visitor))
}

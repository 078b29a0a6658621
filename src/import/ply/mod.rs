//! PLY: Stanford's polygon files, meshes and clouds.
//!
//! Read: ASCII and binary of both byte orders, elements in any order, properties in any order and of any type. `vertex` needs
//! `x`, `y` and `z`; its colors are `red`, `green`, `blue` (or `r`…, or `diffuse_red`…) as bytes, or as floats from 0 to 1;
//! other colors are left out. `face` needs a list `vertex_indices` or `vertex_index`, whose polygons are cut into fans;
//! `tristrips` has a list `vertex_indices`, in which −1 ends a strip. A file without faces and strips is a cloud, whose points
//! `confidence` or `quality` may sort out. Everything else is skipped.
//!
//! Held in memory: of meshes the vertices, as exactly as the file has them; of clouds nothing.

mod body;
mod faces;
mod header;
#[cfg(test)]
mod tests;
mod vertices;

use super::{Fault, Input, ReadOptions, Visitor};
use body::Body;
use faces::Surface;
use header::Header;
use vertices::{Columns, Vertices};

/// Reads `input`.
///
/// # Errors
///
/// If it is not what the format says, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let header = Header::read(input)?;
    let elements = &header.elements;
    let vertex = elements.iter().position(|element| element.name == "vertex");
    let vertex = vertex.ok_or_else(|| Fault::malformed("the header", "an element vertex", "none"))?;
    let columns = Columns::of(&elements[vertex])?;
    let mut surfaces = Vec::with_capacity(elements.len());
    for element in elements {
        surfaces.push(if options.vertices { None } else { Surface::of(element)? });
    }
    let mut body = Body::new(input, header.encoding, header.lines);

    let Some(last) = surfaces.iter().rposition(Option::is_some) else {
        for element in &elements[..vertex] {
            body.skip(element, visitor)?;
        }
        return columns.hand_over(&mut body, &elements[vertex], options.min_confidence, visitor);
    };

    // Faces that come before the vertices wait until these are read.
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
        // The loop has passed the vertices.
        let Some(vertices) = &vertices else { break };
        surface.read(&mut body, element, vertices, visitor)?;
    }
    Ok(())
}

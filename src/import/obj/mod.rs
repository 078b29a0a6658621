//! OBJ: Wavefront's meshes, through `tobj`.
//!
//! Read: vertices with their colors (`v x y z r g b`, from 0 to 1), and polygons, cut into triangles. In a mesh whose
//! first vertex has a color, vertices without one are white; if it has none, no vertex has one. A file without polygons
//! is a point cloud of its vertices. Points, lines, normals, texture coordinates, groups and materials are ignored;
//! `mtllib` opens no file. Indices of faces may be positive or negative, but only of earlier vertices.
//! Free-form surfaces are not supported.
//!
//! `tobj` overflows on some indices, assigns colors to wrong vertices if some have none, requires UTF-8 and reports no
//! line numbers. Therefore `guard` checks every statement and passes only valid vertices and polygons to it. `tobj`
//! holds the whole mesh in memory, up to about seven times the file's size; this is the reason for [`MAX_BYTES`].

mod guard;
mod statements;
#[cfg(test)]
mod tests;

use glam::DVec3;

use super::polygon::Triangulator;
use super::{Fault, Input, Point, ReadOptions, Visitor};
use guard::Guard;
use statements::Statements;

/// Bytes of a file with polygons; point clouds may be of any size.
pub const MAX_BYTES: u64 = 4 << 30;
/// Polygons between two reports of progress.
const REPORT_EVERY: usize = 1 << 16;

/// Reads `input`.
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    if options.vertices || !has_polygons(input, visitor)? {
        return read_vertices(input, visitor);
    }
    Fault::unless_within("bytes of an OBJ mesh", MAX_BYTES, input.len())?;
    let mut guard = Guard::new(Statements::from_start(input)?, visitor);
    // `tobj` would cut polygons into fans, which cover dents.
    let polygons = tobj::LoadOptions { triangulate: false, ..tobj::GPU_LOAD_OPTIONS };
    let loaded = tobj::load_obj_buf(&mut guard, &polygons, |_| Err(tobj::LoadError::OpenFileFailed));
    let (models, _) = match (guard.end(), loaded) {
        (Some(fault), _) => return Err(fault),
        (None, Ok(loaded)) => loaded,
        (None, Err(error)) => return Err(Fault::broken("the mesh", error.to_string())),
    };

    let mut triangulator = Triangulator::default();
    let mut count = 0;
    for tobj::Model { mesh, .. } in &models {
        let vertex = |n: u32| {
            let at = 3 * n as usize;
            let three = |values: &[f64]| values.get(at..at + 3).map(DVec3::from_slice);
            let color = three(&mesh.vertex_color).map(statements::color);
            Point::new(three(&mesh.positions).unwrap_or(DVec3::NAN), color, || "a face".into())
        };
        let mut corners = &mesh.indices[..];
        let mut arities = mesh.face_arities.iter();
        let mut polygon = Vec::new();
        while !corners.is_empty() {
            // Meshes of triangles alone have no arities.
            let arity = arities.next().map_or(3, |&arity| arity as usize);
            let own;
            (own, corners) = corners.split_at(arity.min(corners.len()));
            polygon.clear();
            for &corner in own {
                polygon.push(vertex(corner)?);
            }
            let each = |triangle: [usize; 3]| visitor.triangle(triangle.map(|n| polygon[n]));
            triangulator.cut(polygon.len(), |n| polygon[n].position, each)?;
            count += 1;
            if count % REPORT_EVERY == 0 {
                visitor.progress(input.len(), input.len())?;
            }
        }
    }
    Ok(())
}

/// True if there is a face of three or more corners.
fn has_polygons(input: &mut Input<'_>, visitor: &mut dyn Visitor) -> Result<bool, Fault> {
    let mut statements = Statements::from_start(input)?;
    while statements.advance(visitor)? {
        match statements.keyword() {
            b"f" if statements.words().nth(2).is_some() => return Ok(true),
            b"surf" => {
                let what = format!("the free-form surface in line {}", statements.line());
                return Err(Fault::unsupported(what, "export it as polygons"));
            }
            _ => {}
        }
    }
    Ok(false)
}

fn read_vertices(input: &mut Input<'_>, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let mut statements = Statements::from_start(input)?;
    let mut none = true;
    while statements.advance(visitor)? {
        if statements.keyword() == b"v" {
            none = false;
            visitor.point(statements.vertex()?)?;
        }
    }
    if none {
        return Err(Fault::broken("the file", "it has no vertices"));
    }
    Ok(())
}

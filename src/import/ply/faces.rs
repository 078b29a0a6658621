//! The elements `face` and `tristrips`: lists of vertices, cut into triangles while they are read.

use super::super::polygon::{MAX_CORNERS, Triangulator};
use super::super::{Fault, Visitor};
use super::body::BodyReader;
use super::header::{Kind, PlyElement};
use super::vertices::Vertices;

/// An element whose records are lists of corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct FaceElement {
    /// Index of the list property.
    list: usize,
    shape: FaceKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FaceKind {
    /// Polygons.
    Polygon,
    /// Each corner forms a triangle with the previous two, alternately reversed. −1 begins a new strip.
    Strip,
}

impl FaceElement {
    /// The surface of `element`; `None` if it is another element or empty.
    ///
    /// # Errors
    ///
    /// If it is a surface without a list of corners.
    pub(super) fn of(element: &PlyElement) -> Result<Option<Self>, Fault> {
        let (shape, names): (_, &[&str]) = match element.name.as_str() {
            "face" => (FaceKind::Polygon, &["vertex_indices", "vertex_index"]),
            "tristrips" => (FaceKind::Strip, &["vertex_indices"]),
            _ => return Ok(None),
        };
        if element.count == 0 {
            return Ok(None);
        }
        let list = names
            .iter()
            .find_map(|name| element.property(name))
            .filter(|&list| matches!(element.properties[list].kind, Kind::List { item, .. } if item.is_integer()));
        let problem = || format!("the element {} needs a list of integers {}", element.name, names.join(" or "));
        let list = list.ok_or_else(|| Fault::broken("the header", problem()))?;
        Ok(Some(Self { list, shape }))
    }

    /// Reads `element`, whose corners are `vertices`.
    pub(super) fn read(
        &self,
        body: &mut BodyReader<'_, '_>,
        element: &PlyElement,
        vertices: &Vertices,
        visitor: &mut dyn Visitor,
    ) -> Result<(), Fault> {
        let count = vertices.len();
        let (mut corners, mut strip) = (Vec::new(), 0_u64);
        let mut triangulator = Triangulator::default();
        let mut polygon = |corners: &[usize], visitor: &mut dyn Visitor| {
            if !vertices.are_finite(corners) {
                return Ok(());
            }
            let corner = |n: usize| vertices.point(corners[n]);
            let each = |triangle: [usize; 3]| visitor.triangle(triangle.map(corner));
            triangulator.cut(corners.len(), |n| corner(n).position, each)
        };
        body.items(element, self.list, visitor, |visitor, first, index, place| {
            let is_break = self.shape == FaceKind::Strip && index == -1.0;
            if first && self.shape == FaceKind::Polygon {
                polygon(&corners, visitor)?;
            }
            if first || is_break {
                strip = 0;
                corners.clear();
            }
            if is_break {
                return Ok(());
            }
            if index < 0.0 || index >= count as f64 {
                return Err(Fault::malformed(
                    place.to_string(),
                    format!("a vertex index of at least 0 and below {count}"),
                    index,
                ));
            }
            Fault::unless_within("corners of a polygon", MAX_CORNERS as u64, corners.len() as u64)?;
            corners.push(index as usize);
            if self.shape == FaceKind::Polygon {
                return Ok(());
            }
            strip += 1;
            let [a, b, c] = corners[..] else { return Ok(()) };
            corners.remove(0);
            let triangle = if strip % 2 == 1 { [a, b, c] } else { [b, a, c] };
            if !vertices.are_finite(&triangle) {
                return Ok(());
            }
            visitor.triangle(triangle.map(|corner| vertices.point(corner)))
        })?;
        if self.shape == FaceKind::Polygon { polygon(&corners, visitor) } else { Ok(()) }
    }
}

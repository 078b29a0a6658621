//! The elements `face` and `tristrips`: lists of vertices, cut into triangles while they are read.

use super::super::{Fault, Visitor};
use super::body::Body;
use super::header::{Element, Kind};
use super::vertices::Vertices;

/// An element whose records are lists of corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// Index of the list property.
    list: usize,
    shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    /// Polygons: each corner forms a triangle with the previous and the first corner.
    Fan,
    /// Each corner forms a triangle with the previous two, alternately reversed. −1 begins a new strip.
    Strip,
}

/// The last corners of a polygon or strip, and the number of corners so far.
#[derive(Default)]
struct Corners {
    kept: [usize; 2],
    count: u64,
}

impl Surface {
    /// The surface of `element`; `None` if it is another element or empty.
    ///
    /// # Errors
    ///
    /// If it is a surface without a list of corners.
    pub(super) fn of(element: &Element) -> Result<Option<Self>, Fault> {
        let (shape, names): (_, &[&str]) = match element.name.as_str() {
            "face" => (Shape::Fan, &["vertex_indices", "vertex_index"]),
            "tristrips" => (Shape::Strip, &["vertex_indices"]),
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
        let list = list.ok_or_else(|| Fault::invalid("the header", problem()))?;
        Ok(Some(Self { list, shape }))
    }

    /// Reads `element`, whose corners are `vertices`.
    pub(super) fn read(
        &self,
        body: &mut Body<'_, '_>,
        element: &Element,
        vertices: &Vertices,
        visitor: &mut dyn Visitor,
    ) -> Result<(), Fault> {
        let mut corners = Corners::default();
        let count = vertices.len();
        body.items(element, self.list, visitor, |visitor, first, index, place| {
            if first {
                corners.count = 0;
            }
            if self.shape == Shape::Strip && index == -1.0 {
                corners.count = 0;
                return Ok(());
            }
            if index < 0.0 || index >= count as f64 {
                return Err(Fault::malformed(
                    place.to_string(),
                    format!("a vertex index of at least 0 and below {count}"),
                    index,
                ));
            }
            match corners.add(index as usize, self.shape) {
                Some(triangle) => visitor.triangle(triangle.map(|corner| vertices.point(corner))),
                None => Ok(()),
            }
        })
    }
}

impl Corners {
    /// Adds `corner` and returns the triangle that it completes, if any.
    fn add(&mut self, corner: usize, shape: Shape) -> Option<[usize; 3]> {
        self.count += 1;
        if self.count < 3 {
            self.kept[self.count as usize - 1] = corner;
            return None;
        }
        let [a, b] = self.kept;
        match shape {
            Shape::Fan => {
                self.kept = [a, corner];
                Some([a, b, corner])
            }
            Shape::Strip => {
                self.kept = [b, corner];
                Some(if self.count % 2 == 1 { [a, b, corner] } else { [b, a, corner] })
            }
        }
    }
}

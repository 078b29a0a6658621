//! The elements `face` and `tristrips`: lists of vertices, cut into triangles as they are read.

use super::super::{Fault, Visitor};
use super::body::Body;
use super::header::{Element, Kind};
use super::vertices::Vertices;

/// An element of which each record is a list of corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// Which property the list is.
    list: usize,
    shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    /// Polygons: every corner makes a triangle with the one before it and the first.
    Fan,
    /// Every corner makes a triangle with the two before it; every other one is turned round. −1 begins anew.
    Strip,
}

/// The corners so far of one polygon or strip.
#[derive(Default)]
struct Corners {
    kept: [usize; 2],
    count: u64,
}

impl Surface {
    /// The surface that `element` holds; none where it is no such element, or an empty one.
    ///
    /// # Errors
    ///
    /// If it should be one and has no list of corners.
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
        let expected = || format!("a list of integers {} of the element {}", names.join(" or "), element.name);
        let list = list.ok_or_else(|| Fault::malformed("the header", expected(), "none"))?;
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
                return Err(Fault::malformed(place.to_string(), format!("a vertex from 0 to below {count}"), index));
            }
            match corners.add(index as usize, self.shape) {
                Some(triangle) => visitor.triangle(triangle.map(|corner| vertices.point(corner))),
                None => Ok(()),
            }
        })
    }
}

impl Corners {
    /// The triangle that `corner` completes, if it does.
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

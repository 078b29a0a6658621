//! The element `vertex`: passed on as points, or held for the faces that refer to it.

use glam::{DVec3, Vec3};

use super::super::{Fault, Point, Visitor};
use super::body::{BodyOffset, BodyReader};
use super::header::{Kind, PlyElement, PlyScalar};
use strivec_format::color::byte;

/// Names of the three color channels.
const CHANNELS: [[&str; 3]; 3] =
    [["red", "green", "blue"], ["r", "g", "b"], ["diffuse_red", "diffuse_green", "diffuse_blue"]];

/// The used properties of a vertex.
pub(super) struct VertexProperties {
    /// Indices of x, y, z, then of the colors and of the confidence, if there are any.
    wanted: Vec<usize>,
    color: Option<PlyScalar>,
    has_confidence: bool,
    /// True if f32 represents the coordinates exactly.
    narrow: bool,
}

impl VertexProperties {
    /// The used properties of `element`.
    ///
    /// # Errors
    ///
    /// If it has no coordinates.
    pub(super) fn of(element: &PlyElement) -> Result<Self, Fault> {
        let number = |name: &str| {
            let property = element.property(name)?;
            match element.properties[property].kind {
                Kind::Scalar(scalar) => Some((property, scalar)),
                Kind::List { .. } => None,
            }
        };
        let numbers = |names: &[&str; 3]| Some([number(names[0])?, number(names[1])?, number(names[2])?]);
        let position = numbers(&["x", "y", "z"])
            .ok_or_else(|| Fault::broken("the header", "the element vertex needs the numbers x, y and z"))?;
        let color = CHANNELS.iter().filter_map(numbers).find(|channels| {
            let known = matches!(channels[0].1, PlyScalar::U8 | PlyScalar::F32 | PlyScalar::F64);
            known && channels.iter().all(|channel| channel.1 == channels[0].1)
        });
        let confidence = number("confidence").or_else(|| number("quality"));
        let columns = position.iter().chain(color.iter().flatten()).chain(&confidence);
        Ok(Self {
            wanted: columns.map(|(property, _)| *property).collect(),
            color: color.map(|channels| channels[0].1),
            has_confidence: confidence.is_some(),
            narrow: position.iter().all(|(_, scalar)| scalar.fits_f32()),
        })
    }

    fn point(&self, values: &[f64], place: BodyOffset) -> Result<Point, Fault> {
        let color = self.color.map(|scalar| [3, 4, 5].map(|n| channel(scalar, values[n])));
        Point::new(DVec3::new(values[0], values[1], values[2]), color, || place.to_string())
    }

    /// Passes the vertices on as points, without those of a confidence below `min_confidence`. At 0 all are kept,
    /// because a `quality` may be negative.
    pub(super) fn read_points(
        &self,
        body: &mut BodyReader<'_, '_>,
        element: &PlyElement,
        min_confidence: f64,
        visitor: &mut dyn Visitor,
    ) -> Result<(), Fault> {
        let filters = self.has_confidence && min_confidence > 0.0;
        body.records(element, &self.wanted, visitor, |visitor, values, place| {
            let point = self.point(values, place);
            let confidence = values[values.len() - 1];
            // NaN is an unknown confidence.
            if filters && (confidence < min_confidence || confidence.is_nan()) {
                return Ok(());
            }
            Point::pass(point, visitor)
        })
    }
}

/// A color channel as a byte.
fn channel(scalar: PlyScalar, value: f64) -> u8 {
    if scalar.is_integer() { value as u8 } else { byte(value) }
}

enum PositionProperties {
    Narrow(Vec<Vec3>),
    Wide(Vec<DVec3>),
}

/// All vertices of a mesh.
pub(super) struct Vertices {
    positions: PositionProperties,
    /// One for each position, or none.
    colors: Vec<[u8; 3]>,
}

impl Vertices {
    /// Reads `element`, whose count `check_counts` has checked against the file.
    pub(super) fn read(
        columns: &VertexProperties,
        body: &mut BodyReader<'_, '_>,
        element: &PlyElement,
        visitor: &mut dyn Visitor,
    ) -> Result<Self, Fault> {
        let count = element.count as usize;
        let mut positions = if columns.narrow {
            PositionProperties::Narrow(Vec::with_capacity(count))
        } else {
            PositionProperties::Wide(Vec::with_capacity(count))
        };
        let mut colors = Vec::with_capacity(if columns.color.is_some() { count } else { 0 });
        body.records(element, &columns.wanted, visitor, |visitor, values, place| {
            let point = match columns.point(values, place) {
                Ok(point) => point,
                Err(fault) => {
                    fault.pass(visitor)?;
                    // Faces without it need the numbers of the vertices after it.
                    Point { position: DVec3::NAN, color: columns.color.map(|_| [0; 3]) }
                }
            };
            match &mut positions {
                PositionProperties::Narrow(positions) => positions.push(point.position.as_vec3()),
                PositionProperties::Wide(positions) => positions.push(point.position),
            }
            colors.extend(point.color);
            Ok(())
        })?;
        Ok(Self { positions, colors })
    }

    /// Number of vertices.
    pub(super) fn len(&self) -> usize {
        match &self.positions {
            PositionProperties::Narrow(positions) => positions.len(),
            PositionProperties::Wide(positions) => positions.len(),
        }
    }

    /// True if all of `corners`, each below [`Vertices::len`], are finite.
    pub(super) fn are_finite(&self, corners: &[usize]) -> bool {
        corners.iter().all(|&n| self.point(n).position.is_finite())
    }

    /// Vertex `n`, which must be below [`Vertices::len`]. Its position is NaN if the visitor has left it out.
    pub(super) fn point(&self, n: usize) -> Point {
        let position = match &self.positions {
            PositionProperties::Narrow(positions) => positions[n].as_dvec3(),
            PositionProperties::Wide(positions) => positions[n],
        };
        Point { position, color: self.colors.get(n).copied() }
    }
}

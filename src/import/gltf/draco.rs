//! `KHR_draco_mesh_compression`: the vertices and triangles of a primitive in one compressed stream.

use std::collections::HashMap;

use draco_core::{DataType, DecodeLimits, DecoderBuffer, ErrorKind, MeshDecoder, PointAttribute, PointIndex};
use gltf::json::Index;
use gltf::json::accessor::ComponentType;
use gltf::json::buffer::View;
use gltf::json::mesh::Primitive;
use serde::Deserialize;

use super::super::Fault;

pub(super) const NAME: &str = "KHR_draco_mesh_compression";
/// Bytes of a triangle: three indices of 32 bits.
const FACE: usize = 12;

/// The extension of a primitive.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Draco {
    pub(super) buffer_view: Index<View>,
    /// The identifiers of the attributes in the stream, by glTF's names.
    pub(super) attributes: HashMap<String, u32>,
}

impl Draco {
    /// The extension of `primitive` at `place`, if it is compressed.
    ///
    /// # Errors
    ///
    /// If the extension lacks a field.
    pub(super) fn of(primitive: &Primitive, place: &dyn Fn() -> String) -> Result<Option<Self>, Fault> {
        let json = primitive.extensions.as_ref().and_then(|all| all.others.get(NAME));
        json.map(Self::deserialize)
            .transpose()
            .map_err(|error| Fault::broken(place(), format!("invalid extension {NAME}: {error}")))
    }
}

/// A decoded stream.
pub(super) struct DracoMesh {
    pub(super) points: u64,
    /// Indices of 32 bits, little-endian, three per triangle.
    pub(super) indices: Vec<u8>,
    attributes: Vec<(u32, Attribute)>,
}

/// The values of all points, little-endian.
pub(super) struct Attribute {
    pub(super) component: ComponentType,
    /// Numbers per point.
    pub(super) components: usize,
    pub(super) bytes: Vec<u8>,
}

impl DracoMesh {
    /// Decodes `source`; the result has at most `most` bytes.
    ///
    /// # Errors
    ///
    /// If `source` breaks the format, or describes more.
    pub(super) fn decode(source: &[u8], most: u64, place: &dyn Fn() -> String) -> Result<Self, Fault> {
        let limits = DecodeLimits::default()
            .with_max_points(most)
            .with_max_faces(most / FACE as u64)
            .with_max_decoded_bytes(most);
        let mut mesh = draco_core::Mesh::new();
        MeshDecoder::new().decode(&mut DecoderBuffer::new(source).with_limits(limits), &mut mesh).map_err(|error| {
            match error.kind() {
                ErrorKind::LimitExceeded => {
                    Fault::broken(place(), format!("its Draco stream decompresses to more than {most} bytes"))
                }
                _ => Fault::broken(place(), format!("cannot decode the Draco stream: {}", error.message())),
            }
        })?;
        let indices = mesh.faces().iter().flatten().flat_map(|point| point.0.to_le_bytes()).collect();
        let points = mesh.num_points();
        let attributes = (0..mesh.num_attributes())
            .map(|n| mesh.attribute(n))
            .filter_map(|attribute| Some((attribute.unique_id(), Attribute::of(attribute, points)?)))
            .collect();
        Ok(Self { points: points as u64, indices, attributes })
    }

    /// The attribute of the identifier `id`.
    pub(super) fn attribute(&self, id: u32) -> Option<&Attribute> {
        self.attributes.iter().find_map(|(other, attribute)| (*other == id).then_some(attribute))
    }

    /// Bytes in memory.
    pub(super) fn len(&self) -> u64 {
        let attributes = self.attributes.iter().map(|(_, attribute)| attribute.bytes.len());
        (self.indices.len() + attributes.sum::<usize>()) as u64
    }
}

impl Attribute {
    /// The values of `points`; `None` if glTF has no such type or a value is missing.
    fn of(attribute: &PointAttribute, points: usize) -> Option<Self> {
        let component = match attribute.data_type() {
            DataType::Int8 => ComponentType::I8,
            DataType::Uint8 => ComponentType::U8,
            DataType::Int16 => ComponentType::I16,
            DataType::Uint16 => ComponentType::U16,
            DataType::Uint32 => ComponentType::U32,
            DataType::Float32 => ComponentType::F32,
            _ => return None,
        };
        let components = usize::from(attribute.num_components());
        let (size, data) = (component.size() * components, attribute.buffer().data());
        let mut bytes = Vec::with_capacity(points * size);
        for point in 0..points {
            let start = (attribute.mapped_index(PointIndex(point as u32)).0 as usize).checked_mul(size)?;
            bytes.extend_from_slice(data.get(start..start.checked_add(size)?)?);
        }
        Some(Self { component, components, bytes })
    }
}

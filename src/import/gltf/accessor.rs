//! The numbers of an accessor, with all bounds checked.

use gltf::json::accessor::{ComponentType, Type, sparse};
use gltf::json::buffer::View;
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Accessor, Index};

use super::super::Fault;
use super::buffers::Buffers;
use super::document::{CornerBudget, get};
use super::draco::DracoMesh;

/// Elements of an accessor without a buffer view, which are zeros.
const MAX_ZEROS: u64 = 1 << 24;

/// The elements of an accessor, in the buffer.
pub(super) struct Values<'b> {
    pub(super) count: u64,
    pub(super) shape: Type,
    pub(super) component: ComponentType,
    pub(super) normalized: bool,
    /// None for zeros.
    base: Option<Strided<'b>>,
    sparse: Option<SparseValues<'b>>,
}

/// Elements at a constant stride.
#[derive(Clone, Copy)]
struct Strided<'b> {
    bytes: &'b [u8],
    stride: usize,
    size: usize,
}

/// Sparse replacements of elements; `indices` ascend.
struct SparseValues<'b> {
    count: usize,
    indices: Strided<'b>,
    index: ComponentType,
    values: Strided<'b>,
}

impl<'b> Strided<'b> {
    /// `count` elements of `size` bytes, from `offset` in `view`.
    fn of(
        buffers: &'b Buffers<'_>,
        index: Index<View>,
        offset: USize64,
        size: usize,
        count: u64,
    ) -> Result<Self, Fault> {
        let view = get(&buffers.document.buffer_views, index, "buffer view")?;
        let wrong = |expected: String, found: String| Fault::malformed(format!("buffer view {index}"), expected, found);
        let part = buffers.view(index)?;
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        if stride < size {
            return Err(wrong(format!("a stride of at least {size}"), stride.to_string()));
        }
        if count == 0 {
            return Ok(Self { bytes: &[], stride, size });
        }
        let needed = (count - 1)
            .checked_mul(stride as u64)
            .and_then(|before| before.checked_add(size as u64))
            .and_then(|length| length.checked_add(offset.0));
        match needed {
            Some(needed) if needed <= part.len() as u64 => Ok(Self { bytes: &part[offset.0 as usize..], stride, size }),
            _ => Err(wrong(
                format!("{count} elements of {size} bytes from byte {} on, {stride} apart", offset.0),
                format!("{} bytes", part.len()),
            )),
        }
    }

    fn element(&self, n: usize) -> &'b [u8] {
        &self.bytes[n * self.stride..][..self.size]
    }
}

impl<'b> SparseValues<'b> {
    /// The replacements in an accessor of `count` elements of `size` bytes.
    fn of(
        buffers: &'b Buffers<'_>,
        json: &sparse::Sparse,
        size: usize,
        count: u64,
        place: &dyn Fn() -> String,
        budget: &mut CornerBudget,
    ) -> Result<Self, Fault> {
        let Checked::Valid(gltf::json::accessor::IndexComponentType(index)) = json.indices.component_type else {
            return Err(Fault::broken(place(), "unknown type of sparse indices"));
        };
        let n = json.count.0;
        let indices = Strided::of(buffers, json.indices.buffer_view, json.indices.byte_offset, index.size(), n)?;
        let values = Strided::of(buffers, json.values.buffer_view, json.values.byte_offset, size, n)?;
        budget.spend(n)?;
        let sparse = Self { count: n as usize, indices, index, values };
        let mut least = 0;
        for n in 0..sparse.count {
            let index = sparse.index(n);
            if index < least || index >= count {
                let expected = format!("sparse indices that ascend from 0 to below {count}");
                return Err(Fault::malformed(place(), expected, index));
            }
            least = index + 1;
        }
        Ok(sparse)
    }

    fn index(&self, n: usize) -> u64 {
        number(self.index, self.indices.element(n)) as u64
    }

    /// The replacement of element `n`, if any.
    fn element(&self, n: usize) -> Option<&'b [u8]> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low + (high - low) / 2;
            if self.index(middle) < n as u64 { low = middle + 1 } else { high = middle }
        }
        (low < self.count && self.index(low) == n as u64).then(|| self.values.element(low))
    }
}

impl<'b> Values<'b> {
    /// The elements of accessor `index`; those of a Draco stream are in `mesh`, as the attribute of this identifier.
    ///
    /// # Errors
    ///
    /// If elements lie outside their buffers, too many have no buffer, or `mesh` has others.
    pub(super) fn of(
        buffers: &'b Buffers<'_>,
        index: Index<Accessor>,
        mesh: Option<(&'b DracoMesh, u32)>,
        budget: &mut CornerBudget,
    ) -> Result<Self, Fault> {
        let accessor = get(&buffers.document.accessors, index, "accessor")?;
        let place = || format!("accessor {index}");
        let (Checked::Valid(component), Checked::Valid(shape)) = (accessor.component_type, accessor.type_) else {
            return Err(Fault::broken(place(), "unknown type of numbers"));
        };
        let (count, component) = (accessor.count.0, component.0);
        let size = component.size() * shape.multiplicity();
        let offset = accessor.byte_offset.unwrap_or_default();
        let base = match (mesh, accessor.buffer_view) {
            (Some((mesh, id)), _) => {
                let bytes = attribute(mesh, id, count, component, shape, &place)?;
                Some(Strided { bytes, stride: size, size })
            }
            (None, Some(view)) => Some(Strided::of(buffers, view, offset, size, count)?),
            (None, None) => {
                Fault::unless_within("elements of an accessor without a buffer view", MAX_ZEROS, count)?;
                None
            }
        };
        let sparse = accessor.sparse.as_ref();
        let sparse = sparse.map(|json| SparseValues::of(buffers, json, size, count, &place, budget)).transpose()?;
        Ok(Self { count, shape, component, normalized: accessor.normalized, base, sparse })
    }

    /// The indices of `mesh`; accessor `index`, if there is one, must have as many.
    ///
    /// # Errors
    ///
    /// If it has not.
    pub(super) fn indices(
        buffers: &Buffers<'_>,
        index: Option<Index<Accessor>>,
        mesh: &'b DracoMesh,
    ) -> Result<Self, Fault> {
        let count = (mesh.indices.len() / 4) as u64;
        if let Some(index) = index {
            let accessor = get(&buffers.document.accessors, index, "accessor")?;
            if accessor.count.0 != count {
                let expected = format!("the {count} indices of its Draco stream");
                return Err(Fault::malformed(format!("accessor {index}"), expected, accessor.count.0));
            }
        }
        let base = Some(Strided { bytes: &mesh.indices, stride: 4, size: 4 });
        let (shape, component) = (Type::Scalar, ComponentType::U32);
        Ok(Self { count, shape, component, normalized: false, base, sparse: None })
    }

    /// The first `N` numbers of element `n`, which must be below the count; the shape must have at least `N`.
    pub(super) fn vector<const N: usize>(&self, n: usize) -> [f64; N] {
        let replaced = self.sparse.as_ref().and_then(|sparse| sparse.element(n));
        let Some(bytes) = replaced.or_else(|| self.base.map(|base| base.element(n))) else { return [0.0; N] };
        let size = self.component.size();
        std::array::from_fn(|k| {
            let value = number(self.component, &bytes[k * size..]);
            match (self.normalized, self.component) {
                (true, ComponentType::I8) => (value / 127.0).max(-1.0),
                (true, ComponentType::U8) => value / 255.0,
                (true, ComponentType::I16) => (value / 32767.0).max(-1.0),
                (true, ComponentType::U16) => value / 65535.0,
                _ => value,
            }
        })
    }
}

/// The values of the attribute `id` of `mesh`, of the count and type of the accessor at `place`.
fn attribute<'b>(
    mesh: &'b DracoMesh,
    id: u32,
    count: u64,
    component: ComponentType,
    shape: Type,
    place: &dyn Fn() -> String,
) -> Result<&'b [u8], Fault> {
    let wrong = |expected: String, found: String| Fault::malformed(place(), expected, found);
    let Some(attribute) = mesh.attribute(id) else {
        return Err(Fault::broken(
            place(),
            format!("its Draco stream has no attribute {id} with values that glTF has"),
        ));
    };
    if mesh.points != count {
        return Err(wrong(format!("the {} elements of its Draco stream", mesh.points), count.to_string()));
    }
    if (attribute.component, attribute.components) != (component, shape.multiplicity()) {
        let expected = format!("{} of {:?} as in its Draco stream", attribute.components, attribute.component);
        return Err(wrong(expected, format!("{} of {component:?}", shape.multiplicity())));
    }
    Ok(&attribute.bytes)
}

/// The number at the beginning of `bytes`.
#[inline]
fn number(component: ComponentType, bytes: &[u8]) -> f64 {
    match component {
        ComponentType::I8 => f64::from(bytes[0] as i8),
        ComponentType::U8 => f64::from(bytes[0]),
        ComponentType::I16 => f64::from(i16::from_le_bytes([bytes[0], bytes[1]])),
        ComponentType::U16 => f64::from(u16::from_le_bytes([bytes[0], bytes[1]])),
        ComponentType::U32 => f64::from(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
        ComponentType::F32 => f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
    }
}

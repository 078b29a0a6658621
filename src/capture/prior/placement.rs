//! Tensors in occupied space, on one lattice per scale (paper, "Distributing local tensors").
//!
//! In: occupied boxes in the model's space, and a [`ScaleShape`]. Out: a [`TensorCloud`] in canonical order.
//! Boxes are rasterized as boxes: every lattice cell that shares volume with one gets a tensor. Their centers alone
//! would leave holes in a lattice that is finer than the boxes.

use glam::{DVec3, UVec3};
use serde::{Deserialize, Serialize};

use super::Remedy;
use super::{Error, VoxelBoxes};
use strivec_format::geometry::{Aabb, Lattice};
use strivec_format::model::{Placement, TensorCloud};

/// Distance in cells that counts as rounding, for a box that reaches into a cell.
const FUZZ: f64 = 1e-6;
/// (box, cell) pairs; each takes 12 bytes.
const MAX_VISITS: u64 = 1 << 27;

/// Shape and spacing of the tensors of one scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ScaleShape {
    /// Distance between lattice centers per axis, in model units.
    pub pitch: [f64; 3],
    /// Edge lengths of a tensor per axis, in model units; more than the pitch, so that neighbors overlap.
    pub edge: [f64; 3],
    /// Cells along each axis of a tensor.
    pub resolution: [u32; 3],
}

impl ScaleShape {
    /// A shape with the same values on all axes.
    pub fn cubic(pitch: f64, edge: f64, resolution: u32) -> Self {
        Self { pitch: [pitch; 3], edge: [edge; 3], resolution: [resolution; 3] }
    }

    fn check(&self) -> Result<(), Error> {
        let positive = |v: &f64| *v > 0.0 && v.is_finite();
        if !self.pitch.iter().all(positive) {
            return Err(Error::option("pitch", "three positive numbers", self.pitch));
        }
        if !self.edge.iter().all(positive) {
            return Err(Error::option("edge", "three positive numbers", self.edge));
        }
        if self.resolution.contains(&0) {
            return Err(Error::option("resolution", "at least 1 cell per axis", self.resolution));
        }
        Ok(())
    }
}

/// A tensor at the center of every cell that shares volume with one of `boxes`, on a lattice whose origin is their
/// smallest corner. A box that ends on a face of the lattice, within a millionth of a cell, does not reach past it.
///
/// # Errors
///
/// If the shape is out of range, there are no boxes, a box is not finite, or there are too many cells.
pub fn place_on_boxes(boxes: &VoxelBoxes, shape: &ScaleShape) -> Result<TensorCloud, Error> {
    const WHAT: &str = "occupied box";
    shape.check()?;
    if boxes.cells.is_empty() {
        return Err(Error::NothingToPlace { what: WHAT });
    }
    let finite = |b: &Aabb| b.min.is_finite() && b.max.is_finite();
    if let Some((index, found)) = boxes.boxes().enumerate().find(|(_, b)| !finite(b)) {
        return Err(Error::NotFinite { what: WHAT, index, found: format!("{found:?}") });
    }
    let origin = boxes.boxes().fold(Aabb::EMPTY, |all, b| all.union(&b)).min;
    let lattice = Lattice { origin, pitch: shape.pitch.into() };
    let too_many = || Error::TooManyCells { pitch: shape.pitch, limit: MAX_VISITS, remedy: Remedy::LargerPitch };
    let mut visits = 0_u64;
    for b in boxes.boxes() {
        let (first, last) = touched(&lattice, &b).ok_or_else(too_many)?;
        let cells = (last - first + 1).to_array().map(u64::from).into_iter();
        visits = cells.fold(1, u64::saturating_mul).saturating_add(visits);
        if visits > MAX_VISITS {
            return Err(too_many());
        }
    }
    // (z, y, x), the canonical order.
    let mut cells = Vec::with_capacity(visits as usize);
    for b in boxes.boxes() {
        let (first, last) = touched(&lattice, &b).ok_or_else(too_many)?;
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                cells.extend((first.x..=last.x).map(|x| [z, y, x]));
            }
        }
    }
    cells.sort_unstable();
    cells.dedup();
    let cells = cells.into_iter().map(|[z, y, x]| UVec3::new(x, y, z)).collect();
    let placement = Placement::Lattice { lattice, cells };
    Ok(TensorCloud { placement, half_edge: 0.5 * DVec3::from(shape.edge), resolution: shape.resolution })
}

/// The first and the last cell that `b` shares volume with, or that contains it if it is thinner than
/// [`FUZZ`]; `None` past 2^31 cells. The origin of the lattice must not exceed the box.
fn touched(lattice: &Lattice, b: &Aabb) -> Option<(UVec3, UVec3)> {
    let first = ((b.min - lattice.origin) / lattice.pitch + FUZZ).floor().max(DVec3::ZERO);
    let last = (((b.max - lattice.origin) / lattice.pitch - FUZZ).ceil() - 1.0).max(first);
    (last.max_element() < f64::from(i32::MAX)).then(|| (first.as_uvec3(), last.as_uvec3()))
}

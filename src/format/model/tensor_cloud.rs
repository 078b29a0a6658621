//! The centers of the tensors of one scale (spec 3.7 and 3.9).

use glam::{DVec3, UVec3};

use crate::Invalid;
use crate::digits::numbers;
use crate::geometry::{Aabb, Lattice};

/// The centers, strictly ascending by (z, y, x): so ties between neighbors and the order of sums do not depend on the
/// writer of a scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Placement {
    /// The centers of these cells of a lattice.
    Lattice {
        /// The lattice.
        lattice: Lattice,
        /// Occupied cells.
        cells: Vec<UVec3>,
    },
    /// Centers that are listed one by one.
    Explicit {
        /// Centers in model units.
        centers: Vec<DVec3>,
    },
}

/// Tensors of one size: tensor n covers the closed box center(n) ± `half_edge` (spec 4.1).
#[derive(Clone, Debug, PartialEq)]
pub struct TensorCloud {
    /// The centers.
    pub placement: Placement,
    /// Half the edge lengths, per axis, in model units.
    pub half_edge: DVec3,
    /// D, cells along each axis; a factor has D + 1 vertices from −`half_edge` to `half_edge`.
    pub resolution: [u32; 3],
}

impl TensorCloud {
    /// Number of tensors.
    pub fn len(&self) -> usize {
        match &self.placement {
            Placement::Lattice { cells, .. } => cells.len(),
            Placement::Explicit { centers } => centers.len(),
        }
    }

    /// True if there are no tensors.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The center of tensor `n`, in model units.
    pub fn center(&self, n: usize) -> DVec3 {
        match &self.placement {
            Placement::Lattice { lattice, cells } => lattice.center(cells[n].as_ivec3()),
            Placement::Explicit { centers } => centers[n],
        }
    }

    /// All centers, in order.
    pub fn centers(&self) -> impl Iterator<Item = DVec3> + '_ {
        (0..self.len()).map(|n| self.center(n))
    }

    /// The box around all tensors, in model units; [`Aabb::EMPTY`] if there are none.
    pub fn bounds(&self) -> Aabb {
        let centers = Aabb::from_points(self.centers());
        if self.is_empty() { centers } else { centers.grown(self.half_edge) }
    }

    /// Edge lengths of a factor's cell, in model units.
    pub fn cell_size(&self) -> DVec3 {
        2.0 * self.half_edge / UVec3::from_array(self.resolution).as_dvec3()
    }

    /// Keeps the tensors of the numbers `kept`, which ascend, and removes the others.
    pub(super) fn keep_tensors(&mut self, kept: &[usize]) {
        match &mut self.placement {
            Placement::Lattice { cells, .. } => *cells = kept.iter().map(|&n| cells[n]).collect(),
            Placement::Explicit { centers } => *centers = kept.iter().map(|&n| centers[n]).collect(),
        }
    }

    pub(super) fn check(&self, place: &str) -> Result<(), Invalid> {
        if !(self.half_edge.is_finite() && self.half_edge.min_element() > 0.0) {
            let found = numbers(self.half_edge.to_array());
            return Err(Invalid::new(format!("{place} half edges"), "positive numbers", found));
        }
        if self.resolution.contains(&0) {
            let found = numbers(self.resolution);
            return Err(Invalid::new(format!("{place} resolution"), "at least 1 cell along each axis", found));
        }
        if self.is_empty() {
            return Err(Invalid::new(format!("{place} number of tensors"), "at least 1", 0));
        }
        if let Placement::Lattice { lattice, cells } = &self.placement {
            if !(lattice.origin.is_finite() && lattice.pitch.is_finite() && lattice.pitch.min_element() > 0.0) {
                let [origin, pitch] = [lattice.origin, lattice.pitch].map(|v| numbers(v.to_array()));
                let found = format!("origin {origin} and pitch {pitch}");
                return Err(Invalid::new(format!("{place} lattice"), "finite and of positive pitch", found));
            }
            if let Some(cell) = cells.iter().find(|c| c.max_element() > i32::MAX as u32) {
                return Err(Invalid::new(format!("{place} cells"), "below 2^31 along each axis", cell));
            }
        }
        let mut previous: Option<DVec3> = None;
        for (n, center) in self.centers().enumerate() {
            if !center.is_finite() {
                let found = numbers(center.to_array());
                return Err(Invalid::new(format!("{place} center {n}"), "finite numbers", found));
            }
            if previous.is_some_and(|p| [p.z, p.y, p.x] >= [center.z, center.y, center.x]) {
                let expected = "after the previous center, strictly ascending by (z, y, x)";
                let found = numbers(center.to_array());
                return Err(Invalid::new(format!("{place} center {n}"), expected, found));
            }
            previous = Some(center);
        }
        Ok(())
    }
}

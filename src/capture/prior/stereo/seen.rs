//! Places as another photograph shows them.

use std::cmp::Ordering;

use glam::{DVec2, DVec3};

use super::shot::{PlaneMap, StereoShot};

/// The share of the depth by which two photographs' depths of a point may differ.
pub(super) const AGREEMENT: f64 = 0.02;
/// The share of 1/depth by which what a photograph shows is behind a place that it sees through.
const SEEN_THROUGH: f64 = 0.05;

/// A place in a photograph that shows it, unless something stands before it.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    shot: &'a StereoShot,
    /// The picture point.
    at: DVec2,
    /// Column and row of the patch.
    patch: [usize; 2],
    /// 1/depth of the place.
    inverse: f64,
}

impl<'a> Seen<'a> {
    pub(super) fn of(place: DVec3, shot: &'a StereoShot) -> Option<Self> {
        let at = shot.camera.project(place)?;
        let inverse = 1.0 / (shot.camera.position - place).dot(shot.camera.world_from_camera.z_axis);
        Some(Self { shot, at, patch: shot.patch_at(at)?, inverse })
    }

    /// 1/depth of the plane of patch number `n` at the picture point.
    fn plane_at(&self, map: &PlaneMap, n: usize) -> Option<f64> {
        map[n].map(|plane| plane.moved(self.at - self.shot.middle(n)).inverse)
    }

    /// True if the place is on a plane of `map`, in this patch or in one beside it: 1/depth differs by at most `tolerance`, or
    /// by [`AGREEMENT`] of it.
    pub(super) fn is_on(&self, map: &PlaneMap, tolerance: f64) -> bool {
        let [columns, rows] = self.shot.patches();
        let [column, row] = self.patch;
        let mut around = (row.saturating_sub(1)..=(row + 1).min(rows - 1)).flat_map(|row| {
            (column.saturating_sub(1)..=(column + 1).min(columns - 1)).map(move |column| row * columns + column)
        });
        around.any(|patch| {
            let found = self.plane_at(map, patch);
            found.is_some_and(|found| (found - self.inverse).abs() < tolerance.max(AGREEMENT * self.inverse))
        })
    }

    /// The number of the patch.
    pub(super) fn number(&self) -> usize {
        self.patch[1] * self.shot.patches()[0] + self.patch[0]
    }

    /// The order of depths of the plane of this patch in `map` and the place: greater if the photograph sees through the place, less
    /// if the plane hides it. They are equal, too, if 1/depth differs by less than [`SEEN_THROUGH`] of it or twice the `tolerance`,
    /// or if there is no plane.
    pub(super) fn depth_order(&self, map: &PlaneMap, tolerance: f64) -> Ordering {
        let Some(found) = self.plane_at(map, self.number()) else { return Ordering::Equal };
        let apart = (2.0 * tolerance).max(SEEN_THROUGH * self.inverse);
        if self.inverse - found > apart {
            Ordering::Greater
        } else if found - self.inverse > apart {
            Ordering::Less
        } else {
            Ordering::Equal
        }
    }
}

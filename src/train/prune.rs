//! Pruning of tensors whose boxes are empty (paper, appendix "Ablation Studies on Initial Geometry").

use strivec_format::geometry::Aabb;
use strivec_format::model::{Occupancy, Scale, Scene};

/// Boxes are enlarged by this many cells of the occupancy on each side. It is far more than the rounding of positions
/// in f32, by which a sample a little outside a box may be covered.
const MARGIN: f64 = 0.01;

/// Removes the tensors whose boxes are empty. Returns \[scale\] the indices of the remaining tensors: all of them if
/// there is no occupancy, and at least one per scale.
///
/// Pictures stay the same to the bit in the reference renderer, for any coverage. Samples exist only where the
/// occupancy is positive, and no such point is in the box of a removed tensor. So a removed tensor covered none of
/// them: their coverage, nearest tensors, order and weights stay the same. A tensor with components of zeros still
/// covers (spec 3.10), so it is not removed.
pub fn prune_unoccupied(scene: &mut Scene) -> Vec<Vec<usize>> {
    let occupancy = &scene.occupancy;
    let keep = |scale: &mut Scale| {
        let kept = match occupancy {
            Some(occupancy) => occupied_tensors(scale, occupancy),
            None => (0..scale.cloud.len()).collect(),
        };
        if kept.len() < scale.cloud.len() {
            scale.keep_tensors(&kept);
        }
        kept
    };
    scene.scales.iter_mut().map(keep).collect()
}

/// The tensors of `scale` whose boxes are not empty; the first one if all are.
fn occupied_tensors(scale: &Scale, occupancy: &Occupancy) -> Vec<usize> {
    let half = scale.cloud.half_edge + MARGIN * occupancy.cell_size();
    let is_occupied = |center| occupancy.meets(&Aabb::around(center, half));
    let mut kept: Vec<usize> = (0..scale.cloud.len()).filter(|&n| is_occupied(scale.cloud.center(n))).collect();
    if kept.is_empty() {
        // A scale has at least one tensor. An additional one changes no picture.
        kept.push(0);
    }
    kept
}

//! Leaving out tensors in whose boxes nothing counts any more (paper, appendix "Ablation Studies on Initial Geometry").

use crate::geometry::Aabb;
use crate::model::{Occupancy, Scale, Scene};

/// Boxes are this many of the occupancy's cells larger on each side than they are: far more than rounding moves a
/// position in f32, in which a sample may be covered a little outside a box.
const MARGIN: f64 = 0.01;

/// Removes the tensors in whose boxes no sample counts; returns, for each scale, the numbers of those that stay. Without
/// an occupancy all do, and of every scale at least one.
///
/// Pictures stay the same to the bit in the reference renderer, whatever the coverage. A sample counts only where the
/// occupancy is positive, and such a point is in no removed tensor's box. So none of them was among those that cover it:
/// whether it is in the model, its nearest tensors, their order, which is that of their distances and centers, and their
/// weights stay as they are. All other points show nothing. That is more than a tensor without components could say of
/// itself (DESIGN, section 2.11), which is why that one stays.
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

/// The tensors of `scale` in whose boxes samples count; the first where none is.
fn occupied_tensors(scale: &Scale, occupancy: &Occupancy) -> Vec<usize> {
    let half = scale.cloud.half_edge + MARGIN * occupancy.cell_size();
    let counts = |center| occupancy.meets(&Aabb::around(center, half));
    let mut kept: Vec<usize> = (0..scale.cloud.len()).filter(|&n| counts(scale.cloud.center(n))).collect();
    if kept.is_empty() {
        // A scale has tensors. One more changes nothing, either.
        kept.push(0);
    }
    kept
}

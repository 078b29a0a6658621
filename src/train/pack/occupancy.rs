//! Occupancies that take few bytes.

use strivec_format::model::Scene;

/// Radius of a gap that is closed, in vertices. A rough border takes many bytes, and what lies between occupied places hardly
/// shows.
const GAP: u32 = 2;

/// `scene` without gaps in its occupancy.
pub(super) fn without_gaps(scene: &Scene) -> Scene {
    let occupancy = scene.occupancy.as_ref().map(|occupancy| occupancy.closed(GAP));
    Scene { occupancy, ..scene.clone() }
}

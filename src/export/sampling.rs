//! Density features at points of a scene.

use glam::DVec3;

use super::Error;
use super::marching::NOTHING;
use strivec_field::{Field, Pool, Samples, vectorized};
use strivec_format::geometry::{Aabb, Contraction};
use strivec_format::model::{Coverage, Scene};

/// Half edge of the inner cube of an unbounded scene.
const INNER: f64 = 1.0;
/// How far the surroundings of an unbounded scene are exported, in half edges of the inner cube.
pub(super) const FARTHEST: f64 = 64.0;

/// Evaluates the density features of a scene where samples count.
pub(super) struct Sampler {
    pub(super) field: Field<f32>,
    /// The box outside of which there is nothing, in the space of the tensors.
    pub(super) region: Aabb,
    scratch: Pool<SampleScratch>,
}

#[derive(Default)]
struct SampleScratch {
    samples: Samples<f32>,
    /// The positions that count, and their places among all.
    positions: Vec<[f32; 3]>,
    places: Vec<usize>,
}

impl Sampler {
    /// Prepares `scene`, which must have passed [`Scene::check`]. Of an unbounded scene the inner cube alone counts, unless
    /// `surroundings` is true.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] if no sample counts anywhere, [`Error::Memory`].
    pub(super) fn new(scene: &Scene, surroundings: bool) -> Result<Self, Error> {
        let region = region(scene, surroundings);
        if !region.is_solid() {
            let what = "no sample of a ray counts in the scene".into();
            return Err(Error::Empty { what, instead: "its occupancy or its tensors' boxes are empty" });
        }
        Ok(Self { field: Field::new(scene)?, region, scratch: Pool::default() })
    }

    /// False if no sample in the box `around`, in the space of the tensors, counts.
    pub(super) fn may_count_in(&self, around: &Aabb) -> bool {
        let within = around.intersection(&self.region);
        let [min, max] = [within.min, within.max].map(|corner| self.field.relative(corner));
        within.min.cmple(within.max).all() && self.field.may_count_in(min, max)
    }

    /// Writes the density feature at each of `positions`, in the space of the tensors, and [`NOTHING`] where no sample
    /// counts. All positions are in the box `around`.
    pub(super) fn features(&self, around: &Aabb, positions: impl Iterator<Item = DVec3>, features: &mut [f32]) {
        features.fill(NOTHING);
        if !self.may_count_in(around) {
            return;
        }
        self.scratch.with(|SampleScratch { samples, positions: counting, places }| {
            counting.clear();
            places.clear();
            for (place, position) in positions.enumerate() {
                let relative = self.field.relative(position);
                let is_occupied = || self.field.occupancy.as_ref().is_none_or(|cells| cells.contains(relative));
                if self.region.contains(position) && is_occupied() {
                    counting.push(relative);
                    places.push(place);
                }
            }
            vectorized(
                #[inline(always)]
                || {
                    let take = |n: usize, feature| features[places[n]] = feature;
                    self.field.density_features(counting.iter().copied(), samples, take);
                },
            );
        });
    }
}

/// The smallest known box around all samples that count, in the space of the tensors.
fn region(scene: &Scene, surroundings: bool) -> Aabb {
    let clouds = scene.scales.iter().map(|scale| scale.cloud.bounds());
    let covered = match scene.rules.coverage {
        Coverage::All => clouds.reduce(|all, cloud| all.intersection(&cloud)),
        Coverage::Any => clouds.reduce(|all, cloud| all.union(&cloud)),
    };
    let mut region = scene.bounds.intersection(&covered.unwrap_or(Aabb::EMPTY));
    if let Some(contraction) = scene.rules.contraction {
        let reach = if surroundings { farthest(&contraction) } else { INNER };
        region = region.intersection(&Aabb::around(DVec3::ZERO, DVec3::splat(reach)));
    }
    if let Some(occupancy) = &scene.occupancy {
        // A vertex counts in the open cells around it.
        let set = Aabb::from_points(occupancy.iter().map(|vertex| occupancy.position(vertex)));
        region = region.intersection(&set.grown(occupancy.cell_size()));
    }
    region
}

/// The largest coordinate in contracted space that is exported.
pub(super) fn farthest(contraction: &Contraction) -> f64 {
    contraction.contract(DVec3::X * FARTHEST).x
}

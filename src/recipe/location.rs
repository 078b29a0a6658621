//! Where the scene is: the range of its rays, its box, and the inner box of an unbounded scene.

use super::photographs::cameras;
use super::{Error, Observer};
use strivec_capture::dataset::Dataset;
use strivec_capture::prior;
use strivec_capture::prior::{Location, VoxelBoxes};
use strivec_format::geometry::Camera;
use strivec_train::TrainConfig;

/// The distance at which rays of an unbounded scene end, in edges of its inner box: what is farther does not move in any
/// picture.
const FAR_OF_UNBOUNDED: f64 = 1000.0;

/// Where the scene of `dataset` is, as far as `config` and `dataset` do not say it. Returns the cells of all points, in the
/// space of the prior.
pub(super) fn locate(
    config: &mut TrainConfig,
    dataset: &mut Dataset,
    is_opaque: bool,
    observer: &mut dyn Observer,
) -> Result<Option<VoxelBoxes>, Error> {
    let cameras = cameras(dataset);
    let Location { near_far, bounds, points, all_points } =
        prior::locate(dataset.points.as_deref(), dataset.bounds, &cameras, || is_opaque)?;
    let points = points.filter(|_| is_opaque);
    config.prior.free_before_points = true;
    if config.model.contraction.is_some() {
        locate_unbounded(config, &cameras, near_far[0], observer);
    }
    if let Some(unbounded) = config.unbounded() {
        config.prior.points = points.map(|points| unbounded.contract_boxes(&points));
        return Ok(all_points.map(|points| unbounded.contract_boxes(&points)));
    }
    config.prior.points = points;
    let [near, far] = *config.space.near_far.get_or_insert(near_far);
    let within = bounds.map_or_else(String::new, |b| format!(", within {:.3} to {:.3}", b.min, b.max));
    observer.message(&format_args!("rays from {near:.3} to {far:.3}{within}"));
    dataset.bounds = bounds;
    Ok(all_points)
}

/// The inner box and the range of an unbounded scene, whose rays begin at `near`, as far as `config` does not say them.
pub(super) fn locate_unbounded(config: &mut TrainConfig, cameras: &[Camera], near: f64, observer: &mut dyn Observer) {
    let [min, max] = *config.space.inner_box.get_or_insert_with(|| {
        let inner = prior::inner_box(cameras);
        [inner.min, inner.max]
    });
    let far = FAR_OF_UNBOUNDED * (max - min).max_element();
    let [near, far] = *config.space.near_far.get_or_insert([near, far]);
    observer.message(&format_args!("rays from {near:.3} to {far:.3}, inner box {min:.3} to {max:.3}"));
}

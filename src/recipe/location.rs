//! Where the scene is: the range of its rays, its box, and the inner box of an unbounded scene.

use super::photographs::cameras;
use super::{Error, Observer};
use glam::DVec3;
use strivec_capture::dataset::Dataset;
use strivec_capture::prior;
use strivec_capture::survey::{Evidence, Remark, Survey, survey};
use strivec_format::OptionName;
use strivec_format::geometry::{Aabb, Contraction};
use strivec_train::TrainConfig;

/// The distance at which rays of an unbounded scene end, in edges of its inner box: what is farther does not move in any
/// picture.
const FAR_OF_UNBOUNDED: f64 = 1000.0;

/// The contraction of scenes that are found to be unbounded (the paper's runs on Mip-NeRF 360).
const SURROUNDINGS: Contraction = Contraction { shell: 0.4 };

/// Where the scene of `dataset` is, of which photographs show the `matched` points, as far as `config` and `dataset` do not say
/// it. Returns the survey, its cells and surfaces in the space of the prior.
pub(super) fn locate(
    config: &mut TrainConfig,
    dataset: &mut Dataset,
    is_opaque: bool,
    matched: &[DVec3],
    observer: &mut dyn Observer,
) -> Result<Survey, Error> {
    let (cameras, shown) = (cameras(dataset), prior::shown(&dataset.views));
    let Dataset { points, bounds, range, .. } = &*dataset;
    let evidence = Evidence {
        cameras: &cameras,
        points: points.as_deref(),
        bounds: *bounds,
        range: *range,
        shown: &shown,
        matched,
        is_opaque,
    };
    let mut survey = survey(&evidence)?;
    for remark in &survey.remarks {
        match remark {
            Remark::OddCameras { numbers, .. } => {
                let names: Vec<&str> = numbers.iter().take(3).map(|&n| dataset.views[n].path.as_str()).collect();
                observer.message(&format_args!("{remark}: {}", names.join(", ")));
            }
            _ => observer.message(remark),
        }
    }
    config.prior.free_before_points = true;
    if config.model.contraction.is_none() && config.space.unbounded.unwrap_or(survey.is_wide) {
        config.model.contraction = Some(SURROUNDINGS);
        if config.space.unbounded.is_none() {
            let name = OptionName("space.unbounded");
            observer.message(&format_args!(
                "unbounded: photographs show much far outside of the inner box ({name} decides)"
            ));
        }
    }
    if config.model.contraction.is_some() {
        locate_unbounded(config, survey.inner_box, survey.near_far[0], observer);
    }
    if let Some(unbounded) = config.unbounded() {
        for cells in [&mut survey.points, &mut survey.all_points].into_iter().flatten() {
            *cells = unbounded.contract_boxes(cells);
        }
        survey.surfaces.iter_mut().for_each(|point| *point = unbounded.contract(*point));
    } else {
        let [near, far] = *config.space.near_far.get_or_insert(survey.near_far);
        let within = survey.bounds.map_or_else(String::new, |b| format!(", within {:.3} to {:.3}", b.min, b.max));
        observer.message(&format_args!("rays from {near:.3} to {far:.3}{within}"));
        dataset.bounds = survey.bounds;
    }
    config.prior.points = survey.points.clone().filter(|_| is_opaque);
    Ok(survey)
}

/// The inner box and the range of an unbounded scene, whose rays begin at `near`, as far as `config` does not say them.
pub(super) fn locate_unbounded(config: &mut TrainConfig, inner: Aabb, near: f64, observer: &mut dyn Observer) {
    let [min, max] = *config.space.inner_box.get_or_insert([inner.min, inner.max]);
    let far = FAR_OF_UNBOUNDED * (max - min).max_element();
    let [near, far] = *config.space.near_far.get_or_insert([near, far]);
    observer.message(&format_args!("rays from {near:.3} to {far:.3}, inner box {min:.3} to {max:.3}"));
}

//! Where the scene is: the range of its rays, its box, and the inner box of an unbounded scene.

use super::distances::{find_points, is_opaque};
use super::photographs::cameras;
use super::{Error, Observer};
use glam::DVec3;
use strivec_capture::dataset;
use strivec_capture::dataset::Dataset;
use strivec_capture::prior;
use strivec_capture::survey::{Evidence, Given, Survey, survey};
use strivec_format::geometry::{Aabb, Contraction};
use strivec_train::{SpaceConfig, TrainConfig};

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
    let (mut survey, given) = surveyed(config, dataset, is_opaque, matched)?;
    for (label, line) in survey.lines(given) {
        observer.message(&format_args!("{label}: {line}"));
    }
    config.prior.free_before_points = true;
    if survey.is_wide {
        config.model.contraction.get_or_insert(SURROUNDINGS);
        place_unbounded(config, survey.inner_box, survey.near_far[0]);
    } else {
        config.space.near_far = Some(survey.near_far);
        dataset.bounds = survey.bounds;
    }
    if let Some(unbounded) = config.unbounded() {
        for cells in [&mut survey.points, &mut survey.all_points].into_iter().flatten() {
            *cells = unbounded.contract_boxes(cells);
        }
        survey.surfaces.iter_mut().for_each(|point| *point = unbounded.contract(*point));
    }
    config.prior.points = survey.points.clone().filter(|_| is_opaque);
    Ok(survey)
}

/// Where the scene of `dataset` is, as a training by `config` finds it before its first step: photographs are matched. Sets the
/// distances of the views.
///
/// # Errors
///
/// [`Error::Dataset`] and [`Error::Prior`]; [`Error::Interrupted`] if `observer` stops the matching.
pub fn survey_photographs(
    config: &TrainConfig,
    dataset: &mut Dataset,
    observer: &mut dyn Observer,
) -> Result<Survey, Error> {
    let is_opaque = is_opaque(dataset);
    let matched = if is_opaque { find_points(config, dataset, observer)? } else { Vec::new() };
    Ok(surveyed(config, dataset, is_opaque, &matched)?.0)
}

/// The survey of `dataset`, with what `config` says instead of what is found, and what that is.
fn surveyed(
    config: &TrainConfig,
    dataset: &Dataset,
    is_opaque: bool,
    matched: &[DVec3],
) -> Result<(Survey, Given), Error> {
    let (cameras, shown) = (cameras(dataset), prior::shown(&dataset.views));
    let known_shares = prior::known_shares(&dataset.views);
    let Dataset { points, bounds, range, .. } = dataset;
    let evidence = Evidence {
        cameras: &cameras,
        points: points.as_deref(),
        bounds: *bounds,
        range: *range,
        shown: &shown,
        known_shares: &known_shares,
        matched,
        is_opaque,
        is_plain: dataset::has_plain_background(&dataset.views),
    };
    let mut survey = survey(&evidence)?;
    let SpaceConfig { near_far, inner_box, unbounded, .. } = config.space;
    let unbounded = unbounded.or(config.model.contraction.is_some().then_some(true));
    let given = Given { near_far: near_far.is_some(), unbounded: unbounded.is_some() };
    survey.near_far = near_far.unwrap_or(survey.near_far);
    survey.is_wide = unbounded.unwrap_or(survey.is_wide);
    survey.inner_box = inner_box.map_or(survey.inner_box, |[min, max]| Aabb { min, max });
    survey.name_cameras(|n| &dataset.views[n].path);
    Ok((survey, given))
}

/// Sets the inner box of an unbounded scene and the range of its rays, which begin at `near`, as far as `config` does not say
/// them. Returns the box's corners and the range.
fn place_unbounded(config: &mut TrainConfig, inner: Aabb, near: f64) -> ([DVec3; 2], [f64; 2]) {
    let [min, max] = *config.space.inner_box.get_or_insert([inner.min, inner.max]);
    let far = FAR_OF_UNBOUNDED * (max - min).max_element();
    ([min, max], *config.space.near_far.get_or_insert([near, far]))
}

/// Places an unbounded scene as [`place_unbounded`] does, and tells `observer` where.
pub(super) fn locate_unbounded(config: &mut TrainConfig, inner: Aabb, near: f64, observer: &mut dyn Observer) {
    let ([min, max], [near, far]) = place_unbounded(config, inner, near);
    observer.message(&format_args!("rays from {near:.3} to {far:.3}, inner box {min:.3} to {max:.3}"));
}

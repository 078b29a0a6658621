//! The prior of opaque photographs from points: those of the dataset, and those matched between the photographs.

use super::{Error, Observer};
use strivec_capture::dataset::Dataset;
use strivec_capture::prior;
use strivec_capture::prior::VoxelBoxes;
use strivec_capture::survey::Survey;
use strivec_format::digits::plural;
use strivec_train::TrainConfig;

/// The share of rays from which on tensors around points hold the scene; surfaces without texture have no points. In an unbounded
/// scene, the rest may be so far away that photographs do not tell where.
const ENOUGH_COVERED: f64 = 0.99;
const ENOUGH_BEFORE_FAR: f64 = 0.7;
/// The degree of the sky of such a scene.
const SKY_DEGREE: u32 = 2;

/// The prior of opaque photographs from the `survey`'s surfaces, or from the dataset's points, outliers included, if few points
/// are matched; `None` if rays do not meet nearly all of it. Then `config` says that the surfaces are known.
///
/// Which points more rays meet does not matter: few large cells, such as outliers stretch, meet all rays.
pub(super) fn prior_of_points(
    config: &mut TrainConfig,
    dataset: &Dataset,
    survey: Survey,
    observer: &mut dyn Observer,
) -> Result<Option<VoxelBoxes>, Error> {
    let unknown_may_be_far = survey.unknown_may_be_far();
    let (cells, what) = match prior::cells_around(&survey.surfaces) {
        Some(cells) => (cells, "points matched between photographs"),
        None => match survey.all_points {
            Some(points) => (points, "the dataset's points"),
            None => return Ok(None),
        },
    };
    let share = strivec_train::covered_share(config, dataset, &cells)?;
    let is_unbounded = config.unbounded().is_some();
    let is_enough = share >= if is_unbounded { ENOUGH_BEFORE_FAR } else { ENOUGH_COVERED };
    let rest = if is_enough { "" } else { "; photographs tell the rest" };
    let count = plural(cells.cells.len(), "cell");
    observer.message(&format_args!("prior: {count} of {what}, which {:.1} % of rays meet{rest}", 100.0 * share));
    if !survey.surfaces.is_empty() {
        // Thin and shiny things have none.
        (config.prior.points, config.prior.free_before_points) = (Some(cells.clone()), false);
    }
    if !is_enough {
        return Ok(None);
    }
    if is_unbounded && (share < ENOUGH_COVERED || unknown_may_be_far) {
        let photographs = &mut config.photographs;
        let degree = *photographs.sky_degree.get_or_insert(if photographs.random_background { 0 } else { SKY_DEGREE });
        let cells = strivec_train::with_far_cells(config, dataset, &cells, unknown_may_be_far)?;
        let count = plural(cells.cells.len(), "cell");
        let sky = if degree > 0 { format!(", before a sky of degree {degree}") } else { String::new() };
        observer.message(&format_args!("prior: {count} with those where the other rays end, far away{sky}"));
        return Ok(Some(cells));
    }
    Ok(Some(cells))
}

//! The prior of opaque photographs from points: those of the dataset, or those matched between the photographs.

use glam::DVec3;

use super::photographs::cameras;
use super::{Error, Observer};
use strivec_capture::dataset::Dataset;
use strivec_capture::prior;
use strivec_capture::prior::VoxelBoxes;
use strivec_format::digits::plural;
use strivec_train::TrainConfig;

/// The share of rays from which on tensors around the dataset's points hold the scene; surfaces without texture have no
/// points. In an unbounded scene, the rest may be so far away that photographs do not tell where.
const ENOUGH_COVERED: f64 = 0.99;
const ENOUGH_BEFORE_FAR: f64 = 0.7;
/// The degree of the sky of such a scene.
const SKY_DEGREE: u32 = 2;

/// The prior of opaque photographs from points: those of the dataset, outliers included, or those that are `matched`
/// between the photographs, whichever more of the rays meet, if these are nearly all. `config` then has the points' range
/// of rays, if none was `asked`. Else `config` says that the matched points are known, if they are more than the dataset's.
pub(super) fn prior_of_points(
    config: &mut TrainConfig,
    dataset: &Dataset,
    asked: Option<[f64; 2]>,
    all_points: Option<VoxelBoxes>,
    matched: &[DVec3],
    observer: &mut dyn Observer,
) -> Result<Option<VoxelBoxes>, Error> {
    let candidate = |cells: VoxelBoxes, what, near_far| -> Result<PointPrior, Error> {
        let mut config = config.clone();
        config.space.near_far = near_far;
        let share = strivec_train::covered_share(&config, dataset, &cells)?;
        Ok(PointPrior { cells, what, near_far, share })
    };
    let of_dataset =
        all_points.map(|points| candidate(points, "the dataset's points", config.space.near_far)).transpose()?;
    let unbounded = config.unbounded();
    let contracted: Vec<DVec3> =
        matched.iter().map(|&point| unbounded.map_or(point, |unbounded| unbounded.contract(point))).collect();
    let of_matching = prior::cells_around(&contracted).map(|cells| {
        let is_free = asked.is_none() && unbounded.is_none();
        let near_far =
            if is_free { Some(prior::ray_range(&cameras(dataset), Some(&cells))) } else { config.space.near_far };
        candidate(cells, "points matched between photographs", near_far)
    });
    let (dataset_share, of_matching) =
        (of_dataset.as_ref().map_or(0.0, |points| points.share), of_matching.transpose()?);
    let best = match of_matching {
        Some(points) if points.share > dataset_share => {
            // Thin and shiny things have none.
            (config.prior.points, config.prior.free_before_points) = (Some(points.cells.clone()), false);
            Some(points)
        }
        _ => of_dataset,
    };
    let Some(PointPrior { cells, what, near_far, share }) = best else { return Ok(None) };
    let is_enough = share >= if unbounded.is_some() { ENOUGH_BEFORE_FAR } else { ENOUGH_COVERED };
    let rest = if is_enough { "" } else { "; photographs tell the rest" };
    let count = plural(cells.cells.len(), "cell");
    observer.message(&format_args!("prior: {count} of {what}, which {:.1} % of rays meet{rest}", 100.0 * share));
    if !is_enough {
        return Ok(None);
    }
    if let Some([near, far]) = near_far.filter(|range| Some(*range) != config.space.near_far) {
        observer.message(&format_args!("rays from {near:.3} to {far:.3}, by these points"));
    }
    config.space.near_far = near_far;
    if share < ENOUGH_COVERED {
        let photographs = &mut config.photographs;
        let degree = *photographs.sky_degree.get_or_insert(if photographs.random_background { 0 } else { SKY_DEGREE });
        let cells = strivec_train::with_far_cells(config, dataset, &cells)?;
        let count = plural(cells.cells.len(), "cell");
        let sky = if degree > 0 { format!(", before a sky of degree {degree}") } else { String::new() };
        observer.message(&format_args!("prior: {count} with those where the other rays end, far away{sky}"));
        return Ok(Some(cells));
    }
    Ok(Some(cells))
}

/// Cells around points that may be the prior.
struct PointPrior {
    /// In the space of the prior.
    cells: VoxelBoxes,
    what: &'static str,
    near_far: Option<[f64; 2]>,
    /// The share of rays that meet tensors around the cells.
    share: f64,
}

//! The distances of the photographs' pixels: from depth maps, matched points or the dataset's mesh.

use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::{Error, Observer};
use strivec_capture::dataset;
use strivec_capture::dataset::Dataset;
use strivec_capture::prior;
use strivec_format::digits::{grouped, plural};
use strivec_train::TrainConfig;

/// The distances of `dataset`'s photographs, for a training by `config` that does not reconstruct its prior.
pub(super) fn find_distances(
    config: &TrainConfig,
    dataset: &mut Dataset,
    observer: &mut dyn Observer,
) -> Result<(), Error> {
    if config.loss.distance_weight > 0.0 && is_opaque(dataset) {
        find_points(config, dataset, observer)?;
    }
    Ok(())
}

/// True if nothing shows through any photograph of `dataset`.
pub(super) fn is_opaque(dataset: &Dataset) -> bool {
    dataset.views.par_iter().all(|view| view.pixels.is_opaque())
}

/// Sets the distances of the photographs of `dataset`: those of its depth maps or, if it has none, to points that are
/// matched between the photographs, and else to its mesh. Returns the matched points.
pub(super) fn find_points(
    config: &TrainConfig,
    dataset: &mut Dataset,
    observer: &mut dyn Observer,
) -> Result<Vec<DVec3>, Error> {
    let start = Instant::now();
    let with_depth = dataset::read_distances(dataset)?;
    if with_depth > 0 {
        observer.message(&format_args!("distances: those of {}", plural(with_depth, "depth map")));
        return Ok(Vec::new());
    }
    let points = prior::match_points(&mut dataset.views, config.model.contraction.is_some());
    let (count, seconds) = (plural(points.len(), "point"), start.elapsed().as_secs_f64());
    observer.message(&format_args!("matching: {count} on the surfaces of the photographs in {seconds:.1} s"));
    if let Some(file) = dataset.points.as_deref().filter(|_| config.loss.distance_weight > 0.0) {
        let share = prior::mesh_distances(file, &mut dataset.views).map_err(prior::BuildError::from)?;
        let told = match share {
            Some(share) => format!("of {:.1} % more of the pixels, by the dataset's mesh", 100.0 * share),
            None => {
                let most = grouped(prior::MAX_TRIANGLES as u64);
                format!("none by {}, which has more than {most} triangles", file.display())
            }
        };
        if share != Some(0.0) {
            observer.message(&format_args!("distances: {told}"));
        }
    }
    Ok(points)
}

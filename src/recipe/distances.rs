//! The distances of the photographs' pixels: from depth maps, matched points or the dataset's mesh.

use std::ops::ControlFlow;
use std::time::Instant;

use glam::DVec3;

use super::{Error, Observer, Progress};
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

/// True if `dataset`'s photographs have a background: hardly anything shows through them.
pub(super) fn is_opaque(dataset: &Dataset) -> bool {
    dataset::are_opaque(&dataset.views)
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
    let matched = prior::match_points(&mut dataset.views, &mut Watch(observer));
    let points = matched.ok_or(Error::Interrupted { step: 0, checkpoint: None })?;
    let (count, seconds) = (plural(points.len(), "point"), start.elapsed().as_secs_f64());
    observer.finished("");
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

/// Reports a matching to an observer, whose cache keeps the results.
struct Watch<'a>(&'a mut dyn Observer);

impl prior::MatchWatch for Watch<'_> {
    fn kept(&mut self, name: &str) -> Option<Vec<u8>> {
        self.0.cache()?.read(name)
    }

    fn keep(&mut self, name: &str, bytes: &[u8]) {
        if let Some(cache) = self.0.cache() {
            cache.write(name, bytes);
        }
    }

    fn progress(&mut self, done: usize, total: usize) -> ControlFlow<()> {
        self.0.progress(Progress { phase: "matching", done: done as u64, total: total as u64, detail: "" });
        if self.0.stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

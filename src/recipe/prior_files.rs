//! Priors from files of geometry.

use std::ops::ControlFlow;
use std::path::PathBuf;

use super::{Observer, Progress};
use strivec_capture::prior;
use strivec_capture::prior::{BuildError, BuildOptions, Built, PriorVisibility, VoxelBoxes};
use strivec_format::digits::{grouped, plural};
use strivec_format::geometry::Camera;

/// Parts of each file in the progress, because lengths differ.
const PARTS: u64 = 1000;

/// Reads `files`, with progress and a summary, until `observer` stops.
///
/// # Errors
///
/// All errors of [`prior::build()`].
pub fn build_prior(
    files: &[PathBuf],
    options: &BuildOptions,
    observer: &mut dyn Observer,
) -> Result<Built, BuildError> {
    observer.progress(Progress { phase: "prior", done: 0, total: PARTS, detail: "" });
    let built = prior::build(files, options, &mut |at| {
        let of_file = at.done as f64 / at.total.max(1) as f64;
        let done = PARTS as f64 * (at.file as f64 + of_file) / at.files as f64;
        let detail = format!("{:.0} of {:.0} MB", at.done as f64 / 1e6, at.total as f64 / 1e6);
        observer.progress(Progress { phase: "prior", done: done as u64, total: PARTS, detail: &detail });
        if observer.stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    let counts = built.counts;
    let listed = |parts: &[(u64, [&str; 2])]| {
        let parts = parts.iter().filter(|(n, _)| *n > 0);
        parts.map(|(n, what)| format!("{} {}", grouped(*n), what[usize::from(*n != 1)])).collect::<Vec<_>>().join(", ")
    };
    let read = listed(&[
        (counts.triangles, ["triangle", "triangles"]),
        (counts.degenerate, ["of them without area"; 2]),
        (counts.points, ["point", "points"]),
        (counts.outliers, ["of them an outlier", "of them outliers"]),
        (counts.cells, ["cell of grids", "cells of grids"]),
    ]);
    let mut left_out = listed(&[
        (counts.withheld, ["withheld point", "withheld points"]),
        (counts.noise, ["point of the noise classes 7 and 18", "points of the noise classes 7 and 18"]),
        (counts.transparent, ["splat of low opacity", "splats of low opacity"]),
        (counts.not_finite, ["point or triangle that is not finite", "points or triangles that are not finite"]),
    ]);
    if !left_out.is_empty() {
        left_out.insert_str(0, "; left out: ");
    }
    let cells = plural(built.boxes.cells.len(), "occupied voxel");
    observer.finished(&format!("prior: {cells} from {read}{left_out}"));
    Ok(built)
}

/// The share of the cameras' rays that meet the prior, with a message, and a warning if it is small.
pub fn check_sight(boxes: &VoxelBoxes, cameras: &[Camera], observer: &mut dyn Observer) -> PriorVisibility {
    let sight = prior::check_alignment(boxes, cameras);
    observer.message(&format_args!("{:.1} % of the cameras' rays meet the prior", 100.0 * sight.share));
    if let Some(advice) = &sight.advice {
        observer.message(&format_args!("warning: {advice}"));
    }
    sight
}

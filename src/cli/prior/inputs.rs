//! Options for priors from files.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use super::shaping::Shaping;
use crate::cli::error::with_flags;
use crate::cli::progress::Progress;
use crate::cli::table::plural;
use crate::cli::{Error, Session};
use crate::digits::grouped;
use crate::geometry::Camera;
use crate::prior::{self, Built, PriorVisibility, VoxelBoxes};

/// Prior options of commands that train.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Prior")]
pub(in crate::cli) struct Inputs {
    /// Prior geometry: meshes, point clouds, grids, octrees, or output of `strivec prior`; several are joined [default: coarse reconstruction from the photographs]
    #[arg(long = "prior", value_name = "INPUT")]
    files: Vec<PathBuf>,
    /// Find the occupied space with eight coarse tensors instead of the coarse reconstruction: slower, less precise
    #[arg(long, conflicts_with = "files")]
    pub(in crate::cli) bootstrap: bool,
    #[command(flatten)]
    shaping: Shaping,
}

impl Inputs {
    /// The occupied cells in the dataset's space; `None` if no file is named. Warns if `cameras` see few of them.
    pub(in crate::cli) fn voxels(
        &self,
        cameras: &[Camera],
        interrupted: &AtomicBool,
        session: &Session,
    ) -> Result<Option<VoxelBoxes>, Error> {
        if self.files.is_empty() {
            return Ok(None);
        }
        let boxes = build(&self.files, &self.shaping, interrupted, session)?.boxes;
        check_sight(&boxes, cameras.iter().copied(), session);
        Ok(Some(boxes))
    }
}

/// For commands that Ctrl-C ends at once because they have nothing to save.
pub(super) static NEVER: AtomicBool = AtomicBool::new(false);

/// Reads `files` until `interrupted`, with progress and a summary on the console.
pub(super) fn build(
    files: &[PathBuf],
    shaping: &Shaping,
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<Built, Error> {
    /// Parts of each file in the progress, because lengths differ.
    const PARTS: u64 = 1000;
    let options = shaping.options()?;
    let progress = Progress::start(&session.console, "prior", PARTS);
    let built = prior::build(files, &options, &mut |at| {
        let of_file = at.done as f64 / at.total.max(1) as f64;
        let done = PARTS as f64 * (at.file as f64 + of_file) / at.files as f64;
        progress.set(done as u64, || format!("{:.0} of {:.0} MB", at.done as f64 / 1e6, at.total as f64 / 1e6));
        if interrupted.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    let counts = built.counts;
    let listed = |parts: &[(u64, &str)]| {
        let parts = parts.iter().filter(|(n, _)| *n > 0);
        parts.map(|(n, what)| format!("{} {what}", grouped(*n))).collect::<Vec<_>>().join(", ")
    };
    let read = listed(&[
        (counts.triangles, "triangles"),
        (counts.degenerate, "of them without area"),
        (counts.points, "points"),
        (counts.outliers, "of them outliers"),
        (counts.cells, "cells of grids"),
    ]);
    let mut left_out = listed(&[
        (counts.withheld, "withheld points"),
        (counts.noise, "points of the noise classes 7 and 18"),
        (counts.transparent, "splats of low opacity"),
    ]);
    if !left_out.is_empty() {
        left_out.insert_str(0, "; left out: ");
    }
    let cells = plural(built.boxes.cells.len(), "occupied voxel");
    progress.finish(&format!("prior: {cells} from {read}{left_out}"));
    Ok(built)
}

/// Prints the share of the cameras' rays that meet the prior, and warns if it is small.
pub(super) fn check_sight(
    boxes: &VoxelBoxes,
    cameras: impl Iterator<Item = Camera>,
    session: &Session,
) -> PriorVisibility {
    let sight = prior::check_alignment(boxes, &cameras.collect::<Vec<_>>());
    session.console.say(&format!("{:.1} % of the cameras' rays meet the prior", 100.0 * sight.share));
    if let Some(advice) = &sight.advice {
        session.console.say(&format!("warning: {}", with_flags(&advice.to_string())));
    }
    sight
}

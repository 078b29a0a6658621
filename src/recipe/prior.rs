//! Where the scene is occupied: by files, by points, or by a coarse reconstruction from the photographs.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use super::distances::{find_points, is_opaque};
use super::exposure::decide_exposure;
use super::location::{locate, locate_unbounded};
use super::points::prior_of_points;
use super::prior_files::{build_prior, check_sight};
use super::{Error, Observer, Progress};
use strivec_capture::dataset::Dataset;
use strivec_capture::prior;
use strivec_capture::prior::{BuildOptions, CoarseProgress, VoxelBoxes};
use strivec_format::digits::plural;
use strivec_format::geometry::Camera;
use strivec_train::{PrepareError, TrainConfig};

/// The source of the prior, the occupied space that tensors are placed on.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Prior {
    /// The dataset's points or points matched between opaque photographs, if they cover the photographs; else a coarse
    /// reconstruction ([`strivec_train::reconstruct_prior`]).
    #[default]
    Photographs,
    /// Eight coarse tensors ([`strivec_train::bootstrap_prior`]): slower, less precise.
    Bootstrap,
    /// Geometry in files of the dataset's space.
    Files {
        /// The files, which are joined; at least one.
        files: Vec<PathBuf>,
        /// How occupied cells are made of them.
        options: Box<BuildOptions>,
    },
}

impl Prior {
    /// The occupied cells of the files, which `cameras` see, in the dataset's space or, for an unbounded scene, in
    /// contracted space; `None` if photographs are needed. Sets the range of rays in `config`, and the inner box of an
    /// unbounded scene, unless it has them.
    ///
    /// # Errors
    ///
    /// [`Error::Prior`].
    pub fn from_files(
        &self,
        config: &mut TrainConfig,
        cameras: &[Camera],
        observer: &mut dyn Observer,
    ) -> Result<Option<VoxelBoxes>, Error> {
        let Self::Files { files, options } = self else { return Ok(None) };
        let occupied = build_prior(files, options, observer)?.boxes;
        check_sight(&occupied, cameras, observer);
        let near_far = prior::ray_range(cameras, Some(&occupied));
        if config.model.contraction.is_some() {
            locate_unbounded(config, prior::inner_box(cameras), near_far[0], observer);
        } else {
            config.space.near_far.get_or_insert(near_far);
        }
        Ok(Some(match config.unbounded() {
            None => occupied,
            Some(unbounded) => unbounded.contract_boxes(&occupied),
        }))
    }

    /// The occupied cells that `dataset` shows, in its space or, for an unbounded scene, in contracted space. Sets in
    /// `config` and `dataset` where the scene is, unless they have it, and the distances of opaque photographs.
    ///
    /// # Errors
    ///
    /// [`Error::Prepare`], [`Error::Prior`] and [`Error::Dataset`].
    pub fn from_photographs(
        &self,
        config: &mut TrainConfig,
        dataset: &mut Dataset,
        observer: &mut dyn Observer,
    ) -> Result<VoxelBoxes, Error> {
        let bootstraps = *self == Self::Bootstrap;
        let is_opaque = is_opaque(dataset);
        let finds = is_opaque && !bootstraps;
        let matched = if finds { find_points(config, dataset, observer)? } else { Vec::new() };
        if finds {
            decide_exposure(config, dataset, observer);
        }
        let survey = locate(config, dataset, is_opaque, &matched, observer)?;
        if finds && let Some(points) = prior_of_points(config, dataset, survey, observer)? {
            return Ok(points);
        }
        let total = if bootstraps { config.bootstrap.total_steps() } else { u64::from(config.prior.total_steps()) };
        observer.progress(Progress { phase: "prior", done: 0, total, detail: "" });
        let start = Instant::now();
        let mut report = |at: CoarseProgress| {
            let detail = format!("train {:.2} dB", at.psnr);
            observer.progress(Progress { phase: "prior", done: u64::from(at.step), total, detail: &detail });
            if observer.stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let occupied = if bootstraps {
            strivec_train::bootstrap_prior(config, dataset, &mut report)?
        } else {
            strivec_train::reconstruct_prior(config, dataset, &mut report).map_err(PrepareError::from)?
        };
        let (count, seconds) = (plural(occupied.cells.len(), "occupied voxel"), start.elapsed().as_secs_f64());
        observer.finished(&format!("prior: {count} in {seconds:.1} s"));
        Ok(occupied)
    }
}

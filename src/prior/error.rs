//! What can go wrong before there is a model.

use crate::dataset::Dataset;
use crate::import::ImportError;

/// Why there is no prior or no placement. Expected and found values are inside.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option that cannot be meant (the caller).
    #[error("{name}: expected {expected}, found {found}")]
    Option {
        /// Which one.
        name: &'static str,
        /// What it should be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// Nothing to look at (the dataset).
    #[error("dataset {dataset} has no views")]
    NoViews {
        /// The dataset's name.
        dataset: String,
    },
    /// A view that is not what its camera says (the dataset).
    #[error("view {view}: expected {expected}, found {found}")]
    View {
        /// The view's name.
        view: String,
        /// What it should be.
        expected: String,
        /// What it is.
        found: String,
    },
    /// The photographs led to no occupied voxel.
    #[error(
        "the coarse reconstruction of {dataset} is empty after {steps} steps (training PSNR {psnr:.2} dB): \
         most likely {cause}"
    )]
    EmptyReconstruction {
        /// The dataset's name.
        dataset: String,
        /// How long it was trained.
        steps: u32,
        /// How well it fits the photographs, in dB.
        psnr: f64,
        /// The likely cause and its cure.
        cause: &'static str,
    },
    /// Nothing to place tensors on (the caller).
    #[error("there is no {what} to place tensors on")]
    NothingToPlace {
        /// Boxes, points or centers.
        what: &'static str,
    },
    /// A position that is no number (the caller).
    #[error("{what} {index} is not finite: {found}")]
    NotFinite {
        /// Boxes, points or centers.
        what: &'static str,
        /// Which one, from 0.
        index: usize,
        /// What it is.
        found: String,
    },
    /// More cells than memory should hold (the limit).
    #[error(
        "pitch {pitch:?} gives more than {limit} lattice cells over the prior: is the scene mapped to model units?"
    )]
    TooManyCells {
        /// Edge lengths of a lattice cell.
        pitch: [f64; 3],
        /// The most cells that are visited.
        limit: u64,
    },
    /// The progress callback asked to stop.
    #[error("cancelled after {step} steps")]
    Cancelled {
        /// Finished steps.
        step: u32,
    },
}

impl Error {
    /// Nothing was found in `dataset`'s photographs.
    pub(crate) fn empty(dataset: &Dataset, steps: u32, psnr: f64, background: [f32; 3]) -> Self {
        let cause = match background {
            [1.0, 1.0, 1.0] => "the background is not white (set it), or the cameras' axes or near and far are wrong",
            _ => "the background's color, the cameras' axes, or near and far are wrong",
        };
        Self::EmptyReconstruction { dataset: dataset.name.clone(), steps, psnr, cause }
    }

    pub(crate) fn option(name: &'static str, expected: &'static str, found: impl std::fmt::Debug) -> Self {
        Self::Option { name, expected, found: format!("{found:?}") }
    }
}

/// Why there are no cells.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A file (its author, or the system).
    #[error(transparent)]
    Import(#[from] ImportError),
    /// An option that cannot be meant (the caller).
    #[error("`{field}`: expected {expected}, found {found}")]
    Option {
        /// The field of [`super::BuildOptions`].
        field: &'static str,
        /// What it should be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// Files without geometry, or none that the options leave.
    #[error("expected something occupied, found nothing{why}")]
    Nothing {
        /// What was there, if anything.
        why: String,
    },
    /// More than memory should hold, or than can be done.
    #[error(
        "cells of {pitch:?} are too many over this geometry (at most {limit} are held): choose a larger `voxel`, or a `crop`"
    )]
    TooManyCells {
        /// Edge lengths of a cell.
        pitch: [f64; 3],
        /// The most that are held.
        limit: u64,
    },
    /// More points than outliers are looked for among.
    #[error("`outliers` can be removed among at most {limit} points: choose a `crop`, or keep the outliers")]
    TooManyPoints {
        /// The most.
        limit: usize,
    },
    /// The caller asked to stop.
    #[error("interrupted")]
    Stopped,
}

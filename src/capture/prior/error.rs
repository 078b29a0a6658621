//! Errors of priors and of tensor placement.

use crate::dataset::Dataset;
use strivec_import::ImportError;

/// Why a prior could not be made from photographs, checked or used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option or argument is out of range (the caller).
    #[error("`{name}` must be {expected}, found {found}")]
    Option {
        /// Name of the field or argument.
        name: &'static str,
        /// Accepted values.
        expected: &'static str,
        /// The given value.
        found: String,
    },
    /// The dataset has no photographs (the dataset).
    #[error("dataset {dataset} has no views")]
    NoViews {
        /// The dataset's name.
        dataset: String,
    },
    /// A view contradicts its camera (the dataset).
    #[error("view {view}: expected {expected}, found {found}")]
    View {
        /// The view's name.
        view: String,
        /// Accepted values.
        expected: String,
        /// The found value.
        found: String,
    },
    /// The trained grid has no occupied voxel.
    #[error(
        "the coarse reconstruction of {dataset} is empty after {steps} steps (training PSNR {psnr:.2} dB): \
         {cause}"
    )]
    EmptyReconstruction {
        /// The dataset's name.
        dataset: String,
        /// Finished steps.
        steps: u32,
        /// Training PSNR, in dB.
        psnr: f64,
        /// The likely cause and a remedy, as a clause.
        cause: &'static str,
    },
    /// No position to place tensors at (the caller).
    #[error("there is no {what} to place tensors on")]
    NothingToPlace {
        /// Boxes, points or centers.
        what: &'static str,
    },
    /// A position is not finite (the caller).
    #[error("{what} {index} is not finite: {found}")]
    NotFinite {
        /// Boxes, points or centers.
        what: &'static str,
        /// Index of the position, from 0.
        index: usize,
        /// The found value.
        found: String,
    },
    /// More cells than fit into memory (the limit).
    #[error("cells of {pitch:?} are too many over this geometry, at most {limit} are supported: {remedy}")]
    TooManyCells {
        /// Edge lengths of a cell.
        pitch: [f64; 3],
        /// The largest supported number.
        limit: u64,
        /// A remedy, as an imperative.
        remedy: &'static str,
    },
    /// A coordinate lies beyond the cells that have an index (the file, or the caller).
    #[error(
        "the position {at:?} is more than 2^31 cells of {pitch:?} from the origin: choose a larger `voxel`, or a `crop`"
    )]
    TooFar {
        /// The position.
        at: [f64; 3],
        /// Edge lengths of a cell.
        pitch: [f64; 3],
    },
    /// The progress callback stopped the training.
    #[error("cancelled after {step} steps")]
    Cancelled {
        /// Finished steps.
        step: u32,
    },
}

impl Error {
    /// [`Error::EmptyReconstruction`] of `dataset`.
    pub fn empty(dataset: &Dataset, steps: u32, psnr: f64, background: [f32; 3]) -> Self {
        let cause = match background {
            [1.0, 1.0, 1.0] => {
                "check the cameras' axes and `near_far`, and set `background` if the photographs' background is not white"
            }
            _ => "check `background`, the cameras' axes and `near_far`",
        };
        Self::EmptyReconstruction { dataset: dataset.name.clone(), steps, psnr, cause }
    }

    /// [`Error::Option`] of the field `name`.
    pub fn option(name: &'static str, expected: &'static str, found: impl std::fmt::Debug) -> Self {
        Self::Option { name, expected, found: format!("{found:?}") }
    }
}

/// Why a prior could not be made from files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A file cannot be read (its author, or the system).
    #[error(transparent)]
    Import(#[from] ImportError),
    /// An option is out of range, or there are too many cells (the caller).
    #[error(transparent)]
    Prior(#[from] Error),
    /// The files have no geometry, or the options leave none.
    #[error("no cell is occupied{why}")]
    Nothing {
        /// The geometry that was read, as the rest of the sentence.
        why: String,
    },
    /// All geometry lies in one place, so no size of cells can be derived (the files' author, or the caller).
    #[error("{files}: all geometry lies in one place, {place:?}, so no cell size follows from it: set `voxel`")]
    OnePlace {
        /// Names of the files.
        files: String,
        /// The place, in the dataset's space.
        place: [f64; 3],
    },
    /// More points than the search for outliers supports.
    #[error("`outliers` supports at most {limit} points: set a `crop`, or keep the outliers")]
    TooManyPoints {
        /// The largest supported number.
        limit: usize,
    },
    /// The progress callback stopped the reading.
    #[error("interrupted")]
    Stopped,
}

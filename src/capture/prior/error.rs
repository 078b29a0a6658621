//! Errors of priors and of tensor placement.

use std::fmt;

use super::Counts;
use crate::dataset::Dataset;
use strivec_format::geometry::Aabb;
use strivec_format::{Invalid, OptionName, Place};
use strivec_import::ImportError;

/// Why a prior could not be made from photographs, checked or used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option or argument is out of range (the caller).
    #[error(transparent)]
    Option(Invalid),
    /// A radius of too many cells (the caller).
    #[error(
        "{} must be a radius of fewer cells (choose a smaller one, a larger {}, or a {}); found {length}, which is \
         {cells:.0} cells",
        OptionName(name),
        OptionName("voxel"),
        OptionName("crop")
    )]
    TooWide {
        /// Name of the field.
        name: &'static str,
        /// The radius.
        length: f64,
        /// The radius in cells.
        cells: f64,
    },
    /// The dataset has no photographs (the dataset).
    #[error("dataset {dataset} has no views")]
    NoViews {
        /// The dataset's name.
        dataset: String,
    },
    /// A view contradicts its camera (the dataset).
    #[error("view {view}: {invalid}")]
    View {
        /// The view's name.
        view: String,
        /// The invalid part of the view.
        invalid: Invalid,
    },
    /// The trained grid has no occupied voxel.
    #[error(
        "the coarse reconstruction of {dataset} is empty after {steps} steps (training PSNR {psnr:.2} dB): \
         {}", causes(*background)
    )]
    EmptyReconstruction {
        /// The dataset's name.
        dataset: String,
        /// Finished steps.
        steps: u32,
        /// Training PSNR, in dB.
        psnr: f64,
        /// The color that was taken for that of the background.
        background: [f32; 3],
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
        /// The remedy.
        remedy: Remedy,
    },
    /// A coordinate lies beyond the cells that have an index (the file, or the caller).
    #[error("the position {at:?} is more than 2^31 cells of {pitch:?} from the origin: {}", Remedy::FewerCells)]
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
        Self::EmptyReconstruction { dataset: dataset.name.clone(), steps, psnr, background }
    }

    /// [`Error::View`] of the first view of `dataset`, the frusta of which span no box, but `frusta`.
    pub fn no_box(dataset: &Dataset, frusta: &Aabb) -> Self {
        let invalid = Invalid::new("the bounds of all frusta", "a box of positive size", format_args!("{frusta:?}"));
        Self::View { view: dataset.views[0].name.clone(), invalid }
    }

    /// [`Error::Option`] of the field `name`.
    pub fn option(name: &'static str, expected: &'static str, found: impl std::fmt::Debug) -> Self {
        Self::Option(Invalid::new(Place::option(name), expected, format_args!("{found:?}")))
    }
}

/// The likely causes of an empty reconstruction.
fn causes(background: [f32; 3]) -> String {
    let [background_name, range] = [OptionName("background"), OptionName("near_far")];
    match background {
        [1.0, 1.0, 1.0] => format!(
            "check the cameras' axes and {range}, and set {background_name} if the photographs' background is not white"
        ),
        _ => format!("check {background_name}, the cameras' axes and {range}"),
    }
}

/// Why no cell is occupied. It is displayed as the rest of a sentence.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum NoCells {
    /// There is no geometry.
    NoGeometry,
    /// All geometry is outside of the crop.
    Cropped {
        /// The bounds of the geometry, in the dataset's space.
        bounds: Aabb,
    },
    /// All geometry was left out.
    LeftOut(Counts),
    /// No cell has enough points.
    FewPoints {
        /// Number of cells with points.
        cells: usize,
        /// The least number of points.
        min_points: u32,
    },
}

impl fmt::Display for NoCells {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoGeometry => Ok(()),
            Self::Cropped { bounds: Aabb { min, max } } => {
                write!(f, " within the {}: the geometry of the files spans {min} to {max}", OptionName("crop"))
            }
            Self::LeftOut(counts) => write!(
                f,
                ": {} points ({} of them outliers), {} triangles, {} cells of grids; left out: {} withheld and {} noise \
                 points, {} splats of low opacity, {} not finite",
                counts.points,
                counts.outliers,
                counts.triangles,
                counts.cells,
                counts.withheld,
                counts.noise,
                counts.transparent,
                counts.not_finite
            ),
            Self::FewPoints { cells, min_points } => {
                write!(f, ": none of {cells} cells has {min_points} points, the value of {}", OptionName("min_points"))
            }
        }
    }
}

/// A remedy for too many cells. It is displayed as an imperative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// Larger or fewer cells.
    FewerCells,
    /// A larger pitch of tensors.
    LargerPitch,
}

impl fmt::Display for Remedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FewerCells => {
                write!(f, "choose a larger {}, or a {}", OptionName("voxel"), OptionName("crop"))
            }
            Self::LargerPitch => f.write_str("map the scene to model units, or use a larger pitch"),
        }
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
    #[error("no cell is occupied{0}")]
    Nothing(NoCells),
    /// All geometry lies in one place, so no size of cells can be derived (the files' author, or the caller).
    #[error(
        "{files}: all geometry lies in one place, {place:?}, so no cell size follows from it: set {}",
        OptionName("voxel")
    )]
    OnePlace {
        /// Names of the files.
        files: String,
        /// The place, in the dataset's space.
        place: [f64; 3],
    },
    /// More points than the search for outliers supports.
    #[error(
        "{} supports at most {limit} points: set a {}, or keep the outliers",
        OptionName("outliers"),
        OptionName("crop")
    )]
    TooManyPoints {
        /// The largest supported number.
        limit: usize,
    },
    /// The progress callback stopped the reading.
    #[error("interrupted")]
    Stopped,
}

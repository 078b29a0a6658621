//! How the model's space relates to the dataset's, and how its pictures are meant.

use super::BrokenInvariant;
use crate::geometry::Similarity;

/// Which axis of the dataset's right-handed space points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum UpAxis {
    /// +x.
    X,
    /// +y, as in glTF.
    Y,
    /// +z, as in Blender.
    Z,
    /// −x.
    MinusX,
    /// −y, as in photographs' own coordinates.
    MinusY,
    /// −z.
    MinusZ,
}

/// What the numbers of a color mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum ColorSpace {
    /// Display-referred sRGB, composited without linearisation, as the photographs were.
    Srgb,
}

/// The scene's frame. The model's space is right-handed; cameras look along their −z with y up.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Frame {
    /// From the dataset's space to the model's canonical box.
    pub model_from_dataset: Similarity,
    /// Up in the dataset's space.
    pub up: UpAxis,
    /// Metres a dataset unit, where known.
    pub meters_per_unit: Option<f64>,
    /// Where rays begin, in model units from the camera.
    pub near: f64,
    /// Where rays end, in model units from the camera.
    pub far: f64,
    /// The color behind everything, in [0, 1].
    pub background: [f32; 3],
    /// What colors mean.
    pub color_space: ColorSpace,
}

impl Frame {
    pub(super) fn check(&self) -> Result<(), BrokenInvariant> {
        if !self.model_from_dataset.is_valid() {
            let found = format!("{:?}", self.model_from_dataset);
            return Err(BrokenInvariant::new("frame model_from_dataset", "a finite similarity", found));
        }
        if !(self.near >= 0.0 && self.near < self.far && self.far.is_finite()) {
            let found = format!("{} and {}", self.near, self.far);
            return Err(BrokenInvariant::new("frame near and far", "0 <= near < far", found));
        }
        if let Some(meters) = self.meters_per_unit
            && !(meters > 0.0 && meters.is_finite())
        {
            return Err(BrokenInvariant::new("frame meters_per_unit", "a positive number", meters));
        }
        if !self.background.iter().all(|c| (0.0..=1.0).contains(c)) {
            let found = format!("{:?}", self.background);
            return Err(BrokenInvariant::new("frame background", "three numbers in [0, 1]", found));
        }
        Ok(())
    }
}

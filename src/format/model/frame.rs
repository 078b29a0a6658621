//! The frame: the map from dataset space to model space, and the interpretation of pictures (spec 3.1).

use glam::{DMat3, DVec3};

use crate::Invalid;
use crate::digits::{number, numbers};
use crate::geometry::Similarity;

crate::named! {
    /// The axis of a right-handed space that points up.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
    pub enum UpAxis {
        /// +x.
        X = "x",
        /// +y, as in glTF.
        Y = "y",
        /// +z, as in Blender.
        Z = "z",
        /// −x.
        MinusX = "-x",
        /// −y, as in OpenCV and COLMAP.
        MinusY = "-y",
        /// −z.
        MinusZ = "-z",
    }
}

/// Color spaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum ColorSpace {
    /// Display-referred sRGB, composited without linearization, as the photographs were.
    Srgb,
}

/// The scene's frame. Model space is right-handed; cameras look along their −z with y up.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Frame {
    /// From dataset space to model space.
    pub model_from_dataset: Similarity,
    /// Up in dataset space.
    pub up: UpAxis,
    /// Meters per unit of dataset space, if known.
    pub meters_per_unit: Option<f64>,
    /// Distance from the camera at which rays begin, in model units.
    pub near: f64,
    /// Distance from the camera at which rays end, in model units.
    pub far: f64,
    /// The background color: red, green, blue in \[0, 1\]. A scene with a sky shows it in pixels without a ray alone.
    pub background: [f32; 3],
    /// The color space of all colors.
    pub color_space: ColorSpace,
}

impl UpAxis {
    /// The unit vector along the axis.
    pub fn vector(self) -> DVec3 {
        match self {
            Self::X => DVec3::X,
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
            Self::MinusX => DVec3::NEG_X,
            Self::MinusY => DVec3::NEG_Y,
            Self::MinusZ => DVec3::NEG_Z,
        }
    }

    /// The rotation that takes the axis to +z by the shortest way; for −z the half turn about x.
    pub fn z_up_from(self) -> DMat3 {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        // The images of the x, y and z axes.
        match self {
            Self::X => DMat3::from_cols(z, y, -x),
            Self::Y => DMat3::from_cols(x, z, -y),
            Self::Z => DMat3::IDENTITY,
            Self::MinusX => DMat3::from_cols(-z, y, x),
            Self::MinusY => DMat3::from_cols(x, -z, y),
            Self::MinusZ => DMat3::from_cols(x, -y, -z),
        }
    }

    /// The axis of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|axis| axis.name() == name)
    }
}

impl Frame {
    /// The unit vector that points up in model space.
    pub fn up_in_model(&self) -> DVec3 {
        (self.model_from_dataset.rotation * self.up.vector()).normalize()
    }

    pub(super) fn check(&self) -> Result<(), Invalid> {
        if !self.model_from_dataset.is_valid() {
            let Similarity { scale, rotation, translation } = self.model_from_dataset;
            let [rotation, translation] = [numbers(rotation.to_array()), numbers(translation.to_array())];
            let found = format!("scale {}, rotation {rotation}, translation {translation}", number(scale));
            return Err(Invalid::new("frame model_from_dataset", "a finite similarity", found));
        }
        if !(self.near >= 0.0 && self.near < self.far && self.far.is_finite()) {
            let found = format!("{} and {}", number(self.near), number(self.far));
            return Err(Invalid::new("frame near and far", "in the order 0 <= near < far", found));
        }
        if let Some(meters) = self.meters_per_unit
            && !(meters > 0.0 && meters.is_finite())
        {
            return Err(Invalid::new("frame meters_per_unit", "a positive number", number(meters)));
        }
        if !self.background.iter().all(|c| (0.0..=1.0).contains(c)) {
            let found = numbers(self.background);
            return Err(Invalid::new("frame background", "three numbers in [0, 1]", found));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_axis_is_turned_up_and_named() {
        for up in UpAxis::ALL {
            assert_eq!(up.z_up_from() * up.vector(), DVec3::Z, "{up:?}");
            assert_eq!(up.z_up_from().determinant(), 1.0, "{up:?}");
            assert_eq!(UpAxis::from_name(up.name()), Some(up));
        }
        assert_eq!(UpAxis::from_name("up"), None);
    }
}

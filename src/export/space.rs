//! The space of exported coordinates.

use glam::DVec3;

use strivec_format::geometry::Similarity;
use strivec_format::model::Frame;

/// The space of exported coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Space {
    /// Dataset space: the space of the photographs' cameras.
    #[default]
    Dataset,
    /// Model space: the space of the field.
    Model,
}

impl Space {
    /// The map from model space.
    pub(super) fn map_from_model(self, frame: &Frame) -> Similarity {
        match self {
            Self::Dataset => frame.model_from_dataset.inverse(),
            Self::Model => Similarity::IDENTITY,
        }
    }

    /// The unit vector that points up.
    pub fn up(self, frame: &Frame) -> DVec3 {
        match self {
            Self::Dataset => frame.up.vector(),
            Self::Model => frame.up_in_model(),
        }
    }
}

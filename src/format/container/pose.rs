//! Poses: positions and rotations of cameras, as VIEWS and CAMERAS hold them (spec 3.13).

use std::fmt::Display;

use glam::{DQuat, DVec3};

use super::error::Error;
use super::record::{BorrowDecode, Encode};
use crate::digits::numbers;
use crate::geometry::Camera;

/// The position and rotation of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Pose {
    /// Position of the camera, in model units.
    pub position: DVec3,
    /// Rotation from the camera's axes to those of model space: a unit quaternion.
    pub rotation: DQuat,
}

/// 56 bytes.
#[derive(Clone, Copy, Encode, BorrowDecode)]
pub(super) struct PoseRecord {
    position: [f64; 3],
    /// x, y, z, w.
    rotation: [f64; 4],
}

impl From<&Camera> for Pose {
    fn from(camera: &Camera) -> Self {
        Self { position: camera.position, rotation: DQuat::from_mat3(&camera.world_from_camera).normalize() }
    }
}

impl From<&Pose> for PoseRecord {
    fn from(pose: &Pose) -> Self {
        Self { position: pose.position.to_array(), rotation: pose.rotation.to_array() }
    }
}

impl PoseRecord {
    /// The pose, if it is finite and its quaternion has length 1 within 1e-6.
    pub(super) fn pose(&self, place: &dyn Display) -> Result<Pose, Error> {
        let (position, rotation) = (DVec3::from_array(self.position), DQuat::from_array(self.rotation));
        if position.is_finite() && (rotation.length() - 1.0).abs() <= 1e-6 {
            return Ok(Pose { position, rotation });
        }
        let found = format!("{} and {}", numbers(self.position), numbers(self.rotation));
        Err(Error::invalid(format!("{place} pose"), "a finite position and a quaternion of length 1", found))
    }
}

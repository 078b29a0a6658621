//! Similarity transforms: uniform scale, rotation, translation.

use glam::{DQuat, DVec3};

/// x ↦ `scale` · `rotation` · x + `translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Similarity {
    /// Uniform scale, positive.
    pub scale: f64,
    /// Rotation, a unit quaternion.
    pub rotation: DQuat,
    /// Translation, applied last.
    pub translation: DVec3,
}

impl Similarity {
    /// The identity.
    pub const IDENTITY: Self = Self { scale: 1.0, rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// The image of `point`.
    pub fn point(&self, point: DVec3) -> DVec3 {
        self.scale * (self.rotation * point) + self.translation
    }

    /// The inverse map.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        let scale = 1.0 / self.scale;
        Self { scale, rotation, translation: -scale * (rotation * self.translation) }
    }

    /// True if every number is finite, the scale positive and the quaternion of length 1 within 1e-6.
    pub fn is_valid(&self) -> bool {
        self.scale.is_finite()
            && self.scale > 0.0
            && self.rotation.is_finite()
            && (self.rotation.length() - 1.0).abs() <= 1e-6
            && self.translation.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_brings_a_point_back() {
        let map = Similarity {
            scale: 2.5,
            rotation: DQuat::from_rotation_z(0.7) * DQuat::from_rotation_x(0.2),
            translation: DVec3::new(1.0, -2.0, 3.0),
        };
        let point = DVec3::new(0.3, 0.4, -0.5);
        assert!((map.inverse().point(map.point(point)) - point).length() < 1e-15);
    }
}

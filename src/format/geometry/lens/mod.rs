//! Lenses: which direction falls on which point of a picture, and back.
//!
//! Camera models of photogrammetry are a projection followed by a [`Distortion`]. Points are in units of the focal
//! length from the principal point, x to the right and y down; directions are in OpenCV's camera axes: x to the right,
//! y down, z forwards.

mod distortion;

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

pub use distortion::{Coefficients, Distortion};

/// How directions fall on the undistorted picture plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Projection {
    /// (x/z, y/z): COLMAP's SIMPLE_PINHOLE to FULL_OPENCV.
    Perspective,
    /// θ·(x, y)/√(x² + y²) with the angle θ to the axis: COLMAP's OPENCV_FISHEYE and its kin.
    Fisheye,
    /// (longitude, latitude) in radians: a full panorama has focal lengths of width/2π and height/π.
    Equirectangular,
}

/// A projection and the distortion after it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Lens {
    /// The projection.
    pub projection: Projection,
    /// The distortion of the projected picture.
    pub distortion: Distortion,
}

impl Default for Lens {
    /// [`Lens::PINHOLE`].
    fn default() -> Self {
        Self::PINHOLE
    }
}

impl Lens {
    /// A perspective projection without distortion.
    pub const PINHOLE: Self = Self { projection: Projection::Perspective, distortion: Distortion::NONE };

    /// The whole sphere without distortion.
    pub const PANORAMA: Self = Self { projection: Projection::Equirectangular, distortion: Distortion::NONE };

    /// True for [`Lens::PINHOLE`].
    pub fn is_pinhole(&self) -> bool {
        self.projection == Projection::Perspective && self.distortion.is_none()
    }

    /// The lens in words: its projection, and whether it distorts.
    pub fn name(&self) -> String {
        let projection = match self.projection {
            Projection::Perspective => "perspective",
            Projection::Fisheye => "fisheye",
            Projection::Equirectangular => "equirectangular",
        };
        format!("{projection}{}", if self.distortion.is_none() { "" } else { " with distortion" })
    }

    /// The point on which `direction`, of any length, falls. `None` behind a perspective camera, and beyond the fold of
    /// the distortion.
    pub fn point(&self, direction: DVec3) -> Option<DVec2> {
        let DVec3 { x, y, z } = direction;
        let across = DVec2::new(x, y);
        let plane = match self.projection {
            Projection::Perspective if z > 0.0 => across / z,
            Projection::Perspective => return None,
            Projection::Fisheye => {
                let r = across.length();
                if r == 0.0 && z > 0.0 { DVec2::ZERO } else { across / r * r.atan2(z) }
            }
            Projection::Equirectangular => DVec2::new(x.atan2(z), y.atan2(x.hypot(z))),
        };
        let is_inside = plane.is_finite() && plane.length() <= self.distortion.max_radius();
        is_inside.then(|| self.distortion.distorted(plane))
    }

    /// The unit direction that falls on `point`. `None` where no direction does: beyond the fold of the distortion, or
    /// outside of the sphere of directions.
    pub fn direction(&self, point: DVec2) -> Option<DVec3> {
        let plane = self.distortion.undistorted(point)?;
        let direction = match self.projection {
            Projection::Perspective => plane.extend(1.0).normalize(),
            Projection::Fisheye => {
                let angle = plane.length();
                if angle > PI {
                    return None;
                }
                // sin θ/θ is 1 at the axis.
                let across = if angle > 0.0 { plane * (angle.sin() / angle) } else { plane };
                across.extend(angle.cos())
            }
            Projection::Equirectangular => {
                let (sin, cos) = plane.y.sin_cos();
                if plane.x.abs() > PI || plane.y.abs() > 0.5 * PI {
                    return None;
                }
                DVec3::new(plane.x.sin() * cos, sin, plane.x.cos() * cos)
            }
        };
        Some(direction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_projection_comes_back() {
        let distortion = Distortion::new([-0.04, 0.003, 0.0, 0.0], [0.0; 3], [1e-3, 0.0], [0.0; 2]).unwrap();
        for (projection, distortion) in [
            (Projection::Perspective, Distortion::NONE),
            (Projection::Perspective, distortion),
            (Projection::Fisheye, Distortion::NONE),
            (Projection::Fisheye, distortion),
            (Projection::Equirectangular, Distortion::NONE),
        ] {
            let lens = Lens { projection, distortion };
            for direction in
                [DVec3::Z, DVec3::new(0.3, -0.2, 1.0), DVec3::new(-0.8, 0.9, 1.0), DVec3::new(1.0, 0.1, 0.2)]
            {
                let Some(point) = lens.point(direction) else { continue };
                let back = lens.direction(point).unwrap();
                assert!((back - direction.normalize()).length() < 1e-10, "{lens:?} {direction}: {back}");
            }
        }
    }

    #[test]
    fn axes_are_those_of_opencv() {
        let fisheye = Lens { projection: Projection::Fisheye, distortion: Distortion::NONE };
        assert!((fisheye.point(DVec3::X).unwrap() - DVec2::new(0.5 * PI, 0.0)).length() < 1e-15);
        let panorama = Lens { projection: Projection::Equirectangular, distortion: Distortion::NONE };
        assert!((panorama.point(DVec3::Y).unwrap() - DVec2::new(0.0, 0.5 * PI)).length() < 1e-15, "down is down");
        assert!((panorama.point(-DVec3::Z).unwrap().x.abs() - PI).abs() < 1e-15);
        assert!(Lens::PINHOLE.point(-DVec3::Z).is_none() && Lens::PINHOLE.is_pinhole() && !panorama.is_pinhole());
    }
}

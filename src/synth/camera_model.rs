//! Camera models of synthetic pictures and their coefficients.

use glam::DVec3;

use super::pictures::CAMERA_ANGLE;
use super::portable::cos_sin;
use strivec_dataset::{Focal, Intrinsics, lens_of};
use strivec_format::geometry::{Camera, Lens};

strivec_format::named! {
    /// Camera models that synthetic datasets can have.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub enum CameraModel {
        /// No distortion.
        #[default]
        Pinhole = "pinhole",
        /// One radial coefficient.
        SimpleRadial = "simple-radial",
        /// Two radial coefficients.
        Radial = "radial",
        /// Two radial and two tangential coefficients.
        OpenCv = "opencv",
        /// Six radial, three of them of the divisor, and two tangential coefficients.
        FullOpenCv = "full-opencv",
        /// Equidistant, four radial coefficients.
        OpenCvFisheye = "opencv-fisheye",
        /// Equidistant, one radial coefficient.
        SimpleRadialFisheye = "simple-radial-fisheye",
        /// Equidistant, two radial coefficients.
        RadialFisheye = "radial-fisheye",
        /// Equidistant, four radial, two tangential and two thin prism coefficients.
        ThinPrismFisheye = "thin-prism-fisheye",
        /// The whole sphere.
        Equirectangular = "equirectangular",
    }
}

/// The principal point as a share of columns and rows, but for pinhole and equirectangular cameras, which have it in the
/// middle.
const PRINCIPAL: [f64; 2] = [0.51, 0.49];
/// The focal length along rows by that along columns, if the model has two.
const FOCAL_RATIO: f64 = 0.98;

impl CameraModel {
    /// Name of the camera model in COLMAP's files, as in `OPENCV_FISHEYE`.
    pub(super) fn colmap_name(self) -> String {
        self.name().replace('-', "_").to_uppercase()
    }

    /// Coefficients of the camera model in the order of COLMAP's parameters, with OpenCV's names. They move points at
    /// the border of the pictures by some percent of half the width.
    pub(super) fn coefficients(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Pinhole | Self::Equirectangular => &[],
            Self::SimpleRadial => &[("k1", -0.4)],
            Self::Radial => &[("k1", -0.4), ("k2", 0.3)],
            Self::OpenCv => &[("k1", -0.35), ("k2", 0.2), ("p1", 0.004), ("p2", -0.003)],
            Self::FullOpenCv => &[
                ("k1", 0.15),
                ("k2", -0.1),
                ("p1", -0.003),
                ("p2", 0.002),
                ("k3", 0.05),
                ("k4", 0.5),
                ("k5", 0.1),
                ("k6", 0.02),
            ],
            Self::OpenCvFisheye => &[("k1", -0.25), ("k2", 0.1), ("k3", -0.05), ("k4", 0.01)],
            Self::SimpleRadialFisheye => &[("k1", -0.3)],
            Self::RadialFisheye => &[("k1", -0.2), ("k2", 0.15)],
            Self::ThinPrismFisheye => &[
                ("k1", -0.2),
                ("k2", 0.1),
                ("p1", 0.003),
                ("p2", -0.002),
                ("k3", -0.03),
                ("k4", 0.01),
                ("sx1", 0.004),
                ("sy1", -0.003),
            ],
        }
    }

    /// The lens of this camera model.
    fn lens(self) -> Lens {
        if self == Self::Equirectangular {
            return Lens::PANORAMA;
        }
        let values: Vec<f64> = self.coefficients().iter().map(|(_, value)| *value).collect();
        lens_of(&self.colmap_name(), &values).expect("a model of COLMAP with all its coefficients")
    }

    /// True if columns and rows have one focal length.
    pub(super) fn has_one_focal(self) -> bool {
        matches!(self, Self::SimpleRadial | Self::Radial | Self::SimpleRadialFisheye | Self::RadialFisheye)
    }

    /// The camera of this model in the place of `pinhole` with pictures of the same size. It sees at least the pinhole's
    /// angle of view along columns.
    pub(super) fn camera(self, pinhole: &Camera) -> Camera {
        let size = [pinhole.width, pinhole.height].map(f64::from);
        let lens = self.lens();
        let (focal, principal) = match self {
            Self::Pinhole => return *pinhole,
            Self::Equirectangular => {
                let whole = Intrinsics { size: None, focal: Focal::Panorama, principal: [None; 2], lens };
                whole.for_size([pinhole.width, pinhole.height])
            }
            _ => {
                let (cos, sin) = cos_sin(0.25 * CAMERA_ANGLE / std::f64::consts::PI);
                let edge = |x: f64| lens.point(DVec3::new(x, 0.0, cos)).expect("a direction near the axis").x.abs();
                let widest = edge(sin).max(edge(-sin));
                let [left, _] = PRINCIPAL;
                let along_columns = left.min(1.0 - left) * size[0] / widest;
                let ratio = if self.has_one_focal() { 1.0 } else { FOCAL_RATIO };
                ([along_columns, along_columns * ratio], [0, 1].map(|axis| PRINCIPAL[axis] * size[axis]))
            }
        };
        Camera { focal, principal, lens, ..*pinhole }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::orbit;

    #[test]
    fn lenses_distort_and_see_the_pinholes_angle_of_view() {
        for pinhole in orbit(3, [200, 200], 1) {
            for model in CameraModel::ALL {
                let camera = model.camera(&pinhole);
                assert!(camera.seen_pixels().is_none(), "{model:?} has pixels without a ray");
                let mut farthest: f64 = 0.0;
                for y in [0.5, 50.0, 100.0, 150.0, 199.5] {
                    for x in [0.5, 199.5] {
                        let ray = pinhole.ray_through(x, y).unwrap();
                        let at = camera.project(ray.at(1.0)).unwrap();
                        // Corners may lie outside.
                        let is_corner = !(20.0..=180.0).contains(&y);
                        assert!(is_corner || camera.is_inside(at), "{model:?} {x} {y}: {at}");
                        let linear = glam::DVec2::new(
                            camera.principal[0] + camera.focal[0] * (x - 100.0) / pinhole.focal[0],
                            camera.principal[1] + camera.focal[1] * (y - 100.0) / pinhole.focal[1],
                        );
                        farthest = farthest.max(at.distance(linear));
                    }
                }
                let bends = !matches!(model, CameraModel::Pinhole);
                assert_eq!(farthest > 2.0, bends, "{model:?} moves points by {farthest} of 200 pixels");
            }
        }
    }
}

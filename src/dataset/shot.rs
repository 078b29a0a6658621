//! What every layout comes down to: where each photograph was taken from, and with which camera.

use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use super::Error;
use super::picture::MAX_EDGE;
use strivec_format::geometry::{Camera, Distortion, Lens, Projection};

/// From a camera's axes in OpenCV (x right, y down, looking along +z) to those in OpenGL, and back.
pub const OPENGL_FROM_OPENCV: DMat3 = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));

/// A file that may hold a picture made so many times smaller.
pub(super) type SmallerPicture = (PathBuf, u32);

/// A photograph, before its picture is looked at.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shot {
    /// The file name without folder and extension; with its folders if another photograph has this name.
    pub(super) name: String,
    /// The path of the photograph in the dataset's folder, with `/` between folders: what it is known by. Set when its file
    /// is looked for.
    pub(super) path: String,
    /// The picture's file.
    pub(super) picture: PathBuf,
    pub(super) smaller: Option<SmallerPicture>,
    /// How many times smaller this file is than the photograph, by its folder's name; 1 for the photograph itself.
    pub(super) reduced: u32,
    /// A picture of the same size that is black where the photograph does not count.
    pub(super) mask: Option<PathBuf>,
    pub(super) intrinsics: Intrinsics,
    /// The camera's axes in the world, in OpenGL's convention.
    pub(super) world_from_camera: DMat3,
    pub(super) position: DVec3,
    /// The split that the layout itself puts it into.
    pub(super) split: Option<Split>,
}

strivec_format::named! {
    /// Part of a dataset.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Split {
        /// Photographs to train on.
        Train = "train",
        /// Photographs to choose settings by.
        Validation = "val",
        /// Photographs to measure by.
        Test = "test",
    }
}

/// The valid extents of pictures.
pub(super) const EXTENT: &str = "a whole number from 1 to 16384";

/// The number of pixels `value`, if it is valid.
pub(super) fn extent(value: f64) -> Option<u32> {
    (value.fract() == 0.0 && (1.0..=f64::from(MAX_EDGE)).contains(&value)).then_some(value as u32)
}

/// A camera without its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Columns and rows of the pictures that the numbers are for; `None` if they are for any picture's own size.
    pub size: Option<[u32; 2]>,
    /// Focal length.
    pub focal: Focal,
    /// Principal point, in pixels; `None` for the picture's middle.
    pub principal: [Option<f64>; 2],
    /// Lens and its distortion.
    pub lens: Lens,
}

/// How a layout states the focal length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Focal {
    /// Focal lengths in pixels, along columns and rows.
    Pixels([f64; 2]),
    /// The angles, in radians, that the picture's width and height span; without the second, pixels are square.
    Angles(f64, Option<f64>),
    /// The angle, in radians, that the picture's height spans; pixels are square.
    VerticalAngle(f64),
    /// The whole sphere, as wide as the picture.
    Panorama,
}

impl Intrinsics {
    /// Checks that numbers are finite and make a camera. `place` is where they stand in the file `path`.
    pub fn check(&self, path: &Path, place: &str) -> Result<(), Error> {
        let refuse = |what: &str, expected: &str, found: f64| {
            Err(Error::text(path, format!("{place}: {what}"), expected, found.to_string()))
        };
        if let Some(size) = self.size {
            for (what, extent) in [("the width", size[0]), ("the height", size[1])] {
                if !(1..=MAX_EDGE).contains(&extent) {
                    return refuse(what, "1 to 16384 pixels", f64::from(extent));
                }
            }
        }
        match self.focal {
            Focal::Pixels(focal) => {
                for (along, value) in ["columns", "rows"].into_iter().zip(focal) {
                    if !(value.is_normal() && value > 0.0) {
                        let what = format!("the focal length along {along}");
                        return refuse(&what, "a positive number of pixels", value);
                    }
                }
            }
            Focal::Angles(x, y) => {
                for value in [Some(x), y].into_iter().flatten() {
                    if !(value > 0.0 && value < PI) {
                        return refuse("the angle of view", "an angle between 0 and π", value);
                    }
                }
            }
            Focal::VerticalAngle(value) if !(value > 0.0 && value < PI) => {
                return refuse("the angle of view", "an angle between 0 and π", value);
            }
            Focal::VerticalAngle(_) | Focal::Panorama => {}
        }
        for (axis, value) in ["column", "row"].into_iter().zip(self.principal) {
            if let Some(value) = value.filter(|value| value.is_nan() || value.abs() > 16.0 * f64::from(MAX_EDGE)) {
                let what = format!("the principal point's {axis}");
                return refuse(&what, "within 262144 pixels of the picture's corner", value);
            }
        }
        let extents = self.size.map(|size| size.map(f64::from)).into_iter().flatten();
        for ((axis, extent), principal) in ["column", "row"].into_iter().zip(extents).zip(self.principal) {
            if let Some(value) = principal.filter(|at| !(0.0..=extent).contains(at)) {
                return refuse(
                    &format!("the principal point's {axis}"),
                    &format!("in the picture, 0 to {extent}"),
                    value,
                );
            }
        }
        Ok(())
    }

    /// Checks that the principal point of unsized intrinsics is near the middle of a picture of `size`: pictures may have
    /// been made smaller without their intrinsics. `listing` is the file that has them.
    pub fn check_principal(&self, size: [u32; 2], listing: &Path) -> Result<(), Error> {
        if self.size.is_some() {
            return Ok(());
        }
        for ((what, extent), principal) in [("column", size[0]), ("row", size[1])].into_iter().zip(self.principal) {
            let extent = f64::from(extent);
            if let Some(found) = principal.filter(|at| !(0.25 * extent..=0.75 * extent).contains(at)) {
                let expected =
                    format!("in the middle half of {extent} pixels unless the dataset says how large its pictures are");
                return Err(Error::text(listing, format!("the principal point's {what}"), expected, found.to_string()));
            }
        }
        Ok(())
    }

    /// The focal lengths and the principal point, in pixels, for pictures of `size`. Pictures may have been made smaller
    /// or larger than in the layout's files, as in COLMAP's `images_4`.
    pub fn for_size(&self, size: [u32; 2]) -> ([f64; 2], [f64; 2]) {
        let declared = self.size.unwrap_or(size).map(f64::from);
        let scale = [0, 1].map(|a| f64::from(size[a]) / declared[a]);
        let focal = match self.focal {
            Focal::Pixels(focal) => focal,
            Focal::Angles(x, y) => {
                let of = |extent: f64, angle: f64| 0.5 * extent / (0.5 * angle).tan();
                let along_columns = of(declared[0], x);
                [along_columns, y.map_or(along_columns, |angle| of(declared[1], angle))]
            }
            Focal::VerticalAngle(angle) => [0.5 * declared[1] / (0.5 * angle).tan(); 2],
            Focal::Panorama => [declared[0] / TAU, declared[1] / PI],
        };
        let principal = [0, 1].map(|a| self.principal[a].unwrap_or(0.5 * declared[a]) * scale[a]);
        ([focal[0] * scale[0], focal[1] * scale[1]], principal)
    }
}

/// True if a picture of `size` is one of `declared` made smaller or larger: its sides have the same ratio, up to the
/// rounding to pixels or to usual sizes, as of ScanNet's 1296x968 to 640x480.
pub(super) fn is_scaled(size: [u32; 2], declared: [u32; 2]) -> bool {
    let [width, height] = size.map(f64::from);
    let scale = width / f64::from(declared[0]);
    (height - scale * f64::from(declared[1])).abs() <= (0.02 * height).max(scale).max(1.0)
}

/// How many times smaller or, with `true`, larger a picture of `size` is than `declared`, if that is a whole number up to
/// the rounding of its sides.
pub(super) fn whole_scale(size: [u32; 2], declared: [u32; 2]) -> Option<(u32, bool)> {
    let fits = |small: [u32; 2], large: [u32; 2]| {
        let factor = (f64::from(large[0]) / f64::from(small[0])).round().max(1.0) as u32;
        let is_side = |(small, large): (u32, u32)| small == large / factor || small == large.div_ceil(factor);
        small.into_iter().zip(large).all(is_side).then_some(factor)
    };
    let smaller = fits(size, declared).map(|factor| (factor, false));
    smaller.or_else(|| fits(declared, size).map(|factor| (factor, true)))
}

impl Shot {
    /// The photograph `picture`, known by the name of its file, without a mask, a split or a smaller picture.
    pub(super) fn of(picture: PathBuf, intrinsics: Intrinsics, world_from_camera: DMat3, position: DVec3) -> Self {
        Self {
            name: picture.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
            path: String::new(),
            picture,
            smaller: None,
            reduced: 1,
            mask: None,
            intrinsics,
            world_from_camera,
            position,
            split: None,
        }
    }

    /// The camera of a picture of `size` (columns and rows).
    pub(super) fn camera(&self, size: [u32; 2]) -> Camera {
        let (focal, principal) = self.intrinsics.for_size(size);
        let &Self { world_from_camera, position, .. } = self;
        let lens = self.intrinsics.lens;
        Camera { width: size[0], height: size[1], focal, principal, lens, world_from_camera, position }
    }
}

/// The lens of a camera model by COLMAP's name and its parameters after focal lengths and principal point. `None` if there
/// is no such model, or not of that many parameters, or one is not finite.
///
/// The order of parameters is COLMAP's: k1, k2, p1, p2, k3, k4, and so on.
pub fn lens_of(model: &str, parameters: &[f64]) -> Option<Lens> {
    let perspective = |radial, divisor, tangential| {
        let distortion = Distortion::new(radial, divisor, tangential, [0.0; 2])?;
        Some(Lens { projection: Projection::Perspective, distortion })
    };
    let fisheye = |radial, tangential, prism| {
        let distortion = Distortion::new(radial, [0.0; 3], tangential, prism)?;
        Some(Lens { projection: Projection::Fisheye, distortion })
    };
    match (model, parameters) {
        ("SIMPLE_PINHOLE" | "PINHOLE" | "PERSPECTIVE", []) => Some(Lens::PINHOLE),
        ("SIMPLE_RADIAL", &[k]) => perspective([k, 0.0, 0.0, 0.0], [0.0; 3], [0.0; 2]),
        ("RADIAL", &[k1, k2]) => perspective([k1, k2, 0.0, 0.0], [0.0; 3], [0.0; 2]),
        ("OPENCV", &[k1, k2, p1, p2]) => perspective([k1, k2, 0.0, 0.0], [0.0; 3], [p1, p2]),
        ("FULL_OPENCV", &[k1, k2, p1, p2, k3, k4, k5, k6]) => perspective([k1, k2, k3, 0.0], [k4, k5, k6], [p1, p2]),
        ("OPENCV_FISHEYE", &[k1, k2, k3, k4]) => fisheye([k1, k2, k3, k4], [0.0; 2], [0.0; 2]),
        ("SIMPLE_FISHEYE" | "FISHEYE", []) => fisheye([0.0; 4], [0.0; 2], [0.0; 2]),
        ("SIMPLE_RADIAL_FISHEYE", &[k]) => fisheye([k, 0.0, 0.0, 0.0], [0.0; 2], [0.0; 2]),
        ("RADIAL_FISHEYE", &[k1, k2]) => fisheye([k1, k2, 0.0, 0.0], [0.0; 2], [0.0; 2]),
        ("THIN_PRISM_FISHEYE", &[k1, k2, p1, p2, k3, k4, sx, sy]) => fisheye([k1, k2, k3, k4], [p1, p2], [sx, sy]),
        _ => None,
    }
}

/// The camera models that [`lens_of`] supports, for messages.
pub(super) const MODELS: &str = "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, SIMPLE_FISHEYE, \
    FISHEYE, OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, THIN_PRISM_FISHEYE or EQUIRECTANGULAR";

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    fn shot(intrinsics: Intrinsics) -> Shot {
        Shot {
            name: String::new(),
            path: String::new(),
            picture: PathBuf::new(),
            smaller: None,
            reduced: 1,
            mask: None,
            intrinsics,
            world_from_camera: DMat3::IDENTITY,
            position: DVec3::ZERO,
            split: None,
        }
    }

    #[test]
    fn intrinsics_follow_the_size_of_the_picture() {
        let lens = lens_of("OPENCV", &[0.1, 0.01, 0.001, 0.002]).unwrap();
        let full = Intrinsics {
            size: Some([1080, 1920]),
            focal: Focal::Pixels([1375.5, 1374.5]),
            principal: [Some(554.5), Some(965.25)],
            lens,
        };
        let camera = shot(full).camera([1080, 1920]);
        assert_eq!((camera.focal, camera.principal), ([1375.5, 1374.5], [554.5, 965.25]));
        let quarter = shot(full).camera([270, 480]);
        assert_eq!((quarter.focal, quarter.principal), ([343.875, 343.625], [138.625, 241.3125]));
        // The same direction falls on the same place of the picture.
        let at = DVec2::new(100.0, 300.0);
        assert_eq!(camera.ray_through(4.0 * at.x, 4.0 * at.y).unwrap(), quarter.ray_through(at.x, at.y).unwrap());
    }

    #[test]
    fn angles_of_view_and_missing_principal_points_are_of_the_picture() {
        let right =
            Intrinsics { size: None, focal: Focal::Angles(0.5 * PI, None), principal: [None; 2], lens: Lens::PINHOLE };
        let camera = shot(right).camera([200, 100]);
        assert!((camera.focal[0] - 100.0).abs() < 1e-12 && camera.focal[0] == camera.focal[1]);
        assert_eq!(camera.principal, [100.0, 50.0]);
    }

    #[test]
    fn sizes_are_whole_fractions_up_to_their_rounding() {
        let of = |size| whole_scale(size, [97, 64]);
        assert_eq!(of([97, 64]), Some((1, false)));
        assert_eq!([of([48, 32]), of([49, 32]), of([24, 16])], [Some((2, false)), Some((2, false)), Some((4, false))]);
        assert_eq!(of([194, 128]), Some((2, true)));
        assert_eq!([of([95, 62]), of([96, 63]), of([65, 43])], [None; 3]);
    }

    #[test]
    fn numbers_that_make_no_camera_are_refused() {
        let good = Intrinsics {
            size: Some([8, 6]),
            focal: Focal::Pixels([9.0; 2]),
            principal: [Some(4.0), None],
            lens: Lens::PINHOLE,
        };
        let path = Path::new("cameras.txt");
        assert!(good.check(path, "camera 1").is_ok());
        for (bad, named) in [
            (Intrinsics { focal: Focal::Pixels([0.0, 9.0]), ..good }, "focal length"),
            (Intrinsics { focal: Focal::Pixels([9.0, f64::NAN]), ..good }, "focal length"),
            (Intrinsics { focal: Focal::Angles(4.0, None), ..good }, "angle of view"),
            (Intrinsics { principal: [Some(f64::INFINITY), None], ..good }, "principal point"),
            (
                Intrinsics { principal: [None, Some(7.0)], ..good },
                "the principal point's row must be in the picture, 0 to 6",
            ),
            (Intrinsics { size: Some([0, 6]), ..good }, "width"),
            (Intrinsics { size: Some([8, 1 << 20]), ..good }, "height"),
        ] {
            let message = bad.check(path, "camera 1").unwrap_err().to_string();
            assert!(message.contains(named) && message.contains("cameras.txt: camera 1"), "{message}");
        }
        assert!(lens_of("OPENCV", &[0.0; 3]).is_none() && lens_of("FOV", &[0.5]).is_none());
        assert!(lens_of("SIMPLE_RADIAL", &[f64::NAN]).is_none());
    }
}

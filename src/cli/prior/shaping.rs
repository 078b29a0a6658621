//! Options for occupied cells from geometry files.

use std::path::Path;

use glam::{DAffine3, DMat3, DMat4};

use crate::Error;
use crate::numbers::{boxed, numbers};
use crate::table::plural;
use strivec_capture::prior::{BuildOptions, Outliers};
use strivec_format::geometry::Aabb;
use strivec_format::model::UpAxis;
use strivec_import::ReadOptions;

/// Options of every prior from files.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Prior geometry")]
pub(crate) struct Shaping {
    /// Edge of a cell, in dataset units [default: the grid's; else about a million cells in the files' bounds, without points far from the others]
    #[arg(long, value_name = "LENGTH")]
    voxel: Option<f64>,
    /// Thickness of surfaces and points, in dataset units
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0)]
    thickness: f64,
    /// Treat meshes and splats as point clouds: use only vertices and centers
    #[arg(long)]
    vertices: bool,
    /// Drop points whose mean distance to K neighbors exceeds the mean of all points by S standard deviations [default: keep all]
    #[arg(long, value_name = "K,S", value_parser = numbers::<2>)]
    outliers: Option<[f64; 2]>,
    /// Drop cells with fewer than N points
    #[arg(long, value_name = "N", default_value_t = 1)]
    min_points: u32,
    /// Drop points with a confidence below C, in files with confidences; that of a splat is its opacity
    #[arg(long, value_name = "C", default_value_t = 0.0)]
    min_confidence: f64,
    /// Gaussian splats: drop those with a smaller opacity; 0 keeps all
    #[arg(long, value_name = "ALPHA", default_value_t = ReadOptions::default().min_opacity)]
    min_opacity: f64,
    /// LAS: keep points marked as withheld or as noise (classes 7 and 18) [default: drop them]
    #[arg(long)]
    keep_noise: bool,
    /// COLMAP: drop points seen in fewer than N pictures; 0 keeps all
    #[arg(long, value_name = "N", default_value_t = 0)]
    min_track: u64,
    /// COLMAP: drop points with a larger mean reprojection error, in pixels [default: keep all]
    #[arg(long, value_name = "PIXELS")]
    max_error: Option<f64>,
    /// Density grids: least opacity of an occupied cell
    #[arg(long, value_name = "ALPHA", default_value_t = ReadOptions::default().min_alpha)]
    min_alpha: f64,
    /// Other grids and octrees: cells above this value are occupied
    #[arg(long, value_name = "VALUE", default_value_t = ReadOptions::default().threshold, allow_hyphen_values = true)]
    threshold: f64,
    /// Bounds of a grid without bounds of its own: smallest and largest corner
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = boxed, allow_hyphen_values = true)]
    bounds: Option<Aabb>,
    /// Length of the files' unit in dataset units, such as 0.001 for millimeters in a dataset in meters [default: 1]
    #[arg(long = "scale", value_name = "FACTOR")]
    scale: Option<f64>,
    /// The files' up axis, turned to the dataset's z before --transform [default: z]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true, value_parser = ["x", "y", "z", "-x", "-y", "-z"])]
    up: Option<String>,
    /// Transform from the files' space to the dataset's: 16 comma-separated numbers, the rows of a 4x4 matrix, or a file with them [default: identity]
    #[arg(long, value_name = "MATRIX", allow_hyphen_values = true)]
    transform: Option<String>,
    /// Drop geometry outside this box in the dataset's space: smallest and largest corner [default: keep all]
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = boxed, allow_hyphen_values = true)]
    crop: Option<Aabb>,
    /// Fill holes of up to this radius, in dataset units; 0 fills none
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0)]
    close: f64,
    /// Dilate the occupied cells by this distance, in dataset units; 0 leaves them
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0)]
    dilate: f64,
}

impl Shaping {
    /// The library's options.
    pub(crate) fn options(&self) -> Result<BuildOptions, Error> {
        let read = ReadOptions {
            vertices: self.vertices,
            min_confidence: self.min_confidence,
            min_opacity: self.min_opacity,
            keep_noise: self.keep_noise,
            min_track: self.min_track,
            max_reprojection_error: self.max_error.unwrap_or(f64::INFINITY),
            min_alpha: self.min_alpha,
            threshold: self.threshold,
            bounds: self.bounds,
        };
        let outliers = match self.outliers {
            None => None,
            Some([k, _]) if k.fract() != 0.0 || !(1.0..=1000.0).contains(&k) => {
                return Err(Error::Usage(format!("--outliers {k}: K must be a whole number from 1 to 1000")));
            }
            Some([k, deviations]) => Some(Outliers { neighbors: k as usize, deviations }),
        };
        Ok(BuildOptions {
            read,
            transform: self.map()?,
            crop: self.crop,
            voxel: self.voxel,
            thickness: self.thickness,
            outliers,
            min_points: self.min_points,
            close: self.close,
            dilate: self.dilate,
        })
    }

    /// From the files' space to the dataset's.
    fn map(&self) -> Result<DAffine3, Error> {
        let scale = self.scale.unwrap_or(1.0);
        if !(scale.is_normal() && scale > 0.0) {
            return Err(Error::Usage(format!("--scale {scale}: must be positive")));
        }
        let turned = DAffine3::from_mat3(self.up.as_deref().map_or(DMat3::IDENTITY, to_z_up) * scale);
        let given = self.transform.as_deref().map(matrix).transpose()?.unwrap_or(DAffine3::IDENTITY);
        Ok(given * turned)
    }
}

/// The rotation that takes the axis `up` to z.
fn to_z_up(up: &str) -> DMat3 {
    UpAxis::from_name(up).map_or(DMat3::IDENTITY, UpAxis::z_up_from)
}

/// A 4×4 matrix from an argument, or from the file that it names.
fn matrix(text: &str) -> Result<DAffine3, Error> {
    let path = Path::new(text);
    let (place, text) = if text.contains(',') || !path.exists() {
        ("--transform".to_owned(), text.to_owned())
    } else {
        (path.display().to_string(), std::fs::read_to_string(path).map_err(Error::io("read", path))?)
    };
    let wrong = |found: String| {
        Error::Usage(format!(
            "{place}: needs 16 numbers, the rows of a 4x4 matrix with last row 0 0 0 1; it has {found}"
        ))
    };
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
    let numbers: Option<Vec<f64>> = words.map(|w| w.parse().ok().filter(|v: &f64| v.is_finite())).collect();
    let numbers = numbers.ok_or_else(|| wrong("values that are not finite numbers".into()))?;
    let rows: [f64; 16] = numbers.try_into().map_err(|n: Vec<f64>| wrong(plural(n.len(), "number")))?;
    if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(wrong(format!("the last row {:?}", &rows[12..])));
    }
    Ok(DAffine3::from_mat4(DMat4::from_cols_array(&rows).transpose()))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn up_is_brought_to_z_and_handedness_kept() {
        for (name, axis) in [
            ("x", DVec3::X),
            ("y", DVec3::Y),
            ("z", DVec3::Z),
            ("-x", DVec3::NEG_X),
            ("-y", DVec3::NEG_Y),
            ("-z", DVec3::NEG_Z),
        ] {
            let turn = to_z_up(name);
            assert_eq!(turn * axis, DVec3::Z, "{name}");
            assert_eq!(turn.determinant(), 1.0, "{name}");
        }
    }

    #[test]
    fn matrices_are_rows() {
        let map = matrix("1,0,0,7,0,2,0,8,0,0,1,9,0,0,0,1").ok().unwrap();
        assert_eq!(map.transform_point3(DVec3::ONE), DVec3::new(8.0, 10.0, 10.0));
        for wrong in ["1,2,3", "1,0,0,7,0,2,0,8,0,0,1,9,0,0,1,1", "no such file"] {
            assert!(matches!(matrix(wrong), Err(Error::Usage(_))), "{wrong}");
        }
    }
}

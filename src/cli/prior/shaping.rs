//! What becomes of files' geometry, as arguments.

use std::path::Path;

use glam::{DAffine3, DMat3, DMat4, DVec3};

use crate::cli::Error;
use crate::cli::numbers::{boxed, numbers};
use crate::geometry::Aabb;
use crate::import::ReadOptions;
use crate::prior::{BuildOptions, Outliers};

/// Options of every prior from files.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "What becomes of the files' geometry")]
pub(in crate::cli) struct Shaping {
    /// Edge of a cell, in the dataset's units [default: grids' own; else about a million cells in the files' bounds]
    #[arg(long, value_name = "LENGTH")]
    voxel: Option<f64>,
    /// How thick surfaces and points are, in the dataset's units
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0)]
    thickness: f64,
    /// Of meshes only the vertices, as points
    #[arg(long)]
    vertices: bool,
    /// Leave points out whose mean distance to K neighbors exceeds the mean of all by S standard deviations
    #[arg(long, value_name = "K,S", value_parser = numbers::<2>)]
    outliers: Option<[f64; 2]>,
    /// Leave cells with fewer points out
    #[arg(long, value_name = "N", default_value_t = 1)]
    min_points: u32,
    /// Leave points of less confidence out, where a file has confidences
    #[arg(long, value_name = "C", default_value_t = 0.0)]
    min_confidence: f64,
    /// COLMAP: leave points out that fewer pictures show
    #[arg(long, value_name = "N", default_value_t = 0)]
    min_track: u64,
    /// COLMAP: leave points of a larger mean reprojection error out, in pixels
    #[arg(long, value_name = "PIXELS")]
    max_error: Option<f64>,
    /// Density grids: cells are occupied from this opacity on
    #[arg(long, value_name = "ALPHA", default_value_t = ReadOptions::default().min_alpha)]
    min_alpha: f64,
    /// Other grids and octrees: cells are occupied above this
    #[arg(long, value_name = "VALUE", default_value_t = ReadOptions::default().threshold, allow_hyphen_values = true)]
    threshold: f64,
    /// What a grid spans that does not say so: its smallest and its largest corner
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = boxed, allow_hyphen_values = true)]
    bounds: Option<Aabb>,
    /// The files' unit in the dataset's units, as in 0.001 for millimeters where the dataset has meters
    #[arg(long = "scale", value_name = "FACTOR")]
    scale: Option<f64>,
    /// Which of the files' axes points up; the dataset's is z. Before --transform
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true, value_parser = ["x", "y", "z", "-x", "-y", "-z"])]
    up: Option<String>,
    /// From the files' space to the dataset's: 16 numbers, the rows of a 4x4 matrix, with commas between; or a file of them
    #[arg(long, value_name = "MATRIX", allow_hyphen_values = true)]
    transform: Option<String>,
    /// Leave out what is outside, in the dataset's space: the smallest and the largest corner
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = boxed, allow_hyphen_values = true)]
    crop: Option<Aabb>,
    /// Fill holes of up to this radius, in the dataset's units
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0)]
    close: f64,
    /// Grow cells by this to all sides, in the dataset's units
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0)]
    dilate: f64,
}

impl Shaping {
    /// As the library takes them.
    pub(in crate::cli) fn options(&self) -> Result<BuildOptions, Error> {
        let read = ReadOptions {
            vertices: self.vertices,
            min_confidence: self.min_confidence,
            min_track: self.min_track,
            max_reprojection_error: self.max_error.unwrap_or(f64::INFINITY),
            min_alpha: self.min_alpha,
            threshold: self.threshold,
            bounds: self.bounds,
        };
        let outliers = match self.outliers {
            None => None,
            Some([k, _]) if k.fract() != 0.0 || !(1.0..=1000.0).contains(&k) => {
                return Err(Error::Usage(format!("--outliers: expected 1 to 1000 neighbors, found {k}")));
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
            return Err(Error::Usage(format!("--scale: expected a positive number, found {scale}")));
        }
        let turned = DAffine3::from_mat3(self.up.as_deref().map_or(DMat3::IDENTITY, to_z_up) * scale);
        let given = self.transform.as_deref().map(matrix).transpose()?.unwrap_or(DAffine3::IDENTITY);
        Ok(given * turned)
    }
}

/// The quarter turn, or two, that brings `up` to z.
fn to_z_up(up: &str) -> DMat3 {
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    // The columns: where x, y and z go.
    match up {
        "x" => DMat3::from_cols(z, y, -x),
        "-x" => DMat3::from_cols(-z, y, x),
        "y" => DMat3::from_cols(x, z, -y),
        "-y" => DMat3::from_cols(x, -z, y),
        "-z" => DMat3::from_cols(x, -y, -z),
        _ => DMat3::IDENTITY,
    }
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
            "{place}: expected 16 numbers, the rows of a 4x4 matrix whose last is 0 0 0 1, found {found}"
        ))
    };
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
    let numbers: Option<Vec<f64>> = words.map(|w| w.parse().ok().filter(|v: &f64| v.is_finite())).collect();
    let numbers = numbers.ok_or_else(|| wrong("something else".into()))?;
    let rows: [f64; 16] = numbers.try_into().map_err(|n: Vec<f64>| wrong(format!("{} of them", n.len())))?;
    if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(wrong(format!("{:?} as the last", &rows[12..])));
    }
    Ok(DAffine3::from_mat4(DMat4::from_cols_array(&rows).transpose()))
}

#[cfg(test)]
mod tests {
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

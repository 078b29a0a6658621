//! Refined camera poses that training writes beside a scene: the frames of a `transforms.json`, and the factor by which
//! focal lengths grew.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::FileError;
use strivec_capture::dataset::{NamedCamera, Photograph};
use strivec_format::digits::plural;
use strivec_format::geometry::{Camera, Similarity, align_cameras};

/// The largest file that is read, in bytes.
const MAX_BYTES: u64 = 64 << 20;

/// The refined poses of a training's photographs.
#[derive(Clone, Debug, PartialEq)]
pub struct RefinedPoses {
    poses: Poses,
    /// By how many degrees cameras turned, and how far they moved in dataset units, in the median.
    median_moves: [f64; 2],
}

/// A file of refined poses that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PosesError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file has invalid contents.
    #[error("{}: {found}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The fault.
        found: String,
    },
}

/// The contents of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Poses {
    /// The refined focal lengths are the dataset's times this.
    #[serde(default = "one")]
    focal_scale: f64,
    frames: Vec<PhotographPose>,
}

fn one() -> f64 {
    1.0
}

/// A photograph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct PhotographPose {
    file_path: String,
    transform_matrix: [[f64; 4]; 4],
}

impl RefinedPoses {
    /// \[view\] the `refined` cameras of `views`, in the dataset's space; at least one.
    pub fn new(views: &[Photograph], refined: &[Camera]) -> Self {
        let frame = |(view, camera): (&Photograph, &Camera)| PhotographPose {
            file_path: view.name.clone(),
            transform_matrix: *camera.pose().as_chunks::<4>().0.first_chunk().expect("16 numbers"),
        };
        let focal_scale =
            views.first().zip(refined.first()).map_or(1.0, |(view, camera)| camera.focal[0] / view.camera.focal[0]);
        let median = |of: fn(&Camera, &Camera) -> f64| {
            let moves = views.iter().zip(refined).map(|(view, camera)| of(&view.camera, camera));
            let mut moves: Vec<f64> = moves.collect();
            moves.sort_by(f64::total_cmp);
            moves[moves.len() / 2]
        };
        Self {
            median_moves: [median(Camera::degrees_to), median(|from, to| from.position.distance(to.position))],
            poses: Poses { focal_scale, frames: views.iter().zip(refined).map(frame).collect() },
        }
    }

    /// The contents of the file.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(&self.poses).expect("numbers are JSON")
    }

    /// How far the cameras moved, in words.
    pub fn summary(&self) -> String {
        let Poses { focal_scale, frames } = &self.poses;
        let [degrees, distance] = self.median_moves;
        format!(
            "the refined poses of {}, turned by {degrees:.3} degrees and moved by {distance:.5} units in the median, focal \
             lengths times {focal_scale:.5}",
            plural(frames.len(), "photograph")
        )
    }

    /// The map from the dataset's space, in which `cameras` are, to that of the refined poses in the file `path`, and the
    /// factor of its focal lengths.
    ///
    /// # Errors
    ///
    /// [`PosesError::File`] if the file cannot be read; [`PosesError::Malformed`] if it is too long, has invalid contents,
    /// or shares fewer than two places of cameras with the dataset.
    pub fn alignment(path: &Path, cameras: &[NamedCamera]) -> Result<(Similarity, f64), PosesError> {
        let malformed = |found: String| PosesError::Malformed { path: path.to_path_buf(), found };
        let length = std::fs::metadata(path).map_err(FileError::io("read", path))?.len();
        if length > MAX_BYTES {
            return Err(malformed(format!("{length} bytes; refined poses have at most {MAX_BYTES}")));
        }
        let text = std::fs::read_to_string(path).map_err(FileError::io("read", path))?;
        let poses: Poses = serde_json::from_str(&text)
            .map_err(|e| malformed(format!("not the refined poses that a training with `poses.refine` writes: {e}")))?;
        let focal_scale = poses.focal_scale;
        if !(focal_scale.is_finite() && focal_scale > 0.0) {
            return Err(malformed(format!("focal_scale must be positive; found {focal_scale}")));
        }
        let (mut from, mut to) = (Vec::new(), Vec::new());
        for frame in &poses.frames {
            let Some(named) = cameras.iter().find(|camera| camera.name == frame.file_path) else { continue };
            let camera = Camera::posed(frame.transform_matrix.as_flattened(), [1, 1], 1.0);
            to.push(camera.map_err(|e| malformed(format!("{}: {e}", frame.file_path)))?);
            from.push(named.camera);
        }
        align_cameras(&from, &to).map(|map| (map, focal_scale)).ok_or_else(|| {
            malformed(format!(
                "{} of its photographs are in the dataset; an alignment needs two in different places",
                from.len()
            ))
        })
    }
}

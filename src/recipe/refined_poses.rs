//! Refined camera poses that training writes beside a scene: the frames of a `transforms.json`, and the factor by which
//! focal lengths grew.

use std::collections::HashMap;
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

/// \[frame\] the number of its camera in `cameras`: by its path; in files of earlier versions, which have names without folder
/// and ending, by a name that only one photograph has, or by the order of photographs if it is the same.
fn places_of(frames: &[PhotographPose], cameras: &[NamedCamera]) -> Vec<Option<usize>> {
    let stem = |path: &str| {
        let name = path.rsplit(['/', '\\']).next().unwrap_or_default();
        name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_lowercase()
    };
    let stems: Vec<String> = cameras.iter().map(|camera| stem(&camera.path)).collect();
    let is_stem_of = |frame: &PhotographPose, n: usize| {
        let name = frame.file_path.to_lowercase();
        stems[n] == name || cameras[n].name == frame.file_path || stem(&name) == stems[n]
    };
    let is_in_order = frames.len() == cameras.len()
        && frames.iter().zip(0..).all(|(frame, n)| !frame.file_path.contains('/') && is_stem_of(frame, n));
    // Of several cameras of a path, the first.
    let by_path: HashMap<&str, usize> =
        cameras.iter().enumerate().rev().map(|(n, camera)| (camera.path.as_str(), n)).collect();
    let of = |(n, frame): (usize, &PhotographPose)| {
        if let Some(&place) = by_path.get(frame.file_path.as_str()) {
            return Some(place);
        }
        if is_in_order {
            return Some(n);
        }
        let is_alone = frames.iter().filter(|other| other.file_path == frame.file_path).count() == 1;
        let mut found = (0..cameras.len()).filter(|&n| !frame.file_path.contains('/') && is_stem_of(frame, n));
        found.next().filter(|_| found.next().is_none() && is_alone)
    };
    frames.iter().enumerate().map(of).collect()
}

impl RefinedPoses {
    /// \[view\] the `refined` cameras of `views`, in the dataset's space; at least one.
    pub fn new(views: &[Photograph], refined: &[Camera]) -> Self {
        let frame = |(view, camera): (&Photograph, &Camera)| PhotographPose {
            file_path: view.path.clone(),
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
        let places = places_of(&poses.frames, cameras);
        for (frame, place) in poses.frames.iter().zip(places) {
            let Some(named) = place.map(|place| &cameras[place]) else { continue };
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn frames(names: &[&str]) -> Vec<PhotographPose> {
        let matrix = [[0.0; 4]; 4];
        names.iter().map(|name| PhotographPose { file_path: (*name).into(), transform_matrix: matrix }).collect()
    }

    fn cameras(paths: &[&str]) -> Vec<NamedCamera> {
        let camera = Camera::looking_at([8, 8], 8.0, DVec3::X, DVec3::ZERO, DVec3::Z);
        paths.iter().map(|path| NamedCamera { name: "name".into(), path: (*path).into(), camera }).collect()
    }

    #[test]
    fn photographs_are_known_by_their_paths_and_in_old_files_by_unique_names() {
        let both = cameras(&["left/0.png", "right/0.png", "left/1.png"]);
        assert_eq!(places_of(&frames(&["right/0.png", "left/0.png"]), &both), [Some(1), Some(0)]);
        // One name of two photographs means neither of them; a folder is never left out.
        assert_eq!(places_of(&frames(&["0", "1"]), &both), [None, Some(2)]);
        assert_eq!(places_of(&frames(&["other/1.png"]), &both), [None]);
        // All photographs in their order: earlier versions wrote them so.
        assert_eq!(places_of(&frames(&["0", "0", "1"]), &both), [Some(0), Some(1), Some(2)]);
        assert_eq!(places_of(&frames(&["0", "1", "0"]), &both), [None, Some(2), None]);
    }
}

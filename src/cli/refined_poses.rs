//! The file of refined camera poses that training writes beside a scene: the frames of a `transforms.json`, and the factor
//! by which focal lengths grew.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::table::plural;
use super::{Error, Session, write_atomically};
use crate::dataset::{NamedCamera, View};
use crate::geometry::{Camera, Similarity, align_cameras};

/// The largest file that is read, in bytes.
const MAX_BYTES: u64 = 64 << 20;

#[derive(Serialize, Deserialize)]
struct Poses {
    /// The refined focal lengths are the dataset's times this.
    #[serde(default = "one")]
    focal_scale: f64,
    frames: Vec<Frame>,
}

fn one() -> f64 {
    1.0
}

#[derive(Serialize, Deserialize)]
struct Frame {
    file_path: String,
    transform_matrix: [[f64; 4]; 4],
}

/// Writes the `refined` cameras of `views`, and prints how far they moved.
pub(super) fn write(path: &Path, views: &[View], refined: &[Camera], session: &Session) -> Result<(), Error> {
    let frame = |(view, camera): (&View, &Camera)| Frame {
        file_path: view.name.clone(),
        transform_matrix: *camera.pose().as_chunks::<4>().0.first_chunk().expect("16 numbers"),
    };
    let focal_scale =
        views.first().zip(refined.first()).map_or(1.0, |(view, camera)| camera.focal[0] / view.camera.focal[0]);
    let poses = Poses { focal_scale, frames: views.iter().zip(refined).map(frame).collect() };
    let text = serde_json::to_string_pretty(&poses).expect("numbers are JSON");
    write_atomically(path, text.as_bytes(), session.force)?;
    let median = |of: fn(&Camera, &Camera) -> f64| {
        let mut moves: Vec<f64> = views.iter().zip(refined).map(|(view, camera)| of(&view.camera, camera)).collect();
        moves.sort_by(f64::total_cmp);
        moves[moves.len() / 2]
    };
    session.console.say(&format!(
        "{}: the refined poses of {}, turned by {:.3} degrees and moved by {:.5} units in the median, focal lengths times \
         {focal_scale:.5}",
        path.display(),
        plural(views.len(), "photograph"),
        median(Camera::degrees_to),
        median(|from, to| from.position.distance(to.position))
    ));
    Ok(())
}

/// The map from the dataset's space, in which `cameras` are, to that of the refined poses in the file `path`, and the factor
/// of its focal lengths.
pub(super) fn alignment(path: &Path, cameras: &[NamedCamera]) -> Result<(Similarity, f64), Error> {
    let malformed = |found: String| Error::Malformed(format!("{}: {found}", path.display()));
    let length = std::fs::metadata(path).map_err(Error::io("read", path))?.len();
    if length > MAX_BYTES {
        return Err(malformed(format!("{length} bytes; refined poses have at most {MAX_BYTES}")));
    }
    let text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
    let poses: Poses = serde_json::from_str(&text)
        .map_err(|e| malformed(format!("not the refined poses that `strivec train --refine-poses` writes: {e}")))?;
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

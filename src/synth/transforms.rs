//! `transforms_*.json` of NeRF-synthetic, and `transforms.json` of Instant-NGP and nerfstudio.

use std::io;
use std::path::Path;

use serde_json::{Value, json};

use super::camera_model::CameraModel;
use super::layout::PlannedPicture;
use super::options::write;
use super::pictures::CAMERA_ANGLE;
use crate::Error;
use strivec_dataset::Split;

/// Writes `transforms_train.json`, `_val` and `_test`.
pub(super) fn write_blender(out: &Path, photographs: &[PlannedPicture]) -> Result<(), Error> {
    for split in Split::ALL {
        let of_split = photographs.iter().filter(|photograph| photograph.split == split);
        let frames: Vec<_> = of_split.map(|p| frame(p, &format!("./{}", p.file.trim_end_matches(".png")))).collect();
        let json = json!({ "camera_angle_x": CAMERA_ANGLE, "frames": frames });
        write_json(&out.join(format!("transforms_{}.json", split.name())), &json)?;
    }
    Ok(())
}

/// Writes `transforms.json` with the camera's keys at the top, the splits as lists, and `points.ply` as its points. If it
/// `has_depths`, it names the depth maps.
pub(super) fn write_transforms(
    out: &Path,
    photographs: &[PlannedPicture],
    model: CameraModel,
    has_depths: bool,
) -> Result<(), Error> {
    let camera = &photographs[0].camera;
    let frame = |photograph: &PlannedPicture| {
        let mut frame = frame(photograph, &photograph.file);
        if has_depths {
            frame["depth_file_path"] = json!(photograph.depth_file());
        }
        frame
    };
    let frames: Vec<_> = photographs.iter().map(frame).collect();
    let mut json = json!({
        "camera_model": model.colmap_name(),
        "w": camera.width,
        "h": camera.height,
        "ply_file_path": "points.ply",
        "frames": frames,
    });
    if model != CameraModel::Equirectangular {
        let ([fl_x, fl_y], [cx, cy]) = (camera.focal, camera.principal);
        for (key, value) in [("fl_x", fl_x), ("fl_y", fl_y), ("cx", cx), ("cy", cy)] {
            json[key] = json!(value);
        }
    }
    for &(key, value) in model.coefficients() {
        json[key] = json!(value);
    }
    if has_depths {
        json["integer_depth_scale"] = json!(1.0);
    }
    for split in Split::ALL {
        let of_split = photographs.iter().filter(|photograph| photograph.split == split);
        let names: Vec<_> = of_split.map(|photograph| &photograph.file).collect();
        json[format!("{}_filenames", split.name())] = json!(names);
    }
    write_json(&out.join("transforms.json"), &json)
}

fn frame(photograph: &PlannedPicture, file_path: &str) -> Value {
    json!({ "file_path": file_path, "transform_matrix": photograph.camera.pose().as_chunks::<4>().0 })
}

fn write_json(path: &Path, json: &Value) -> Result<(), Error> {
    write(path, |file| serde_json::to_writer_pretty(&mut *file, json).map_err(io::Error::from))
}

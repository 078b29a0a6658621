//! Metashape's `cameras.xml`.

use std::io::Write;
use std::path::Path;

use super::camera_model::CameraModel;
use super::layout::PlannedPicture;
use super::options::write;
use crate::Error;
use strivec_dataset::OPENGL_FROM_OPENCV;
use strivec_format::geometry::{Camera, Projection};

/// Writes `cameras.xml`: one sensor, and the cameras of one component.
pub(super) fn write_metashape(out: &Path, photographs: &[PlannedPicture], model: CameraModel) -> Result<(), Error> {
    write(&out.join("cameras.xml"), |file| {
        let sensor = sensor(&photographs[0].camera, model);
        writeln!(file, r#"<?xml version="1.0" encoding="UTF-8"?>"#)?;
        writeln!(file, r#"<document version="1.2.0"><chunk label="Chunk 1" enabled="true">"#)?;
        writeln!(file, "<sensors next_id=\"1\">\n{sensor}</sensors>")?;
        writeln!(file, r#"<cameras next_id="{}">"#, photographs.len())?;
        for (n, photograph) in photographs.iter().enumerate() {
            let camera = &photograph.camera;
            let in_opencv = Camera { world_from_camera: camera.world_from_camera * OPENGL_FROM_OPENCV, ..*camera };
            let numbers = in_opencv.pose().map(|value| value.to_string()).join(" ");
            let label = photograph.stem();
            write!(file, r#"<camera id="{n}" sensor_id="0" component_id="0" label="{label}">"#)?;
            writeln!(file, "<transform>{numbers}</transform></camera>")?;
        }
        writeln!(file, "</cameras>\n</chunk></document>")
    })
}

/// The sensor of `camera` with its calibration. The focal length is that along rows; b1 is the difference of the other.
fn sensor(camera: &Camera, model: CameraModel) -> String {
    let kind = match model {
        CameraModel::Equirectangular => "spherical",
        _ if camera.lens.projection == Projection::Fisheye => "fisheye",
        _ => "frame",
    };
    let resolution = format!(r#"<resolution width="{}" height="{}"/>"#, camera.width, camera.height);
    let mut text = format!("<sensor id=\"0\" label=\"synthetic\" type=\"{kind}\">{resolution}\n");
    if kind != "spherical" {
        let ([fx, fy], [cx, cy]) = (camera.focal, camera.principal);
        let (cx, cy) = (cx - 0.5 * f64::from(camera.width), cy - 0.5 * f64::from(camera.height));
        text += &format!("<calibration type=\"{kind}\" class=\"adjusted\">{resolution}");
        let element = |(name, value): (&str, f64)| format!("<{name}>{value}</{name}>");
        text += &[("f", fy), ("cx", cx), ("cy", cy), ("b1", fx - fy)].map(element).concat();
        for &(name, value) in model.coefficients() {
            // Its P1 is OpenCV's p2, and the other way round.
            let name = match name {
                "p1" => "p2",
                "p2" => "p1",
                other => other,
            };
            text += &element((name, value));
        }
        text += "</calibration>\n";
    }
    text + "</sensor>\n"
}

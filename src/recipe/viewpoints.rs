//! Viewpoints and thumbnail of a file.

use strivec_field::render::{CpuRenderer, Orbit, Renderer, Turntable};
use strivec_format::container::{Pose, Thumbnail, ThumbnailFormat, TrainingCamera, Views};
use strivec_format::geometry::Viewpoint;
use strivec_format::model::Scene;
use strivec_measure as measure;
use strivec_measure::color_jpeg;

/// Edge of a thumbnail in pixels.
const THUMBNAIL: u32 = 256;
/// JPEG quality of the thumbnail, of 100.
const JPEG_QUALITY: u8 = 60;

/// The viewpoints of `scene` without any of its own: the turn by the photographs' `cameras` if they are not all around
/// the bounds, else a camera that sees all of the scene, and a turntable.
pub(super) fn default_views(scene: &Scene, cameras: &[TrainingCamera]) -> Views {
    let (count, seconds) = (Turntable::POSES, Turntable::SECONDS);
    if let Some(turn) = Turntable::of(scene, None, cameras) {
        return turn.views(count, seconds);
    }
    let cameras = Orbit::default().cameras(&scene.frame, &scene.bounds, count, [THUMBNAIL; 2]);
    let path: Vec<Pose> =
        cameras.iter().map(|camera| Pose::from(&camera.mapped(&scene.frame.model_from_dataset))).collect();
    let angle_of_view = 2.0 * (0.5 * f64::from(THUMBNAIL) / cameras[0].focal[1]).atan();
    Views { angle_of_view, first: path[0], center: scene.bounds.center(), seconds, is_closed: true, path }
}

/// The picture from the initial pose of `views`.
pub(super) fn thumbnail(scene: &Scene, views: &Views) -> Result<Thumbnail, measure::Error> {
    let Pose { position, rotation } = views.first;
    let camera = Viewpoint { position, rotation, vertical_angle: views.angle_of_view }.camera([THUMBNAIL; 2]);
    let picture = CpuRenderer::<f32>::unlimited(scene).render(&camera);
    let size = [picture.width, picture.height];
    let colors: Vec<[f32; 3]> = picture.pixels.iter().map(|pixel| pixel.color).collect();
    let file = color_jpeg(size, &colors, JPEG_QUALITY)?;
    Ok(Thumbnail { format: ThumbnailFormat::Jpeg, size: size.map(|n| n as u16), file })
}

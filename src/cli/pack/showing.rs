//! Default views and thumbnail of a packed file.

use crate::cli::Error;
use crate::cli::render::colors;
use crate::cli::viewpoints::Viewpoints;
use crate::container::{Pose, Thumbnail, ThumbnailFormat, Views};
use crate::measure::color_png;
use crate::model::Scene;
use crate::render::{CpuRenderer, Renderer};

/// Edge of a thumbnail in pixels.
const THUMBNAIL: u32 = 256;
/// Poses of a turntable, and the seconds of a turn.
const TURNTABLE: (u32, f64) = (36, 12.0);

/// A camera that sees all of the scene, and a turntable.
pub(super) fn default_views(scene: &Scene) -> Views {
    let (count, seconds) = TURNTABLE;
    let cameras = Viewpoints::default_orbit(&scene.frame, &scene.bounds, count, [THUMBNAIL; 2]);
    let path: Vec<Pose> =
        cameras.iter().map(|camera| Pose::from(&camera.mapped(&scene.frame.model_from_dataset))).collect();
    let angle_of_view = 2.0 * (0.5 * f64::from(THUMBNAIL) / cameras[0].focal[1]).atan();
    Views { angle_of_view, first: path[0], center: scene.bounds.center(), seconds, is_closed: true, path }
}

/// The picture from the first of [`default_views`].
pub(super) fn thumbnail(scene: &Scene) -> Result<Thumbnail, Error> {
    let camera = Viewpoints::first_of_orbit(&scene.frame, &scene.bounds, [THUMBNAIL; 2]);
    let picture = CpuRenderer::<f32>::new(scene).render(&camera.mapped(&scene.frame.model_from_dataset));
    let size = [picture.width, picture.height];
    let file = color_png(size, &colors(&picture))?;
    Ok(Thumbnail { format: ThumbnailFormat::Png, size: size.map(|n| n as u16), file })
}

//! Cameras for pictures of a scene without its dataset.

use glam::DMat3;

use crate::FactorImportance;
use strivec_field::render::Turntable;
use strivec_format::container::{TrainingCamera, Views as Viewpoints};
use strivec_format::geometry::{Camera, Lens, Ray};
use strivec_format::model::Scene;
use strivec_format::random::Random;

/// Cameras in the model's space, in place of a dataset's.
#[derive(Clone, Debug)]
pub struct ModelCameras {
    /// The cameras.
    pub cameras: Vec<Camera>,
}

/// `count` cameras with pictures of about `size` pixels along the longer side: `known` cameras at equal distances if
/// there are any. Else cameras along and beside the turn of a scene that is seen from within, as far as the viewpoints
/// `views` of its file define; else cameras around the bounds, most of them above the horizon, so near that the scene
/// fills their pictures.
pub fn probe_views(
    scene: &Scene,
    views: Option<&Viewpoints>,
    known: &[TrainingCamera],
    count: usize,
    size: u32,
) -> ModelCameras {
    let cameras = if known.is_empty() {
        Turntable::of(scene, views, &[]).map_or_else(|| around(scene, count, size), |turn| turn.spread(count, size))
    } else {
        let pick = |n: usize| &known[n * known.len() / count.min(known.len())];
        (0..count.min(known.len())).map(|n| of_training(pick(n), size)).collect()
    };
    ModelCameras { cameras }
}

impl ModelCameras {
    /// `count` rays through random points of the pictures of random cameras. The same `random` gives the same rays.
    pub fn rays(&self, count: usize, random: &Random) -> Vec<Ray> {
        (0..count as u64)
            .filter_map(|n| {
                let camera = &self.cameras[random.below(3 * n, self.cameras.len() as u64) as usize];
                let (x, y) = (random.uniform(3 * n + 1), random.uniform(3 * n + 2));
                camera.ray_through(x * f64::from(camera.width), y * f64::from(camera.height))
            })
            .collect()
    }

    /// The importance of the factors of `scene`, from `batches` batches of rays.
    pub fn importance(&self, scene: &Scene, batches: usize, seed: u64) -> FactorImportance {
        FactorImportance::estimate(scene, batches, seed, |count, random| self.rays(count, random))
    }
}

/// A training camera with pictures of about `size` pixels a side.
fn of_training(known: &TrainingCamera, size: u32) -> Camera {
    let [width, height] = known.size;
    let scale = f64::from(size) / f64::from(width.max(height));
    Camera {
        width: (f64::from(width) * scale).round().max(1.0) as u32,
        height: (f64::from(height) * scale).round().max(1.0) as u32,
        focal: known.focal.map(|f| f * scale),
        principal: known.principal.map(|p| p * scale),
        lens: Lens::PINHOLE,
        world_from_camera: DMat3::from_quat(known.pose.rotation),
        position: known.pose.position,
    }
}

/// Cameras on a sphere around the bounds, by the golden angle, from 20° below the horizon to straight above.
fn around(scene: &Scene, count: usize, size: u32) -> Vec<Camera> {
    let up = scene.frame.model_from_dataset.rotation * scene.frame.up.vector();
    let (aside, ahead) = up.any_orthonormal_pair();
    let radius = 0.5 * scene.bounds.size().length();
    // The sphere around the bounds fills two thirds of the picture and lies behind the near distance.
    let distance = (2.5 * radius).max(scene.frame.near + radius).min(scene.frame.far);
    let focal = Camera::focal_of_angle(size, 2.0 * (1.3 * radius / distance).min(1.2).asin().min(1.2));
    (0..count)
        .map(|n| {
            let rise = -0.34 + 1.33 * (n as f64 + 0.5) / count as f64;
            let turn = n as f64 * std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
            let level = (1.0 - rise * rise).max(0.0).sqrt();
            let from = level * (turn.cos() * aside + turn.sin() * ahead) + rise * up;
            Camera::looking_at([size; 2], focal, scene.bounds.center() + distance * from, scene.bounds.center(), up)
        })
        .collect()
}

//! Light: a sun and five patches of sky, all with hard shadows, so that a picture is a function of the ray alone.

use glam::DVec3;

use super::portable::{cos_sin, srgb};
use super::scene::{Hit, SyntheticScene};
use strivec_format::geometry::Ray;

/// Rays from a surface start this far off it.
const OFFSET: f64 = 1e-6;
/// The least distance of a hit from a ray's start.
const NEAREST: f64 = 1e-9;
/// Patches of sky in a ring around the zenith's.
const RING: u32 = 4;

/// The light that falls on the scene.
pub(super) struct Lights {
    /// Towards the sun.
    sun: DVec3,
    sun_color: DVec3,
    /// Directions and colors of the patches of sky.
    sky: Vec<(DVec3, DVec3)>,
}

impl Lights {
    /// Morning light.
    pub(super) fn new() -> Self {
        let blue = DVec3::new(0.80, 0.92, 1.10);
        let ring = (0..RING).map(|i| {
            let (cos, sin) = cos_sin((f64::from(i) + 0.3) / f64::from(RING));
            (DVec3::new(0.8 * cos, 0.8 * sin, 0.6), blue * 0.17)
        });
        Self {
            sun: DVec3::new(0.35, -0.62, 0.70).normalize(),
            sun_color: DVec3::new(1.0, 0.93, 0.80) * 0.95,
            sky: ring.chain([(DVec3::Z, blue * 0.22)]).collect(),
        }
    }

    /// The light on level ground at `point`, on which `scene` throws its shadows.
    pub(super) fn on_ground(&self, scene: &SyntheticScene, point: DVec3) -> DVec3 {
        let origin = point + OFFSET * DVec3::Z;
        let arrives = |direction: DVec3| if scene.blocks(&Ray { origin, direction }) { 0.0 } else { direction.z };
        let sky: DVec3 = self.sky.iter().map(|&(direction, color)| color * arrives(direction)).sum();
        sky + self.sun_color * arrives(self.sun)
    }

    /// The light on slopes far away, of every direction.
    pub(super) fn on_slopes(&self) -> DVec3 {
        0.5 * self.sun_color + 0.2
    }
}

/// The sRGB color in [0, 1] that arrives along `ray`; `None` if the ray misses the scene.
pub(super) fn color(scene: &SyntheticScene, lights: &Lights, ray: &Ray) -> Option<[f64; 3]> {
    let hit = scene.hit(ray, 0.0)?;
    Some(shade(scene, lights, ray, &hit, true).to_array().map(srgb))
}

/// The linear light that leaves `hit` towards the origin of `ray`.
fn shade(scene: &SyntheticScene, lights: &Lights, ray: &Ray, hit: &Hit<'_>, mirrors: bool) -> DVec3 {
    let point = ray.at(hit.t);
    let solid = &hit.thing.solid;
    let normal = solid.normal(hit.face, point);
    let texture = hit.thing.texture;
    let albedo = texture.albedo(solid.local(point), hit.face, hit.thing.texture_seed);
    let origin = point + OFFSET * normal;
    let arrives = |direction: DVec3| {
        let cosine = normal.dot(direction);
        if cosine > 0.0 && !scene.blocks(&Ray { origin, direction }) { cosine } else { 0.0 }
    };

    let sunlight = arrives(lights.sun);
    // Light from the surrounding ground, from below.
    let mut light = DVec3::new(0.10, 0.09, 0.075) * (1.5 - 0.5 * normal.z) + lights.sun_color * sunlight;
    for (direction, color) in &lights.sky {
        light += *color * arrives(*direction);
    }
    let mut leaving = albedo * light;

    let gloss = texture.gloss();
    if sunlight > 0.0 && gloss.highlight > 0.0 {
        let half = (lights.sun - ray.direction).normalize();
        // The 128th power, by squaring.
        let peak = (0..7).fold(normal.dot(half).max(0.0), |power, _| power * power);
        leaving += lights.sun_color * gloss.highlight * peak;
    }
    if gloss.mirror > 0.0 {
        let cosine = -normal.dot(ray.direction);
        let grazing = 1.0 - cosine.clamp(0.0, 1.0);
        let share = gloss.mirror + (1.0 - gloss.mirror) * (grazing * grazing) * (grazing * grazing) * grazing;
        let reflected = Ray { origin, direction: (ray.direction + 2.0 * cosine * normal).normalize() };
        let seen = if mirrors { scene.hit(&reflected, NEAREST) } else { None };
        let mirrored =
            seen.map_or_else(|| surroundings(reflected.direction), |hit| shade(scene, lights, &reflected, &hit, false));
        leaving = leaving.lerp(mirrored, share);
    }
    leaving
}

/// The environment that mirrors reflect: a sky that pales towards the horizon, and dark ground below.
pub(super) fn surroundings(direction: DVec3) -> DVec3 {
    let horizon = DVec3::new(0.85, 0.88, 0.90);
    if direction.z >= 0.0 {
        horizon.lerp(DVec3::new(0.16, 0.34, 0.72), (1.6 * direction.z).min(1.0))
    } else {
        horizon.lerp(DVec3::new(0.16, 0.13, 0.10), (-8.0 * direction.z).min(1.0))
    }
}

//! Surroundings without an edge: a meadow to the horizon and hills far away, or a plain floor, and a sky.

use glam::DVec3;

use super::portable::{linear, noise, srgb};
use super::scene::SyntheticScene;
use super::shading::{Lights, surroundings};
use super::thing::FOOT;
use strivec_format::geometry::Ray;

/// The distance of the hills from the origin.
const HILLS: f64 = 60.0;
/// The largest height of the hills above the meadow.
const PEAK: f64 = 9.0;
/// The hills of a quarter of the horizon, about.
const RIDGES: f64 = 4.0;
/// The finest pattern of the meadow, and how many times it is doubled.
const GRAIN: f64 = 0.05;
const OCTAVES: u32 = 9;
/// Patterns fade that are smaller than this share of their distance: about a pixel.
const PIXEL: f64 = 0.004;

/// The color of the plain floor: a gray that is bright, but not white at any exposure.
const FLOOR_COLOR: u32 = 0xaaa69c;

/// The ground under the solids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ground {
    /// A meadow and hills, whose shape and patterns have this seed.
    Meadow(u64),
    /// A plain floor.
    Floor,
}

/// The sRGB color, in \[0, 1\], of what `ray` sees past the solids.
pub(super) fn color(scene: &SyntheticScene, lights: &Lights, ray: &Ray, ground: Ground) -> [f64; 3] {
    let seen = match distance(ray, ground) {
        None => surroundings(ray.direction),
        Some(distance) => {
            let point = ray.at(distance);
            let (albedo, light) = match ground {
                Ground::Floor => (linear(FLOOR_COLOR), lights.on_ground(scene, point)),
                Ground::Meadow(seed) if point.truncate().length() > HILLS - 1e-6 => {
                    (pattern(point, distance, seed), lights.on_slopes())
                }
                Ground::Meadow(seed) => (pattern(point, distance, seed), lights.on_ground(scene, point)),
            };
            // Air between: far things pale.
            (albedo * light).lerp(surroundings(DVec3::X), 1.0 - 1.0 / (1.0 + distance / 150.0))
        }
    };
    seen.to_array().map(srgb)
}

/// The distance along `ray` to the ground or to hills on it; `None` to the sky.
pub(super) fn distance(ray: &Ray, ground: Ground) -> Option<f64> {
    let to_ground = (FOOT - ray.origin.z) / ray.direction.z;
    match ground {
        Ground::Floor => (to_ground > 0.0 && to_ground.is_finite()).then_some(to_ground),
        Ground::Meadow(seed) => distance_to_meadow(ray, to_ground, seed),
    }
}

/// The distance along `ray` to the meadow, which it would meet after `ground`, or the hills, whose shape `seed` selects.
fn distance_to_meadow(ray: &Ray, ground: f64, seed: u64) -> Option<f64> {
    let (at, along) = (ray.origin.truncate(), ray.direction.truncate());
    let square = along.length_squared();
    let half = at.dot(along);
    let to_hills = ((half * half + square * (HILLS * HILLS - at.length_squared())).sqrt() - half) / square;
    if ground > 0.0 && (ground < to_hills || !to_hills.is_finite()) {
        return Some(ground);
    }
    let point = ray.at(to_hills);
    let height = PEAK * noise(seed, RIDGES / HILLS * point.with_z(0.0)).max(0.15);
    (to_hills.is_finite() && point.z < FOOT + height).then_some(to_hills)
}

/// The albedo of meadow and hills: greens and browns in patterns of many sizes.
fn pattern(point: DVec3, distance: f64, seed: u64) -> DVec3 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for octave in 0..OCTAVES {
        let size = GRAIN * f64::from(1 << octave);
        let weight = (size / (PIXEL * distance) - 0.5).clamp(0.0, 1.0);
        sum += weight * noise(seed + u64::from(octave), point / size);
        weights += weight;
    }
    let share = if weights > 0.0 { sum / weights } else { 0.5 };
    let share = (1.8 * (share - 0.5) + 0.5).clamp(0.0, 1.0);
    linear(0x31521f).lerp(linear(0xb59b62), share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_horizon_is_straight_and_everything_above_the_hills_is_sky() {
        let origin = DVec3::new(2.0, -3.0, 0.4);
        for step in 0..64 {
            let turn = f64::from(step) * std::f64::consts::TAU / 64.0;
            let toward = |up: f64| Ray { origin, direction: DVec3::new(turn.cos(), turn.sin(), up).normalize() };
            let low = toward(-0.3);
            let at = low.at(distance(&low, Ground::Meadow(7)).unwrap());
            assert!((at.z - FOOT).abs() < 1e-12, "the meadow is flat");
            let level = toward(-0.01);
            let at = level.at(distance(&level, Ground::Meadow(7)).unwrap());
            assert!((at.truncate().length() - HILLS).abs() < 1e-9 && at.z > FOOT);
            assert_eq!(distance(&toward(0.3), Ground::Meadow(7)), None);
        }
        let down = Ray { origin, direction: DVec3::NEG_Z };
        for ground in [Ground::Meadow(7), Ground::Floor] {
            assert_eq!(distance(&down, ground), Some(0.4 - FOOT));
            assert_eq!(distance(&Ray { direction: DVec3::Z, ..down }, ground), None);
        }
    }

    #[test]
    fn patterns_finer_than_a_pixel_are_gone() {
        let spread = |distance: f64| {
            let values = (0..200).map(|n| pattern(DVec3::new(0.013 * f64::from(n), 0.4, 0.0), distance, 3).y);
            let (low, high) = values.fold((1.0_f64, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
            high - low
        };
        assert!(spread(2.0) > 0.1 && spread(1e5) < 1e-12, "{} {}", spread(2.0), spread(1e5));
    }
}

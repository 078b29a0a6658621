//! Cameras around the scene, and their pictures.

use glam::DVec3;
use image::RgbaImage;
use rayon::prelude::*;

use super::portable::{cos_sin, decoded, srgb, uniform};
use super::scene::SyntheticScene;
use super::shading::{Lights, color};
use super::surroundings::Surroundings;
use super::{outdoor, room};
use strivec_format::color::byte;
use strivec_format::geometry::{Camera, Ray};

/// The horizontal angle of view in radians, that of NeRF-synthetic.
pub(super) const CAMERA_ANGLE: f64 = 0.691_111_207_008_361_8;
/// The cameras' distance from the origin.
pub(super) const DISTANCE: f64 = 4.031_128_874_149_275;
/// Number of samples of a pixel in each direction.
const SAMPLES: u32 = 4;

/// `count` cameras for pictures of `scene`: in its room, or else around it.
pub(super) fn cameras(scene: &SyntheticScene, count: u32, size: [u32; 2], seed: u64) -> Vec<Camera> {
    if scene.surroundings == Surroundings::Room { room::cameras(count, size, seed) } else { orbit(count, size, seed) }
}

/// `count` cameras on a sphere around the origin that look at it, mostly from above: a Fibonacci spiral in equal steps
/// of height, each camera moved by up to half a step at random.
pub(super) fn orbit(count: u32, size: [u32; 2], seed: u64) -> Vec<Camera> {
    let (cos, sin) = cos_sin(0.25 * CAMERA_ANGLE / std::f64::consts::PI);
    let focal = 0.5 * f64::from(size[0]) * cos / sin;
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let start = uniform(seed, 0);
    (0..count)
        .map(|i| {
            let random = |k: u64| uniform(seed, 1 + 2 * u64::from(i) + k);
            let height = -0.05 + 1.0 * (f64::from(i) + random(0)) / f64::from(count);
            let (cos, sin) = cos_sin(start + golden * f64::from(i) + (random(1) - 0.5) / f64::from(count));
            let across = (1.0 - height * height).sqrt();
            let position = DISTANCE * DVec3::new(across * cos, across * sin, height);
            Camera::looking_at(size, focal, position, DVec3::ZERO, DVec3::Z)
        })
        .collect()
}

/// The picture of `camera`: straight alpha, transparent outside the scene, which has no outside on a ground or in a room.
/// Linear colors are `exposure` times as bright as the scene's.
///
/// A pixel is the mean over a regular grid of 4×4 samples, of sRGB values, because volume rendering and downscaling
/// average display colors too.
pub(super) fn picture(scene: &SyntheticScene, lights: &Lights, camera: &Camera, exposure: f64) -> RgbaImage {
    let seen = |ray: Ray| {
        let of_ground = || Some(outdoor::color(scene, lights, &ray, scene.ground?));
        color(scene, lights, &ray).or_else(of_ground)
    };
    let mut picture = RgbaImage::new(camera.width, camera.height);
    picture.par_chunks_exact_mut(4 * camera.width as usize).enumerate().for_each(|(row, bytes)| {
        for (column, pixel) in bytes.as_chunks_mut::<4>().0.iter_mut().enumerate() {
            let at = |index: usize, sample| index as f64 + (f64::from(sample) + 0.5) / f64::from(SAMPLES);
            let (mut sum, mut covered) = (DVec3::ZERO, 0);
            for (y, x) in (0..SAMPLES).flat_map(|y| (0..SAMPLES).map(move |x| (y, x))) {
                let ray = camera.ray_through(at(column, x), at(row, y));
                if let Some(seen) = ray.and_then(seen) {
                    sum += DVec3::from_array(seen);
                    covered += 1;
                }
            }
            if covered > 0 {
                let [r, g, b] = (sum / f64::from(covered)).to_array().map(|value| byte(exposed(value, exposure)));
                *pixel = [r, g, b, byte(f64::from(covered) / f64::from(SAMPLES * SAMPLES))];
            }
        }
    });
    picture
}

/// The sRGB value of a color that is `exposure` times as bright as that of the sRGB `value`.
fn exposed(value: f64, exposure: f64) -> f64 {
    if exposure == 1.0 { value } else { srgb(exposure * decoded(value)) }
}

/// The exposure of a photograph of `scene` by `camera`: before a plain floor up to half a stop brighter or darker than the scene.
pub(super) fn exposure(scene: &SyntheticScene, camera: &Camera, seed: u64) -> f64 {
    if scene.surroundings != Surroundings::Floor {
        return 1.0;
    }
    // 2^x within 1e-4, the same on all platforms; the place of a camera is the same in all layouts.
    let x = (uniform(seed, camera.position.x.to_bits()) - 0.5) * std::f64::consts::LN_2;
    1.0 + x * (1.0 + x * (0.5 + x * (1.0 / 6.0 + x / 24.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::geometry::{Distortion, Lens, Projection};

    #[test]
    fn pixels_without_a_ray_are_transparent() {
        let distortion = Distortion::new([-1.5, 0.0, 0.0, 0.0], [0.0; 3], [0.0; 2], [0.0; 2]).unwrap();
        let mut camera = orbit(1, [40, 40], 9)[0];
        camera.lens = Lens { projection: Projection::Perspective, distortion };
        // Near enough that the scene covers the picture.
        camera.focal = [50.0; 2];
        camera.position *= 0.4;
        let picture = picture(&SyntheticScene::new(3), &Lights::new(), &camera, 1.0);
        let seen = camera.seen_pixels().unwrap();
        let opaque = |(pixel, seen): (&image::Rgba<u8>, &bool)| (pixel[3] > 0, *seen);
        let pixels: Vec<_> = picture.pixels().zip(&seen).map(opaque).collect();
        assert!(pixels.contains(&(true, true)), "the scene is in the picture");
        // Pixels at the border of what the lens sees have a part of their samples.
        let beyond = pixels.iter().filter(|(opaque, seen)| *opaque && !seen).count();
        let unseen = seen.iter().filter(|seen| !**seen).count();
        assert!(unseen > 100 && 4 * beyond < unseen, "{beyond} of {unseen}");
    }

    #[test]
    fn picture_shows_the_solids_where_the_camera_puts_them() {
        let scene = SyntheticScene::new(3);
        for camera in orbit(5, [120, 100], 9) {
            assert!((camera.position.length() - DISTANCE).abs() < 1e-12);
            let picture = picture(&scene, &Lights::new(), &camera, 1.0);
            for thing in &scene.things {
                // Project by hand: camera axes are x right, y up, −z forwards; rows grow downwards.
                let seen = camera.world_from_camera.transpose() * (thing.solid.world(DVec3::ZERO) - camera.position);
                let column = 60.0 + camera.focal[0] * seen.x / -seen.z;
                let row = 50.0 - camera.focal[1] * seen.y / -seen.z;
                let solid = thing.solid.depth(thing.solid.world(DVec3::ZERO)) > 0.02;
                let pixel = picture.get_pixel(column as u32, row as u32);
                assert!(!solid || pixel[3] == 255, "{column} {row}");
            }
            let partial = picture.pixels().filter(|p| p[3] > 0 && p[3] < 255).count();
            assert!(partial > 200, "{partial} pixels at silhouettes");
            assert_eq!(picture.get_pixel(0, 0)[3], 0);
        }
    }
}

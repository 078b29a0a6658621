//! The background of scenes that are trained on opaque photographs.

use rayon::prelude::*;

use strivec_capture::dataset::Photograph;
use strivec_field::render::{CpuRenderer, Renderer};
use strivec_format::model::Scene;

/// About this many pixels of a photograph are looked at.
const PIXELS: f64 = 4000.0;
/// The weight of pixels that are opaque in the scene.
const OPAQUE_WEIGHT: f64 = 1e-3;

/// The mean sRGB color of `views` where nothing of `scene` is before the background; where something is everywhere, about
/// their mean color.
pub(super) fn background_of(scene: &Scene, views: &[Photograph]) -> [f32; 3] {
    let renderer = CpuRenderer::unlimited(scene);
    let of_view = |view: &Photograph| {
        let pixels = f64::from(view.camera.width) * f64::from(view.camera.height);
        let shortest = view.camera.width.min(view.camera.height);
        let factor = ((pixels / PIXELS).sqrt().ceil() as u32).clamp(1, shortest.max(1));
        let small = view.camera.downscaled(factor);
        let picture = renderer.render(&small.mapped(&scene.frame.model_from_dataset));
        let mut sums = [0.0; 4];
        for (n, pixel) in picture.pixels.iter().enumerate() {
            let [column, row] = [n as u32 % small.width, n as u32 / small.width].map(|at| at * factor + factor / 2);
            let place = (row * view.camera.width + column) as usize;
            if view.counts(place) {
                let weight = OPAQUE_WEIGHT + f64::from(1.0 - pixel.opacity);
                let color = view.pixels.color(place, scene.frame.background);
                color.iter().zip(&mut sums).for_each(|(&c, sum)| *sum += weight * f64::from(c));
                sums[3] += weight;
            }
        }
        sums
    };
    // In the order of views, so that the sum does not depend on threads.
    let sums: Vec<[f64; 4]> = views.par_iter().map(of_view).collect();
    let [r, g, b, weight] = sums.iter().fold([0.0; 4], |a, b| std::array::from_fn(|i| a[i] + b[i]));
    [r, g, b].map(|sum| (sum / weight.max(OPAQUE_WEIGHT)) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    use strivec_capture::dataset::Pixels;
    use strivec_format::geometry::Camera;
    use strivec_format::model::Sky;

    #[test]
    fn the_background_is_what_is_seen_past_the_scene_or_the_mean_color() {
        let mut scene = strivec_format::container::decode(include_bytes!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../fixtures/v1/f32.strivec"
        )))
        .unwrap();
        let dataset_from_model = scene.frame.model_from_dataset.inverse();
        let view = |toward: DVec3, color: [f32; 3]| {
            let position = DVec3::new(0.0, -60.0, 0.0);
            let camera = Camera::looking_at([8, 8], 400.0, position, position + toward, DVec3::Z);
            let camera = camera.mapped(&dataset_from_model);
            Photograph::new("a", camera, Pixels::opaque((0..64).map(|n| if n < 32 { color } else { [1.0; 3] })))
        };
        let is_near = |found: [f32; 3], expected: [f32; 3]| {
            assert!((0..3).all(|c| (found[c] - expected[c]).abs() < 1e-6), "{found:?}, {expected:?}");
        };
        // One photograph away from the scene, all of which is past it.
        let away = view(DVec3::NEG_Y, [0.0, 0.5, 0.25]);
        is_near(background_of(&scene, std::slice::from_ref(&away)), [0.5, 0.75, 0.625]);
        // In front of a sky nothing is past the scene.
        scene.rules.sky = Some(Sky::gray(1));
        is_near(background_of(&scene, &[away, view(DVec3::Y, [0.0; 3])]), [0.5, 0.625, 0.5625]);
        assert_eq!(background_of(&scene, &[]), [0.0; 3]);
    }
}

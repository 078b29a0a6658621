//! Rays whose decoder sees other directions.

use crate::scenes;

use glam::DVec3;
use strivec_field::Field;
use strivec_field::render::{CpuRenderer, Renderer};
use strivec_format::geometry::Ray;
use strivec_format::model::{DecoderMode, Scene};

fn scene(mode: DecoderMode) -> Scene {
    let mut config = scenes::config();
    config.decoder.mode = mode;
    config.decoder.direction_frequencies = 2;
    config.optimizer.factor_deviation = 0.8;
    scenes::scene(&config)
}

/// x, y, z become y, z, x.
fn permuted(direction: DVec3) -> DVec3 {
    DVec3::new(direction.y, direction.z, direction.x)
}

/// `scene` with a decoder that has for a direction the color of `scene` for its permuted one.
fn with_permuted_decoder(mut scene: Scene) -> Scene {
    let [direction, _, encoded] = Field::<f64>::new(&scene).unwrap().decoder.input_parts();
    let frequencies = scene.decoder.direction_frequencies as usize;
    let layer = &mut scene.decoder.layers[0];
    for row in layer.weights.chunks_exact_mut(layer.inputs as usize) {
        let mut rotate = |first: usize, width: usize| row[first..first + 3 * width].rotate_right(width);
        rotate(direction, 1);
        rotate(encoded, frequencies);
        rotate(encoded + 3 * frequencies, frequencies);
    }
    scene
}

#[test]
fn the_decoder_sees_other_directions_and_the_march_does_not() {
    for mode in DecoderMode::ALL {
        let scene = scene(mode);
        let camera = scenes::camera(20, 0.7);
        let rays: Vec<Ray> = (0..400).map(|n| camera.ray(n % 20, n / 20).unwrap()).collect();
        let renderer = CpuRenderer::<f64>::from_field(Field::new(&scene).unwrap());
        let own = renderer.trace(&rays);
        let toward = |ray: &Ray, n: usize| [ray.direction, permuted(ray.direction)][n];
        let found = renderer.trace_toward(&rays, 2, &toward);
        assert!(found.iter().step_by(2).eq(own.iter()), "{mode:?}: their own directions change no bit");
        let permuted = CpuRenderer::<f64>::from_field(Field::new(&with_permuted_decoder(scene)).unwrap()).trace(&rays);
        let mut changed = 0;
        for ((a, b), own) in found.iter().skip(1).step_by(2).zip(&permuted).zip(&own) {
            assert!((0..3).all(|c| (a.color[c] - b.color[c]).abs() < 1e-6), "{mode:?}: {a:?} and {b:?}");
            assert_eq!((a.opacity, a.depth), (own.opacity, own.depth));
            changed += usize::from((0..3).any(|c| (a.color[c] - own.color[c]).abs() > 1e-4));
        }
        assert!(changed > 50, "{mode:?}: {changed} colors depend on the direction");
    }
}

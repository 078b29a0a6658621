//! The error distributions of `docs/numerics.md`: every renderer, decoder mode and precision on the same scenes of
//! random tensors. `cargo test --release -p strivec-train --test extremes distributions -- --nocapture` prints them.

use glam::DVec3;
use strivec_format::geometry::Ray;
use strivec_format::model::DecoderMode;

use super::compare::{Errors, Way, errors, expected};
use crate::scenes;

#[test]
fn distributions_of_errors_by_renderer_and_decoder_mode() {
    println!("| renderer | decoder | clear rays | median | 99.9 % | maximum | near rays | median | 99.9 % | maximum |");
    for mode in DecoderMode::ALL {
        let mut config = scenes::config();
        config.decoder.mode = mode;
        config.optimizer.factor_deviation = 0.8;
        let mut scene = scenes::scene(&config);
        // Moves the first sample of rays off the tensors' faces.
        scene.bounds = scene.bounds.grown(DVec3::splat(0.0123));
        let cameras = [0.4, 2.9, 4.4].map(|angle| scenes::camera(40, angle));
        let rays: Vec<Ray> =
            (cameras.iter()).flat_map(|camera| (0..1600).map(move |n| camera.ray(n % 40, n / 40).unwrap())).collect();
        // Empty rays would make every median 0.
        let seen = expected(&scene, &rays).into_iter().zip(rays).filter(|(trace, _)| trace.opacity > 0.0);
        let (exact, rays): (Vec<_>, Vec<_>) = seen.unzip();
        let mut of_ways = Vec::<Errors>::new();
        for &way in Way::ALL {
            let found = errors(way, &scene, &rays, &exact);
            println!("| {way:?} | {} | {} |", mode.name(), found.row());
            assert!(found.clear_maximum() <= way.bound(), "{way:?}, {mode:?}: {}", found.row());
            assert!(found.near.len() * 5 <= rays.len(), "{way:?}, {mode:?}: {}", found.row());
            of_ways.push(found);
        }
        assert!(of_ways[0].clear_maximum() < of_ways[1].clear_maximum(), "f64 is no better than f32");
        let mut planted = scene.clone();
        planted.scales[2].factors.density[0].values.iter_mut().for_each(|v| *v *= 1.001);
        let apart = errors(Way::CpuF64, &planted, &rays, &exact);
        assert!(apart.clear_maximum() > Way::CpuF32.bound(), "a thousandth more density goes unnoticed");
    }
}

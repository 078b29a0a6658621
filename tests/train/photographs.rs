//! The rays that training draws, their photographed colors, and their backgrounds.

use crate::scenes;

use std::collections::BTreeSet;

use strivec_capture::dataset::{Photograph, Pixels};
use strivec_format::model::Frame;
use strivec_format::random::Random;
use strivec_train::{RaySampler, Target, TrainConfig};

const SIZE: u32 = 6;
const PIXELS: u64 = (SIZE * SIZE) as u64;

/// An opaque view and one with transparent pixels, all of one color.
fn views() -> [Photograph; 2] {
    [255, 51].map(|alpha| {
        let pixels = Pixels::Rgba8(vec![[255, 0, 102, alpha]; PIXELS as usize]);
        Photograph::new(alpha.to_string(), scenes::camera(SIZE, f64::from(alpha)), pixels)
    })
}

fn frame() -> Frame {
    scenes::scene(&scenes::config()).frame
}

/// Draws `count` rays of `views`, none of which is left out: for each its view and its target.
fn drawn(views: &[Photograph; 2], config: &TrainConfig, count: u64) -> Vec<(usize, Target)> {
    let frame = frame();
    let mut sampler = RaySampler::new(views, &frame, config).unwrap();
    assert!(sampler.restore_active_rays(&[u8::MAX; 2 * PIXELS as usize / 8]), "a mask of another length");
    assert_eq!(sampler.active_ray_count() as u64, 2 * PIXELS, "active rays");
    let order = Random::new(config.seed, "rays");
    (0..count)
        .map(|draw| {
            let (ray, target) = sampler.ray(sampler.pixel(&order, draw), draw);
            let view = views.iter().position(|v| v.camera.position == ray.origin).unwrap();
            (view, target)
        })
        .collect()
}

#[test]
fn colors_are_composited_on_the_scene_s_background() {
    let views = views();
    let draws = drawn(&views, &scenes::config(), 2 * PIXELS);
    let background = frame().background;
    assert_eq!(draws.iter().filter(|(view, _)| *view == 0).count() as u64, PIXELS, "every pixel once");
    for (view, target) in draws {
        let expected = [[1.0, 0.0, 0.4], [1.0, 0.8 * background[1], 0.08 + 0.8 * background[2]]][view];
        assert_eq!(target.background, background);
        assert!((0..3).all(|c| (target.color[c] - expected[c]).abs() < 1e-6), "{target:?}, expected {expected:?}");
    }
}

#[test]
fn random_backgrounds_are_each_draw_s_own_and_behind_transparent_views_only() {
    let views = views();
    let mut config = scenes::config();
    config.photographs.random_background = true;
    let draws = drawn(&views, &config, 4 * PIXELS);
    let mut seen = BTreeSet::new();
    let mut sums = [0.0; 3];
    for (view, target) in &draws {
        assert_eq!(target.color, views[*view].pixels.color(0, target.background));
        if *view == 0 {
            assert_eq!(target.background, frame().background);
        } else {
            assert!(target.background.iter().all(|c| (0.0..=1.0).contains(c)));
            seen.insert(target.background.map(f32::to_bits));
            (0..3).for_each(|c| sums[c] += f64::from(target.background[c]));
        }
    }
    assert_eq!(seen.len() as u64, 2 * PIXELS, "also where a pixel comes again");
    assert!(sums.iter().all(|sum| (sum / (2 * PIXELS) as f64 - 0.5).abs() < 0.15), "{sums:?}");

    assert_eq!(drawn(&views, &config, 4 * PIXELS), draws);
    let other = TrainConfig { seed: config.seed + 1, ..config };
    assert!(drawn(&views, &other, 4 * PIXELS) != draws);
}

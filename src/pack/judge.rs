//! How much pictures lose.

use super::Views;
use crate::model::Scene;
use crate::render::{CpuRenderer, Picture, Renderer};

/// A scene's pictures, to hold others against.
#[derive(Clone, Debug)]
pub struct Judge {
    views: Views,
    pictures: Vec<Picture>,
}

impl Judge {
    /// Takes `scene`'s pictures from `views`.
    pub fn new(scene: &Scene, views: Views) -> Self {
        let pictures = pictures(scene, &views);
        Self { views, pictures }
    }

    /// The mean squared error of `scene`'s pictures, over pixels and channels.
    pub fn error(&self, scene: &Scene) -> f64 {
        let (mut sum, mut count) = (0.0, 0u64);
        for (before, after) in self.pictures.iter().zip(pictures(scene, &self.views)) {
            for (b, a) in before.pixels.iter().zip(&after.pixels) {
                sum += (0..3).map(|c| f64::from(b.color[c] - a.color[c]).powi(2)).sum::<f64>();
                count += 3;
            }
        }
        sum / count.max(1) as f64
    }
}

fn pictures(scene: &Scene, views: &Views) -> Vec<Picture> {
    let renderer = CpuRenderer::<f32>::new(scene);
    views.cameras.iter().map(|camera| renderer.render(camera)).collect()
}

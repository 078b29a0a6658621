//! The chosen training camera, and its photograph, which is blended with the picture.

use super::Controls;
use strivec_format::container::TrainingCamera;
use strivec_format::geometry::Camera;

/// The chosen training camera of a file, and the display of its photograph.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhotographOverlay {
    /// Index of the camera in the file; `None` before one is chosen.
    pub camera: Option<usize>,
    /// Chosen share of the photograph in the picture, from 0 to 1.
    pub share: f32,
    /// True if the photograph is loaded.
    pub is_loaded: bool,
}

impl PhotographOverlay {
    /// Moves the camera of `controls` to training camera `n` of `cameras`. Returns whether there is such a camera.
    pub fn go_to(&mut self, n: usize, cameras: &[TrainingCamera], controls: &mut Controls) -> bool {
        let Some(camera) = cameras.get(n) else { return false };
        let angle = 2.0 * (0.5 * f64::from(camera.size[1]) / camera.focal[1]).atan();
        controls.place_with_angle(camera.pose, angle);
        if self.camera != Some(n) {
            (self.camera, self.is_loaded) = (Some(n), false);
        }
        true
    }

    /// Index of the next or the previous one of `count` cameras. The first follows the last.
    pub fn neighbor(&self, count: usize, is_next: bool) -> usize {
        match (self.camera, is_next) {
            (None, true) => 0,
            (None, false) => count.saturating_sub(1),
            (Some(n), true) => (n + 1) % count.max(1),
            (Some(n), false) => (n + count).saturating_sub(1) % count.max(1),
        }
    }

    /// Index of the training camera whose photograph is to be displayed and is not loaded.
    pub fn missing(&self) -> Option<usize> {
        self.camera.filter(|_| self.share > 0.0 && !self.is_loaded)
    }

    /// Share of the photograph in the picture now: 0 until it is loaded.
    pub fn shown_share(&self) -> f32 {
        if self.is_loaded { self.share } else { 0.0 }
    }

    /// Corner and size of the photograph of the chosen one of `cameras`, in parts of the width and height of the
    /// picture that `shown` took.
    pub fn place(&self, cameras: &[TrainingCamera], shown: &Camera) -> Option<[f32; 4]> {
        let taken = cameras.get(self.camera?)?;
        let along = |axis: usize, size: u32| {
            let scale = shown.focal[axis] / taken.focal[axis];
            let corner = shown.principal[axis] - scale * taken.principal[axis];
            [corner, scale * f64::from(taken.size[axis])].map(|v| (v / f64::from(size)) as f32)
        };
        let ([x, width], [y, height]) = (along(0, shown.width), along(1, shown.height));
        Some([x, y, width, height])
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use strivec_format::container::{Limits, Pose, decode_scene_file};
    use strivec_format::geometry::Lens;

    fn cameras() -> Vec<TrainingCamera> {
        let at = |x: f64| Pose { position: DVec3::new(x, 0.0, 3.0), rotation: DQuat::IDENTITY };
        let camera = |x| TrainingCamera {
            pose: at(x),
            focal: [50.0; 2],
            principal: [20.0, 10.0],
            size: [40, 20],
            lens: Lens::PINHOLE,
        };
        [0.0, 1.0, 2.0].map(camera).to_vec()
    }

    #[test]
    fn neighbors_of_cameras_wrap_around() {
        let mut photograph = PhotographOverlay::default();
        assert_eq!([true, false].map(|is_next| photograph.neighbor(3, is_next)), [0, 2]);
        photograph.camera = Some(2);
        assert_eq!([true, false].map(|is_next| photograph.neighbor(3, is_next)), [0, 1]);
        photograph.camera = Some(0);
        assert_eq!([true, false].map(|is_next| photograph.neighbor(3, is_next)), [1, 2]);
        assert_eq!([true, false].map(|is_next| photograph.neighbor(0, is_next)), [0, 0]);
    }

    #[test]
    fn a_photograph_fills_the_height_of_its_view() {
        let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/everything.strivec");
        let scene_file = decode_scene_file(&std::fs::read(fixture).unwrap(), Limits::default()).unwrap();
        let mut controls = Controls::new(&scene_file.scene, None, &[]);
        let mut photograph = PhotographOverlay { share: 0.5, is_loaded: true, ..PhotographOverlay::default() };
        assert!(!photograph.go_to(3, &cameras(), &mut controls) && photograph.camera.is_none());
        assert!(photograph.go_to(1, &cameras(), &mut controls));
        assert_eq!((photograph.camera, photograph.shown_share()), (Some(1), 0.0), "the photograph is another camera's");
        assert_eq!(controls.pose().position.x, 1.0);
        let [x, y, width, height] = photograph.place(&cameras(), &controls.camera([100, 100])).unwrap();
        for (found, expected) in [(x, -0.5), (y, 0.0), (width, 2.0), (height, 1.0)] {
            assert!((found - expected).abs() < 1e-6, "{found} and {expected}");
        }
    }
}

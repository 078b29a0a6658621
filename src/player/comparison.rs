//! Arrangement of two scenes in a window.

use strivec_format::geometry::Camera;
use strivec_format::model::Frame;

/// Arrangement of two scenes in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Comparison {
    /// Each scene fills half of the window.
    SideBySide,
    /// A divider at this part of the width: the first scene is left of it, the second right.
    Slider(f32),
}

/// Rectangle of a picture on a surface, and its visible part: left, top, right and bottom, in the surface's pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureRect {
    /// The whole picture.
    pub whole: [f32; 4],
    /// The visible part of the picture.
    pub seen: [f32; 4],
}

impl Comparison {
    /// The places of the two pictures in `area`.
    pub fn places(self, area: [f32; 4]) -> [PictureRect; 2] {
        let [left, top, right, bottom] = area;
        let part = |at: f32| left + at * (right - left);
        let halves = |x: f32| [[left, top, x, bottom], [x, top, right, bottom]];
        match self {
            Self::SideBySide => halves(part(0.5).floor()).map(PictureRect::of),
            Self::Slider(at) => halves(part(at.clamp(0.0, 1.0))).map(|seen| PictureRect { whole: area, seen }),
        }
    }

    /// The camera for a scene of frame `second` that shows the same part of the dataset as `camera` shows for a scene
    /// of frame `first`.
    pub fn camera_of_second(camera: &Camera, first: &Frame, second: &Frame) -> Camera {
        if first.model_from_dataset == second.model_from_dataset {
            return *camera;
        }
        camera.mapped(&first.model_from_dataset.inverse()).mapped(&second.model_from_dataset)
    }

    /// Columns and rows of each of the two pictures in a window of `size`.
    pub fn picture_size(self, size: [u32; 2]) -> [u32; 2] {
        match self {
            Self::SideBySide => [(size[0] / 2).max(1), size[1]],
            Self::Slider(_) => size,
        }
    }
}

impl PictureRect {
    /// The whole of `area`, all of it visible.
    pub fn of(area: [f32; 4]) -> Self {
        Self { whole: area, seen: area }
    }

    /// Restricts the drawing of `pass`, on a surface of `size`, to this place. Returns false if no part of it is
    /// visible; nothing may be drawn then.
    pub fn enter(&self, pass: &mut wgpu::RenderPass<'_>, size: [u32; 2]) -> bool {
        let [width, height] = size.map(|v| v as f32);
        let [left, top, right, bottom] = self.whole;
        if left < 0.0 || top < 0.0 || right > width || bottom > height || left >= right || top >= bottom {
            return false;
        }
        let most = [size[0], size[1], size[0], size[1]];
        let edge = |n: usize| (self.seen[n].round() as u32).min(most[n]);
        let seen = [0, 1, 2, 3].map(edge);
        if seen[0] >= seen[2] || seen[1] >= seen[3] {
            return false;
        }
        pass.set_viewport(left, top, right - left, bottom - top, 0.0, 1.0);
        pass.set_scissor_rect(seen[0], seen[1], seen[2] - seen[0], seen[3] - seen[1]);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_pictures_share_a_window() {
        let area = [10.0, 5.0, 111.0, 45.0];
        let [first, second] = Comparison::SideBySide.places(area);
        assert_eq!((first.whole, second.whole), ([10.0, 5.0, 60.0, 45.0], [60.0, 5.0, 111.0, 45.0]));
        assert_eq!((first.seen, Comparison::SideBySide.picture_size([101, 40])), (first.whole, [50, 40]));
        let [first, second] = Comparison::Slider(0.25).places(area);
        assert_eq!([first.whole, second.whole], [area; 2]);
        assert_eq!((first.seen[2], second.seen[0]), (35.25, 35.25));
        assert_eq!(Comparison::Slider(0.25).picture_size([101, 40]), [101, 40]);
    }
}

//! Display of pictures without a graphics device. Twin: `shaders/display.wgsl`.

use egui::Color32;
use glam::{DVec2, Vec2, Vec3};

use super::app::App;
use super::interpolation::{between_four, pixel_at};
use super::painter::{LoadedPhotograph, SceneRenderer};
use super::software::{WindowPixels, rectangle};
use strivec_field::render::TraceInfo;
use strivec_format::color::byte;
use strivec_format::geometry::Camera;
use strivec_player::{PictureRect, Show, View, each_line};

/// Paints the picture of slot `n` at `place`, if it has one.
pub(super) fn fill_slot(app: &App, n: usize, place: &PictureRect, canvas: &mut WindowPixels) {
    let Some((show, slot)) = app.session.show(n).zip(app.session.slots[n].as_ref()) else { return };
    let SceneRenderer::Cpu(painter) = &slot.painter.renderer else { return };
    let Some((camera, traced)) = &painter.kept else { return };
    let picture = Shown { camera, traced, show: &show, photograph: slot.painter.photograph.as_ref() };
    let [whole, seen] = [place.whole, place.seen].map(rectangle);
    canvas.fill(seen, whole, |at| {
        let [r, g, b] = picture.color_at(at.into()).to_array().map(|v| byte(v.into()));
        Color32::from_rgb(r, g, b)
    });
    if app.session.has_boxes {
        let [corner, size] = [whole.min.to_vec2(), whole.size()].map(|v| DVec2::new(v.x.into(), v.y.into()));
        each_line(&slot.scene, camera, &app.session.boxes, |ends, color| {
            canvas.line(seen, ends.map(|p| corner + p * size), color);
        });
    }
}

/// A picture and its display settings.
struct Shown<'a> {
    camera: &'a Camera,
    traced: &'a [TraceInfo],
    show: &'a Show,
    photograph: Option<&'a LoadedPhotograph>,
}

impl Shown<'_> {
    /// The color at `share`, in parts of the picture's width and height.
    fn color_at(&self, share: Vec2) -> Vec3 {
        let show = self.show;
        let at = share * Vec2::new(self.camera.width as f32, self.camera.height as f32);
        let info = &self.traced[pixel_at(self.size(), at.x.floor() as i32, at.y.floor() as i32)];
        let color = match show.view {
            View::Color => self.between_pixels(at),
            View::Depth if info.pixel.depth > 0.0 => {
                Vec3::splat((0.08 + 0.92 * show.nearness(info.pixel.depth)) * info.pixel.opacity)
            }
            View::Opacity => Vec3::splat(info.pixel.opacity),
            View::Normals => info.normal.map_or(Vec3::ZERO, |normal| {
                0.5 + 0.5 * (self.camera.world_from_camera.transpose() * normal.as_dvec3()).as_vec3()
            }),
            View::Samples => heat(info.samples as f32 / show.most_samples.max(1.0)),
            View::Depth => Vec3::ZERO,
        };
        let [left, top, width, height] = show.photograph;
        let in_photograph = (share - Vec2::new(left, top)) / Vec2::new(width, height);
        match self.photograph {
            Some(photograph)
                if show.photograph_share > 0.0 && in_photograph.clamp(Vec2::ZERO, Vec2::ONE) == in_photograph =>
            {
                color.lerp(photograph.color_at(in_photograph), show.photograph_share)
            }
            _ => color,
        }
    }

    fn size(&self) -> [u32; 2] {
        [self.camera.width, self.camera.height]
    }

    /// The color at `at`, in pixels from the corner, on the displayed background.
    fn between_pixels(&self, at: Vec2) -> Vec3 {
        let [own, wanted] = [self.show.scene_background, self.show.background].map(Vec3::from);
        between_four(self.size(), at, |number| {
            let pixel = &self.traced[number].pixel;
            Vec3::from(pixel.color) + (1.0 - pixel.opacity) * (wanted - own)
        })
    }
}

impl LoadedPhotograph {
    /// The color at `share`, in parts of its width and height.
    fn color_at(&self, share: Vec2) -> Vec3 {
        let [width, height] = self.size;
        between_four(self.size, share * Vec2::new(width as f32, height as f32), |number| {
            Vec3::from([0, 1, 2].map(|c| f32::from(self.rgba[4 * number + c]) / 255.0))
        })
    }
}

/// Heat map from dark blue over red to white, for `share` from 0 to 1.
fn heat(share: f32) -> Vec3 {
    let x = share.clamp(0.0, 1.0);
    Vec3::new(2.2 * x, 2.4 * x - 1.0, 0.35 + 1.6 * x * (1.0 - 2.0 * x) + (4.0 * x - 3.0).max(0.0))
        .clamp(Vec3::ZERO, Vec3::ONE)
}

//! State of the page's player: a session on a canvas.

use glam::DQuat;
use serde_json::{Value, json};

use super::canvas::Canvas;
use super::painter::{Device, Lent, PagePainter};
use strivec_field::render::Pixel;
use strivec_field::render::gpu::GpuError;
use strivec_format::color::byte;
use strivec_format::container::Pose;
use strivec_format::geometry::{Camera, PoseError, Viewpoint};
use strivec_player::{Comparison, Drag, Fact, PictureRect, SceneSlot, Session, View};

/// Seconds that a picture may take while the camera moves, at first.
const FRAME_TIME: f64 = 0.033;

/// The player.
#[derive(Debug)]
pub(super) struct App {
    pub(super) canvas: Canvas,
    pub(super) session: Session<PagePainter>,
    pub(super) dragging: Option<Drag>,
    /// The pointer, in parts of the canvas's height.
    pointer: [f64; 2],
    /// An error between two frames, for the next frame.
    failure: Option<GpuError>,
    /// True while work waits for the device.
    pub(super) is_waiting: bool,
    /// Seconds of the last frame; `None` after a pause.
    frame_at: Option<f64>,
}

impl App {
    /// A player without a scene.
    pub(super) fn new(canvas: Canvas) -> Self {
        let device = Device { gpu: canvas.gpu.clone(), format: canvas.format() };
        Self {
            canvas,
            session: Session::new(device, FRAME_TIME),
            dragging: None,
            pointer: [0.0; 2],
            failure: None,
            is_waiting: false,
            frame_at: None,
        }
    }

    /// Moves the camera, draws, and brings the canvas, which is now of `size`, up to date at `now` seconds. Returns
    /// whether another frame is needed.
    pub(super) fn frame(&mut self, now: f64, size: [u32; 2]) -> Result<bool, GpuError> {
        let elapsed = self.frame_at.map_or(0.0, |before| (now - before).max(0.0));
        self.canvas.resize(size);
        self.session.resize(self.canvas.size());
        let is_moving = self.session.move_camera(elapsed);
        self.draw();
        if let Some(failure) = self.failure.take() {
            self.session.close();
            self.paint();
            return Err(failure);
        }
        if self.session.is_dirty {
            self.paint();
        }
        let has_more = is_moving || self.session.is_busy();
        self.frame_at = has_more.then_some(now);
        Ok(has_more)
    }

    /// Submits work to the device; never waits. The next frame returns an error.
    pub(super) fn draw(&mut self) {
        if let Err(error) = self.session.draw(f64::INFINITY) {
            self.failure = Some(error);
        }
    }

    fn paint(&mut self) {
        self.session.is_dirty = false;
        let (session, size) = (&self.session, self.canvas.size());
        let places = session.places([0.0, 0.0, size[0] as f32, size[1] as f32]);
        self.canvas.paint(|pass| {
            for (n, place) in places.into_iter().enumerate() {
                let Some(slot) = session.slots[n].as_ref().filter(|_| session.slots[0].is_some()) else { continue };
                let Some((show, camera)) = session.show(n).zip(slot.painter.screen.camera()) else { continue };
                if !place.enter(pass, size) {
                    continue;
                }
                let [left, top, right, bottom] = place.whole;
                slot.painter.screen.draw(pass, [left, top], [right - left, bottom - top], &show);
                if session.has_boxes {
                    slot.painter.boxes.draw(&session.device.gpu, pass, camera, &session.boxes);
                }
            }
        });
    }

    /// Composes the `pictures` of both scenes in a window of `size`: a byte for red, green, blue and opacity of each
    /// pixel.
    pub(super) fn composed(&self, pictures: &[Option<Vec<Pixel>>; 2], size: [u32; 2]) -> Vec<u8> {
        let columns = self.session.picture_size(size)[0] as usize;
        let places = self.session.places([0.0, 0.0, size[0] as f32, size[1] as f32]);
        let mut bytes = vec![255; 4 * size[0] as usize * size[1] as usize];
        for n in 0..2 {
            let (Some(slot), Some(picture)) = (&self.session.slots[n], &pictures[n]) else { continue };
            // The arrangement may have changed since the pictures were begun.
            if picture.len() != columns * size[1] as usize {
                continue;
            }
            let own = slot.scene.frame.background;
            let wanted = self.session.background.unwrap_or(own);
            let colors = rgba(picture, [0, 1, 2].map(|c| wanted[c] - own[c]));
            let PictureRect { whole, seen } = places[n];
            let [first, last] = [seen[0], seen[2]].map(|x| x.round() as usize);
            for row in 0..size[1] as usize {
                for x in first..last {
                    let column = (x - whole[0] as usize).min(columns - 1);
                    let [to, from] = [row * size[0] as usize + x, row * columns + column].map(|at| 4 * at);
                    bytes[to..to + 4].copy_from_slice(&colors[from..from + 4]);
                }
            }
        }
        bytes
    }

    /// Moves the pointer to `at`, in parts of the canvas's height.
    pub(super) fn pointed(&mut self, at: [f64; 2]) {
        let moved = [at[0] - self.pointer[0], at[1] - self.pointer[1]];
        self.pointer = at;
        if let Some(drag) = self.dragging {
            self.session.steer(|controls| {
                controls.dragged(moved, drag);
                true
            });
        }
    }

    /// The camera of the first scene, and the pointer in pixels of its picture.
    pub(super) fn pointed_at(&self) -> Option<(Camera, [f64; 2])> {
        let camera = self.session.camera_of(0, self.session.full_size())?;
        let [x, y] = self.pointer.map(|v| v * f64::from(camera.height));
        let width = f64::from(camera.width);
        // Side by side, both halves show the same view.
        let is_side = self.session.active_comparison() == Some(Comparison::SideBySide);
        Some((camera, [if is_side { x % width } else { x }, y]))
    }

    /// Sets the background, sRGB from 0 to 1; `None` for the scene's.
    pub(super) fn set_background(&mut self, color: Option<[f32; 3]>) {
        (self.session.background, self.session.is_dirty) = (color, true);
    }

    /// Shows or hides tensor boxes.
    pub(super) fn set_boxes(&mut self, are_shown: bool) {
        (self.session.has_boxes, self.session.is_dirty) = (are_shown, true);
    }

    /// Shows or hides the tensor boxes of `scale`.
    pub(super) fn set_boxes_of(&mut self, scale: usize, are_shown: bool) {
        if let Some(is_shown) = self.session.boxes.get_mut(scale) {
            (*is_shown, self.session.is_dirty) = (are_shown, true);
        }
    }

    /// Pose of training camera `n` of the file, as in [`App::camera`].
    pub(super) fn training_camera(&self, n: usize) -> Option<Vec<f64>> {
        let slot = self.session.slots[0].as_ref()?;
        let Pose { position, rotation } = slot.cameras.get(n)?.pose;
        let camera = Viewpoint { position, rotation, vertical_angle: 1.0 }.camera([2, 2]);
        Some(camera.mapped(&slot.scene.frame.model_from_dataset.inverse()).pose().to_vec())
    }

    /// Lends scene `n`'s renderer.
    pub(super) fn lend(&mut self, n: usize) -> Option<Lent> {
        let lent = self.session.slots[n].as_mut()?.painter.lend()?;
        self.session.slots.iter_mut().flatten().for_each(SceneSlot::stop);
        self.session.pace.abandoned();
        Some(lent)
    }

    /// Takes back what scene `n` has lent, unless the renderer was replaced.
    pub(super) fn take_back(&mut self, n: usize, lent: Lent) {
        if self.session.slots[n].as_mut().is_some_and(|slot| slot.painter.take_back(lent)) {
            self.session.changed();
        }
    }

    /// A row-major camera-to-world matrix in the dataset's space, and the vertical angle of view in degrees.
    pub(super) fn camera(&self) -> Option<Vec<f64>> {
        let (slot, controls) = (self.session.slots[0].as_ref()?, self.session.controls.as_ref()?);
        let camera = controls.camera([2, 2]).mapped(&slot.scene.frame.model_from_dataset.inverse());
        let degrees = controls.angle_of_view().to_degrees();
        Some(camera.pose().into_iter().chain([degrees]).collect())
    }

    /// Sets the camera from the numbers of [`App::camera`]; the angle may be absent.
    pub(super) fn set_camera(&mut self, numbers: &[f64]) -> Result<(), PoseError> {
        let (Some(slot), Some(controls)) = (&self.session.slots[0], &mut self.session.controls) else { return Ok(()) };
        let (pose, degrees) = numbers.split_at(numbers.len().min(16));
        let camera = Camera::posed(pose, [2, 2], 1.0)?.mapped(&slot.scene.frame.model_from_dataset);
        let pose = Pose { position: camera.position, rotation: DQuat::from_mat3(&camera.world_from_camera) };
        let angle = degrees.first().filter(|v| v.is_finite()).map_or(controls.angle_of_view(), |v| v.to_radians());
        controls.place_with_angle(pose, angle);
        self.session.changed();
        Ok(())
    }

    /// The state for the panel; null if no scene is open.
    pub(super) fn state(&self) -> Value {
        let session = &self.session;
        let Some(slot) = &session.slots[0] else { return Value::Null };
        let own = &slot.scene.rules;
        let memory = session.slots.iter().flatten().filter_map(|s| s.painter.memory_bytes());
        let memory = memory.reduce(|a, b| [a[0] + b[0], a[1] + b[1]]);
        json!({
            "facts": facts_of(&slot.facts),
            "scales": slot.scales,
            "all_scales": slot.all_scales,
            "is_whole": slot.is_whole,
            "second": session.slots[1].as_ref().map(|second| json!({
                "facts": facts_of(&second.facts),
                "scales": second.scales,
                "all_scales": second.all_scales,
                "is_whole": second.is_whole,
            })),
            "divider": match session.comparison {
                Comparison::Slider(at) => Some(at),
                Comparison::SideBySide => None,
            },
            "is_at_rest": session.is_fine_enough() && !session.is_drawing(),
            "device": session.device.gpu.info().name,
            "memory_bytes": memory,
            "milliseconds": session.seconds.map(|s| 1e3 * s),
            "milliseconds_before": session.seconds_before.map(|s| 1e3 * s),
            "rays_per_second": session.pace.rays_per_second(),
            "divisor": session.pace.shown(),
            "view": session.view.name(),
            "views": View::ALL.map(View::name),
            "background": session.background.unwrap_or(slot.scene.frame.background),
            "own_background": slot.scene.frame.background,
            "has_own_background": session.background.is_none(),
            "shows_background": session.shows_background(),
            "has_boxes": session.has_boxes,
            "boxes": session.boxes,
            "choices": slot.choices.iter().map(|(name, _)| name).collect::<Vec<_>>(),
            "cameras": slot.cameras.len(),
            "camera": session.photograph.camera,
            "photograph": session.photograph.share,
            "has_photograph": session.photograph.is_loaded,
            "near": session.near(),
            "is_recording": session.recorder.is_recording(),
            "is_playing": session.recorder.is_playing(),
            "quality": {
                "step": session.approximation.step_scale,
                "threshold": session.approximation.min_weight.unwrap_or(own.min_weight),
                "own_threshold": own.min_weight,
                "finest": session.finest,
            },
        })
    }
}

fn facts_of(facts: &[Fact]) -> Vec<Value> {
    facts.iter().map(|f| json!({ "name": f.name, "value": f.value })).collect()
}

/// A byte for red, green, blue and opacity of each pixel, on a background that differs from the scene's by `shift`.
pub(super) fn rgba(pixels: &[Pixel], shift: [f32; 3]) -> Vec<u8> {
    let color = |p: &Pixel| [0, 1, 2].map(|c| byte(f64::from(p.color[c] + (1.0 - p.opacity) * shift[c])));
    pixels.iter().map(color).flat_map(|[r, g, b]| [r, g, b, 255]).collect()
}

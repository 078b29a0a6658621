//! What a canvas shows, apart from the page: scene, camera, settings, and what is being drawn.

use glam::DQuat;
use serde_json::{Value, json};

use super::canvas::Canvas;
use super::scene_slot::SceneSlot;
use crate::container::Pose;
use crate::geometry::{Camera, PoseError};
use crate::player::{Action, Controls, Drag, Pace, Step, View, action_of, scale_count};
use crate::render::Approximation;
use crate::render::gpu::{GpuError, GpuRenderer};

/// Seconds that a picture may take while the camera moves, at first.
const FRAME_TIME: f64 = 0.033;
/// Seconds between frames that a flight takes into account: a page may have slept.
const LONGEST_FRAME: f64 = 0.25;

/// The player.
pub(super) struct App {
    pub(super) canvas: Canvas,
    pub(super) slot: Option<SceneSlot>,
    /// Of the renderer that the slot has now.
    renderer_number: u64,
    pub(super) controls: Option<Controls>,
    pace: Pace,
    pub(super) approximation: Approximation,
    /// Pictures get no finer than this many times smaller than the canvas.
    finest: u32,
    view: View,
    /// In place of the scene's.
    pub(super) background: Option<[f32; 3]>,
    /// \[scale\] whether its boxes are shown.
    boxes: Vec<bool>,
    has_boxes: bool,
    pub(super) dragging: Option<Drag>,
    /// In parts of the canvas's height.
    pointer: [f64; 2],
    /// Seconds that the last whole picture took, and the one before the settings were changed.
    seconds: Option<f64>,
    seconds_before: Option<f64>,
    /// What went wrong between two frames.
    failure: Option<GpuError>,
    /// Whether somebody waits for the device.
    pub(super) is_waiting: bool,
    /// Whether the canvas is out of date.
    is_dirty: bool,
    /// When the last frame was; absent where it was long ago.
    frame_at: Option<f64>,
}

impl App {
    /// Without a scene.
    pub(super) fn new(canvas: Canvas) -> Self {
        Self {
            canvas,
            slot: None,
            renderer_number: 0,
            controls: None,
            pace: Pace::new(FRAME_TIME),
            approximation: Approximation::default(),
            finest: 1,
            view: View::Color,
            background: None,
            boxes: Vec::new(),
            has_boxes: false,
            dragging: None,
            pointer: [0.0; 2],
            seconds: None,
            seconds_before: None,
            failure: None,
            is_waiting: false,
            is_dirty: true,
            frame_at: None,
        }
    }

    /// Shows what has arrived: a new scene, or more of the one that is shown.
    pub(super) fn take(&mut self, step: Step, is_more_of_the_same: bool) -> Result<(), GpuError> {
        let (scene, views) = (&step.document.scene, step.document.extras.views.as_ref());
        let controls = Controls::new(scene, views);
        let scales = scene.scales.len();
        let approximation = if is_more_of_the_same { self.approximation } else { Approximation::default() };
        let mut slot = SceneSlot::new(&self.canvas.gpu, self.canvas.format(), step, &approximation)?;
        match &mut self.slot {
            // The old picture stays until there is a new one.
            Some(before) if is_more_of_the_same => std::mem::swap(&mut slot.screen, &mut before.screen),
            _ => {
                self.controls = Some(controls);
                self.background = None;
                (self.seconds, self.seconds_before) = (None, None);
                (self.approximation, self.finest) = (approximation, 1);
                self.boxes.clear();
            }
        }
        self.boxes.resize(scales, true);
        self.slot = Some(slot);
        self.has_new_renderer();
        Ok(())
    }

    fn has_new_renderer(&mut self) {
        self.renderer_number += 1;
        self.pace.abandoned();
        self.changed();
    }

    /// What is shown is out of date.
    pub(super) fn changed(&mut self) {
        self.pace.changed();
        self.is_dirty = true;
    }

    /// Moves the camera, draws, and brings the canvas, which is now of `size`, up to date at `now` seconds. Whether there is
    /// more to do.
    pub(super) fn frame(&mut self, now: f64, size: [u32; 2]) -> Result<bool, GpuError> {
        let elapsed = self.frame_at.map_or(0.0, |before| (now - before).clamp(0.0, LONGEST_FRAME));
        let before = self.canvas.size();
        self.canvas.resize(size);
        if self.canvas.size() != before {
            self.changed();
        }
        let is_flying = self.controls.as_mut().is_some_and(|c| c.fly(elapsed));
        if is_flying {
            self.changed();
        }
        self.draw();
        if let Some(failure) = self.failure.take() {
            (self.slot, self.is_dirty) = (None, true);
            self.paint();
            return Err(failure);
        }
        if self.is_dirty {
            self.paint();
        }
        let is_busy = self.slot.as_ref().is_some_and(|s| s.is_drawing() || s.renderer.is_none());
        let has_more = is_flying || is_busy || self.is_dirty || (self.slot.is_some() && !self.is_fine_enough());
        self.frame_at = has_more.then_some(now);
        Ok(has_more)
    }

    fn is_fine_enough(&self) -> bool {
        self.pace.shown().is_some_and(|shown| shown <= self.finest)
    }

    /// Gives the device what it should be at; never waits. Failures are told at the next frame.
    pub(super) fn draw(&mut self) {
        if let Err(error) = self.draw_pictures() {
            self.failure = Some(error);
        }
    }

    fn draw_pictures(&mut self) -> Result<(), GpuError> {
        let size = self.canvas.size();
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        loop {
            let is_fine_enough = self.is_fine_enough();
            let (Some(slot), Some(controls)) = (&mut self.slot, &self.controls) else { return Ok(()) };
            if slot.renderer.is_none() {
                return Ok(());
            }
            let wanted = self.pace.next(pixels).map(|divisor| divisor.max(self.finest));
            if let Some(divisor) = wanted.filter(|_| !is_fine_enough) {
                let camera = controls.camera(size.map(|v| v.div_ceil(divisor).max(1)));
                slot.begin(&camera, self.view == View::Normals)?;
                self.pace.begun(divisor);
            }
            let (rays, pace) = (self.pace.rays_at_once(), &mut self.pace);
            let Some(seconds) = slot.advance(rays, |rays, seconds| pace.measured(rays, seconds))? else {
                return Ok(());
            };
            self.is_dirty = true;
            self.pace.finished();
            if slot.screen.camera().map(|c| [c.width, c.height]) == Some(size) {
                self.seconds = Some(seconds);
            }
            if self.pace.shown().is_none() {
                // The camera moves on: the next frame knows where to.
                return Ok(());
            }
        }
    }

    /// Whether the device is at a picture.
    pub(super) fn is_drawing(&self) -> bool {
        self.slot.as_ref().is_some_and(SceneSlot::is_drawing)
    }

    fn paint(&mut self) {
        self.is_dirty = false;
        let size = self.canvas.size().map(|v| v as f32);
        self.canvas.paint(|pass| {
            let Some(slot) = &self.slot else { return };
            let Some(camera) = slot.screen.camera() else { return };
            slot.screen.draw(pass, [0.0; 2], size, &slot.show(self.view, self.background));
            if self.has_boxes {
                slot.boxes.draw(&self.canvas.gpu, pass, camera, &self.boxes);
            }
        });
    }

    /// The pointer is now at `at`, in parts of the canvas's height.
    pub(super) fn pointed(&mut self, at: [f64; 2]) {
        let moved = [at[0] - self.pointer[0], at[1] - self.pointer[1]];
        self.pointer = at;
        if let Some(drag) = self.dragging {
            self.steer(|controls| {
                controls.dragged(moved, drag);
                true
            });
        }
    }

    /// Where the pointer is, in parts of the canvas's width and height.
    pub(super) fn pointer_in_picture(&self) -> [f64; 2] {
        let [width, height] = self.canvas.size().map(f64::from);
        [self.pointer[0] * height / width, self.pointer[1]]
    }

    /// Moves the camera by what `input` makes of it, if there is one: whether it has moved.
    pub(super) fn steer(&mut self, input: impl FnOnce(&mut Controls) -> bool) {
        if self.controls.as_mut().is_some_and(input) {
            self.changed();
        }
    }

    /// A key went down or up. What it asks for; all but focus, help, panel, screenshot and paths is done.
    pub(super) fn key(&mut self, code: &str, is_pressed: bool, is_modified: bool) -> Option<Action> {
        let action = match &mut self.controls {
            Some(controls) => controls.key(code, is_pressed, is_modified),
            None => action_of(code, is_modified).filter(|_| is_pressed),
        };
        match action? {
            Action::NextView => self.set_view(self.view.next()),
            Action::Boxes => self.set_boxes(!self.has_boxes),
            Action::Reset | Action::Recall(_) => self.changed(),
            _ => {}
        }
        action
    }

    /// Changes the way to look at the picture.
    pub(super) fn set_view(&mut self, view: View) {
        // Normals are drawn only where they are wanted.
        if view == View::Normals {
            self.changed();
        }
        (self.view, self.is_dirty) = (view, true);
    }

    pub(super) fn set_background(&mut self, color: Option<[f32; 3]>) {
        (self.background, self.is_dirty) = (color, true);
    }

    pub(super) fn set_boxes(&mut self, are_shown: bool) {
        (self.has_boxes, self.is_dirty) = (are_shown, true);
    }

    pub(super) fn set_boxes_of(&mut self, scale: usize, are_shown: bool) {
        if let Some(is_shown) = self.boxes.get_mut(scale) {
            (*is_shown, self.is_dirty) = (are_shown, true);
        }
    }

    /// Draws with `approximation` from now on, no finer than `finest`.
    pub(super) fn approximate(&mut self, approximation: &Approximation, finest: u32) -> Result<(), GpuError> {
        if self.finest != finest {
            self.finest = finest;
            self.changed();
        }
        let Some(slot) = self.slot.as_mut().filter(|_| self.approximation != *approximation) else { return Ok(()) };
        slot.approximate(&self.canvas.gpu, approximation)?;
        self.approximation = *approximation;
        self.seconds_before = self.seconds.take();
        self.has_new_renderer();
        Ok(())
    }

    pub(super) fn set_frame_time(&mut self, seconds: f64) {
        self.pace.set_target(seconds);
    }

    /// Lends the renderer, and which one it is.
    pub(super) fn lend(&mut self) -> Option<(GpuRenderer, u64)> {
        let renderer = self.slot.as_mut()?.lend()?;
        self.pace.abandoned();
        Some((renderer, self.renderer_number))
    }

    /// Takes back what was lent, unless there is another one by now.
    pub(super) fn take_back(&mut self, renderer: GpuRenderer, number: u64) {
        if let Some(slot) = self.slot.as_mut().filter(|_| number == self.renderer_number) {
            slot.renderer = Some(renderer);
            self.changed();
        }
    }

    /// A row-major camera-to-world matrix in the dataset's space, and the degrees that the picture spans from top to bottom.
    pub(super) fn camera(&self) -> Option<Vec<f64>> {
        let (slot, controls) = (self.slot.as_ref()?, self.controls.as_ref()?);
        let camera = controls.camera([2, 2]).mapped(&slot.scene.frame.model_from_dataset.inverse());
        let degrees = controls.angle_of_view().to_degrees();
        Some(camera.pose().into_iter().chain([degrees]).collect())
    }

    /// Puts the camera where [`App::camera`] has said that it was; the angle may be absent.
    pub(super) fn set_camera(&mut self, numbers: &[f64]) -> Result<(), PoseError> {
        let (Some(slot), Some(controls)) = (&self.slot, &mut self.controls) else { return Ok(()) };
        let (pose, degrees) = numbers.split_at(numbers.len().min(16));
        let camera = Camera::posed(pose, [2, 2], 1.0)?.mapped(&slot.scene.frame.model_from_dataset);
        let pose = Pose { position: camera.position, rotation: DQuat::from_mat3(&camera.world_from_camera) };
        let angle = degrees.first().filter(|v| v.is_finite()).map_or(controls.angle_of_view(), |v| v.to_radians());
        controls.place_with_angle(pose, angle);
        self.changed();
        Ok(())
    }

    /// All that a panel shows.
    pub(super) fn state(&self) -> Value {
        let Some(slot) = &self.slot else { return Value::Null };
        let own = &slot.scene.rules;
        let facts: Vec<Value> = slot.facts.iter().map(|f| json!({ "name": f.name, "value": f.value })).collect();
        json!({
            "facts": facts,
            "scales": slot.scales,
            "all_scales": scale_count(&slot.contents),
            "is_whole": slot.is_whole,
            "is_at_rest": self.is_fine_enough() && !slot.is_drawing(),
            "device": self.canvas.gpu.info().name,
            "memory_bytes": slot.renderer.as_ref().map(GpuRenderer::memory_bytes),
            "milliseconds": self.seconds.map(|s| 1e3 * s),
            "milliseconds_before": self.seconds_before.map(|s| 1e3 * s),
            "rays_per_second": self.pace.rays_per_second(),
            "divisor": self.pace.shown(),
            "view": self.view.name(),
            "views": View::ALL.map(View::name),
            "background": self.background.unwrap_or(slot.scene.frame.background),
            "has_own_background": self.background.is_none(),
            "has_boxes": self.has_boxes,
            "boxes": self.boxes,
            "quality": {
                "neighbours": self.approximation.neighbours.unwrap_or(slot.most_neighbours()),
                "most_neighbours": slot.most_neighbours(),
                "scales": self.approximation.scales.unwrap_or(slot.scene.scales.len() as u32),
                "step": self.approximation.step_scale,
                "threshold": self.approximation.min_weight.unwrap_or(own.min_weight),
                "own_threshold": own.min_weight,
                "finest": self.finest,
            },
        })
    }
}

//! What a canvas shows, apart from the page: scenes, camera, settings, and what is being drawn.

use glam::DQuat;
use serde_json::{Value, json};

use super::canvas::Canvas;
use super::scene_slot::SceneSlot;
use crate::color::byte;
use crate::container::Pose;
use crate::geometry::{Camera, PoseError, Viewpoint};
use crate::player::{
    Action, Comparison, Controls, Drag, Fact, Pace, Photograph, Place, Recorder, Show, Step, View, action_of,
};
use crate::render::gpu::{GpuError, GpuRenderer};
use crate::render::{Approximation, Pixel, RenderSettings};

/// Seconds that a picture may take while the camera moves, at first.
const FRAME_TIME: f64 = 0.033;

/// The player.
pub(super) struct App {
    pub(super) canvas: Canvas,
    /// The first, and the one that it is compared with.
    pub(super) slots: [Option<SceneSlot>; 2],
    /// \[slot\] of the renderer that it has now.
    renderer_numbers: [u64; 2],
    pub(super) controls: Option<Controls>,
    pace: Pace,
    pub(super) approximation: Approximation,
    /// Pictures get no finer than this many times smaller than the canvas.
    finest: u32,
    view: View,
    /// In place of the scene's.
    pub(super) background: Option<[f32; 3]>,
    comparison: Comparison,
    /// \[scale\] whether its boxes are shown.
    boxes: Vec<bool>,
    has_boxes: bool,
    photograph: Photograph,
    pub(super) recorder: Recorder,
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
            slots: [None, None],
            renderer_numbers: [0; 2],
            controls: None,
            pace: Pace::new(FRAME_TIME),
            approximation: Approximation::default(),
            finest: 1,
            view: View::Color,
            background: None,
            comparison: Comparison::Slider(0.5),
            boxes: Vec::new(),
            has_boxes: false,
            photograph: Photograph::default(),
            recorder: Recorder::default(),
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

    /// Shows what has arrived, as the first scene or as the second: a new scene, or more of the one that is shown.
    pub(super) fn take(&mut self, step: Step, is_more_of_the_same: bool, n: usize) -> Result<(), GpuError> {
        let (scene, views) = (&step.document.scene, step.document.metadata.views.as_ref());
        let controls = Controls::new(scene, views);
        let scales = scene.scales.len();
        let is_new = n == 0 && !is_more_of_the_same;
        let approximation = if is_new { Approximation::default() } else { self.approximation };
        let mut slot = SceneSlot::new(&self.canvas.gpu, self.canvas.format(), step, &approximation)?;
        if let Some(before) = self.slots[n].as_mut().filter(|_| is_more_of_the_same) {
            // The old picture stays until there is a new one.
            std::mem::swap(&mut slot.screen, &mut before.screen);
        }
        if is_new {
            if let Some(second) = self.slots[1].as_mut().filter(|_| approximation != self.approximation) {
                second.approximate(&self.canvas.gpu, &approximation)?;
                self.has_new_renderer(1);
            }
            (self.approximation, self.finest) = (approximation, 1);
            self.controls = Some(controls);
            self.background = None;
            (self.seconds, self.seconds_before) = (None, None);
            self.photograph = Photograph::default();
            self.boxes.clear();
        }
        if n == 0 {
            self.boxes.resize(scales, true);
        }
        self.slots[n] = Some(slot);
        self.has_new_renderer(n);
        Ok(())
    }

    /// Shows the first scene alone.
    pub(super) fn close_second(&mut self) {
        self.slots[1] = None;
        self.has_new_renderer(1);
    }

    fn has_new_renderer(&mut self, n: usize) {
        self.renderer_numbers[n] += 1;
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
        let elapsed = self.frame_at.map_or(0.0, |before| (now - before).max(0.0));
        let before = self.canvas.size();
        self.canvas.resize(size);
        if self.canvas.size() != before {
            self.changed();
        }
        let is_moving = self.move_camera(elapsed);
        if is_moving {
            self.changed();
        }
        self.draw();
        if let Some(failure) = self.failure.take() {
            (self.slots, self.is_dirty) = ([None, None], true);
            self.paint();
            return Err(failure);
        }
        if self.is_dirty {
            self.paint();
        }
        let is_busy = self.slots.iter().flatten().any(|s| s.is_drawing() || s.renderer.is_none());
        let is_unfinished = self.slots[0].is_some() && !self.is_fine_enough();
        let has_more = is_moving || is_busy || self.is_dirty || is_unfinished || self.recorder.is_recording();
        self.frame_at = has_more.then_some(now);
        Ok(has_more)
    }

    /// Moves the camera by what happens in `elapsed` seconds; whether it flies or follows a path.
    pub(super) fn move_camera(&mut self, elapsed: f64) -> bool {
        let (Some(slot), Some(controls)) = (&self.slots[0], &mut self.controls) else { return false };
        let is_flying = controls.fly(elapsed);
        self.recorder.follow(elapsed, controls, &slot.scene.frame.model_from_dataset) || is_flying
    }

    fn is_fine_enough(&self) -> bool {
        self.pace.shown().is_some_and(|shown| shown <= self.finest)
    }

    /// How two scenes are seen together, where there are two.
    fn comparison(&self) -> Option<Comparison> {
        self.slots.iter().all(Option::is_some).then_some(self.comparison)
    }

    /// The size of each scene's picture in a window of `size`.
    fn picture_size(&self, size: [u32; 2]) -> [u32; 2] {
        self.comparison().map_or(size, |comparison| comparison.picture_size(size))
    }

    /// Where the scenes' pictures lie in a window of `size`.
    fn places(&self, size: [u32; 2]) -> [Place; 2] {
        let area = [0.0, 0.0, size[0] as f32, size[1] as f32];
        self.comparison().map_or([Place::of(area); 2], |comparison| comparison.places(area))
    }

    /// The camera for scene `n` in a window of `size`.
    pub(super) fn camera_of(&self, n: usize, size: [u32; 2]) -> Option<Camera> {
        let camera = self.controls.as_ref()?.camera(self.picture_size(size));
        let frames = [self.slots[0].as_ref()?, self.slots[n].as_ref()?].map(|slot| &slot.scene.frame);
        Some(Comparison::camera_of_second(&camera, frames[0], frames[1]))
    }

    /// Gives the device what it should be at; never waits. Failures are told at the next frame.
    pub(super) fn draw(&mut self) {
        if let Err(error) = self.draw_pictures() {
            self.failure = Some(error);
        }
    }

    fn draw_pictures(&mut self) -> Result<(), GpuError> {
        let (window, size) = (self.canvas.size(), self.picture_size(self.canvas.size()));
        let scenes = self.slots.iter().flatten().count() as u64;
        let pixels = u64::from(size[0]) * u64::from(size[1]) * scenes;
        loop {
            if self.slots[0].is_none() || self.slots.iter().flatten().any(|s| s.renderer.is_none()) {
                return Ok(());
            }
            let wanted = self.pace.next(pixels).map(|divisor| divisor.max(self.finest));
            if let Some(divisor) = wanted.filter(|_| !self.is_fine_enough()) {
                let small = window.map(|v| v.div_ceil(divisor).max(1));
                for n in 0..2 {
                    let camera = self.camera_of(n, small);
                    if let (Some(slot), Some(camera)) = (&mut self.slots[n], camera) {
                        slot.begin(&camera, self.view == View::Normals)?;
                    }
                }
                self.pace.begun(divisor);
            }
            let mut seconds = None;
            for slot in self.slots.iter_mut().flatten().filter(|s| s.is_drawing()) {
                let (rays, pace) = (self.pace.rays_at_once(), &mut self.pace);
                seconds = slot.advance(rays, |rays, seconds| pace.measured(rays, seconds))?;
                if seconds.is_none() {
                    return Ok(());
                }
            }
            let Some(seconds) = seconds else { return Ok(()) };
            self.is_dirty = true;
            self.pace.finished();
            let shown = self.slots[0].as_ref().and_then(|s| s.screen.camera());
            if shown.map(|c| [c.width, c.height]) == Some(size) {
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
        self.slots.iter().flatten().any(SceneSlot::is_drawing)
    }

    fn paint(&mut self) {
        self.is_dirty = false;
        let size = self.canvas.size();
        let places = self.places(size);
        self.canvas.paint(|pass| {
            for (n, place) in places.into_iter().enumerate() {
                let Some(slot) = self.slots[n].as_ref().filter(|_| self.slots[0].is_some()) else { continue };
                let Some(camera) = slot.screen.camera() else { continue };
                if !place.enter(pass, size) {
                    continue;
                }
                let [left, top, right, bottom] = place.whole;
                slot.screen.draw(pass, [left, top], [right - left, bottom - top], &self.show(slot, n));
                if self.has_boxes {
                    slot.boxes.draw(&self.canvas.gpu, pass, camera, &self.boxes);
                }
            }
        });
    }

    /// How `slot`, number `n`, is shown.
    fn show(&self, slot: &SceneSlot, n: usize) -> Show {
        let shown = slot.screen.camera();
        let show = Show::new(&slot.scene, shown, self.view, self.background);
        match shown.and_then(|shown| self.photograph.place(&slot.cameras, shown)).filter(|_| n == 0) {
            Some(photograph) => Show { photograph_share: self.photograph.shown_share(), photograph, ..show },
            None => show,
        }
    }

    /// What is seen in a window of `size`, of the pictures of both scenes: a byte for red, green, blue and opacity of each
    /// pixel.
    pub(super) fn composed(&self, pictures: &[Option<Vec<Pixel>>; 2], size: [u32; 2]) -> Vec<u8> {
        let columns = self.picture_size(size)[0] as usize;
        let places = self.places(size);
        let mut bytes = vec![255; 4 * size[0] as usize * size[1] as usize];
        for n in 0..2 {
            let (Some(slot), Some(picture)) = (&self.slots[n], &pictures[n]) else { continue };
            // The layout may have changed since the pictures were asked for.
            if picture.len() != columns * size[1] as usize {
                continue;
            }
            let own = slot.scene.frame.background;
            let wanted = self.background.unwrap_or(own);
            let colors = rgba(picture, [0, 1, 2].map(|c| wanted[c] - own[c]));
            let Place { whole, seen } = places[n];
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

    /// The camera of the first scene and the point of its picture, in pixels, where the pointer is.
    pub(super) fn pointed_at(&self) -> Option<(Camera, [f64; 2])> {
        let camera = self.camera_of(0, self.canvas.size())?;
        let [x, y] = self.pointer.map(|v| v * f64::from(camera.height));
        let width = f64::from(camera.width);
        // Side by side, both halves show the same.
        Some((camera, [if self.comparison() == Some(Comparison::SideBySide) { x % width } else { x }, y]))
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
            Action::NextCamera => self.go_to_camera(self.photograph.neighbor(self.camera_count(), true)),
            Action::CameraBefore => self.go_to_camera(self.photograph.neighbor(self.camera_count(), false)),
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

    pub(super) fn set_comparison(&mut self, comparison: Comparison) {
        let before = self.picture_size(self.canvas.size());
        (self.comparison, self.is_dirty) = (comparison, true);
        if self.picture_size(self.canvas.size()) != before {
            self.changed();
        }
    }

    fn camera_count(&self) -> usize {
        self.slots[0].as_ref().map_or(0, |slot| slot.cameras.len())
    }

    /// Puts the camera where training camera number `n` of the file was.
    pub(super) fn go_to_camera(&mut self, n: usize) {
        let (Some(slot), Some(controls)) = (&self.slots[0], &mut self.controls) else { return };
        if self.photograph.go_to(n, &slot.cameras, controls) {
            self.changed();
        }
    }

    /// Where training camera number `n` of the file was, as [`App::camera`] has it.
    pub(super) fn training_camera(&self, n: usize) -> Option<Vec<f64>> {
        let slot = self.slots[0].as_ref()?;
        let Pose { position, rotation } = slot.cameras.get(n)?.pose;
        let camera = Viewpoint { position, rotation, vertical_angle: 1.0 }.camera([2, 2]);
        Some(camera.mapped(&slot.scene.frame.model_from_dataset.inverse()).pose().to_vec())
    }

    /// Shows this much of the photograph.
    pub(super) fn set_photograph_share(&mut self, share: f32) {
        (self.photograph.share, self.is_dirty) = (share.clamp(0.0, 1.0), true);
        if self.photograph.camera.is_none() {
            self.go_to_camera(0);
        }
    }

    /// Takes the photograph of training camera `n`, if that is still the one that was gone to.
    pub(super) fn set_photograph(&mut self, n: usize, size: [u32; 2], rgba: &[u8]) {
        let (Some(slot), true) = (&mut self.slots[0], self.photograph.camera == Some(n)) else { return };
        slot.screen.set_photograph(size, rgba);
        (self.photograph.is_loaded, self.is_dirty) = (true, true);
    }

    /// Draws as the first scene's file names it; whether it does.
    pub(super) fn choose(&mut self, name: &str) -> Result<bool, GpuError> {
        let choices = self.slots[0].iter().flat_map(|slot| &slot.choices);
        let chosen = choices.clone().find(|(of, _)| of == name).map(|(_, choice)| *choice);
        let Some(RenderSettings { approximation, divisor }) = chosen else { return Ok(false) };
        self.approximate(&approximation, divisor)?;
        Ok(true)
    }

    /// Draws with `approximation` from now on, no finer than `finest`.
    pub(super) fn approximate(&mut self, approximation: &Approximation, finest: u32) -> Result<(), GpuError> {
        if self.finest != finest {
            self.finest = finest;
            self.changed();
        }
        if self.approximation == *approximation {
            return Ok(());
        }
        for n in 0..2 {
            let Some(slot) = &mut self.slots[n] else { continue };
            slot.approximate(&self.canvas.gpu, approximation)?;
            self.has_new_renderer(n);
        }
        self.approximation = *approximation;
        self.seconds_before = self.seconds.take();
        Ok(())
    }

    pub(super) fn set_frame_time(&mut self, seconds: f64) {
        self.pace.set_target(seconds);
    }

    /// Lends scene `n`'s renderer, and which one it is.
    pub(super) fn lend(&mut self, n: usize) -> Option<(GpuRenderer, u64)> {
        let renderer = self.slots[n].as_mut()?.renderer.take()?;
        self.slots.iter_mut().flatten().for_each(SceneSlot::stop);
        self.pace.abandoned();
        Some((renderer, self.renderer_numbers[n]))
    }

    /// Takes back what scene `n` has lent, unless there is another one by now.
    pub(super) fn take_back(&mut self, renderer: GpuRenderer, n: usize, number: u64) {
        if let Some(slot) = self.slots[n].as_mut().filter(|_| number == self.renderer_numbers[n]) {
            slot.renderer = Some(renderer);
            self.changed();
        }
    }

    /// A row-major camera-to-world matrix in the dataset's space, and the degrees that the picture spans from top to bottom.
    pub(super) fn camera(&self) -> Option<Vec<f64>> {
        let (slot, controls) = (self.slots[0].as_ref()?, self.controls.as_ref()?);
        let camera = controls.camera([2, 2]).mapped(&slot.scene.frame.model_from_dataset.inverse());
        let degrees = controls.angle_of_view().to_degrees();
        Some(camera.pose().into_iter().chain([degrees]).collect())
    }

    /// Puts the camera where [`App::camera`] has said that it was; the angle may be absent.
    pub(super) fn set_camera(&mut self, numbers: &[f64]) -> Result<(), PoseError> {
        let (Some(slot), Some(controls)) = (&self.slots[0], &mut self.controls) else { return Ok(()) };
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
        let Some(slot) = &self.slots[0] else { return Value::Null };
        let own = &slot.scene.rules;
        let memory = self.slots.iter().flatten().filter_map(|s| Some(s.renderer.as_ref()?.memory_bytes()));
        let memory = memory.reduce(|a, b| [a[0] + b[0], a[1] + b[1]]);
        json!({
            "facts": facts_of(&slot.facts),
            "scales": slot.scales,
            "all_scales": slot.all_scales,
            "is_whole": slot.is_whole,
            "second": self.slots[1].as_ref().map(|second| json!({
                "facts": facts_of(&second.facts),
                "scales": second.scales,
                "all_scales": second.all_scales,
                "is_whole": second.is_whole,
            })),
            "divider": match self.comparison {
                Comparison::Slider(at) => Some(at),
                Comparison::SideBySide => None,
            },
            "is_at_rest": self.is_fine_enough() && !self.is_drawing(),
            "device": self.canvas.gpu.info().name,
            "memory_bytes": memory,
            "milliseconds": self.seconds.map(|s| 1e3 * s),
            "milliseconds_before": self.seconds_before.map(|s| 1e3 * s),
            "rays_per_second": self.pace.rays_per_second(),
            "divisor": self.pace.shown(),
            "view": self.view.name(),
            "views": View::ALL.map(View::name),
            "background": self.background.unwrap_or(slot.scene.frame.background),
            "own_background": slot.scene.frame.background,
            "has_own_background": self.background.is_none(),
            "has_boxes": self.has_boxes,
            "boxes": self.boxes,
            "choices": slot.choices.iter().map(|(name, _)| name).collect::<Vec<_>>(),
            "cameras": slot.cameras.len(),
            "camera": self.photograph.camera,
            "photograph": self.photograph.share,
            "has_photograph": self.photograph.is_loaded,
            "is_recording": self.recorder.is_recording(),
            "is_playing": self.recorder.is_playing(),
            "quality": {
                "neighbors": self.approximation.neighbors.unwrap_or(slot.most_neighbors()),
                "most_neighbors": slot.most_neighbors(),
                "scales": self.approximation.scales.unwrap_or(slot.scene.scales.len() as u32),
                "step": self.approximation.step_scale,
                "threshold": self.approximation.min_weight.unwrap_or(own.min_weight),
                "own_threshold": own.min_weight,
                "finest": self.finest,
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

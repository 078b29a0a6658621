//! The state of a player, apart from its window or page: scenes, camera, settings, and the picture that is being drawn.

use super::{
    Action, Comparison, Controls, Pace, Painter, PhotographOverlay, PictureRect, Recorder, SceneSlot, Show, Step, View,
    action_of, clock, named_choices,
};
use strivec_field::render::gpu::GpuError;
use strivec_field::render::{Approximation, RenderSettings};
use strivec_format::geometry::Camera;

/// Scenes, camera, settings and drawing, shared by the desktop player and the page. Slot 0 is the scene,
/// slot 1 the scene that it is compared with.
#[derive(Debug)]
pub struct Session<P: Painter> {
    /// The device that draws.
    pub device: P::Device,
    /// The open scenes.
    pub slots: [Option<SceneSlot<P>>; 2],
    /// The camera; `None` before a scene is open.
    pub controls: Option<Controls>,
    /// Resolution and batches of the next pictures.
    pub pace: Pace,
    /// Approximation of the pictures; the default is exact.
    pub approximation: Approximation,
    /// Least divisor of the window's resolution.
    pub finest: u32,
    /// The displayed quantity.
    pub view: View,
    /// Background, sRGB from 0 to 1, in place of the scene's.
    pub background: Option<[f32; 3]>,
    /// Arrangement of two scenes.
    pub comparison: Comparison,
    /// \[scale\] true if its tensor boxes are drawn while `has_boxes`.
    pub boxes: Vec<bool>,
    /// True if tensor boxes are drawn.
    pub has_boxes: bool,
    /// The chosen training camera and its photograph.
    pub photograph: PhotographOverlay,
    /// The recorded camera path.
    pub recorder: Recorder,
    /// Stored settings to open scenes with, by name.
    pub quality: Option<String>,
    /// Seconds that the last picture of full resolution took.
    pub seconds: Option<f64>,
    /// Seconds that the last picture of full resolution took before the settings changed.
    pub seconds_before: Option<f64>,
    /// True if the display is out of date.
    pub is_dirty: bool,
    /// Columns and rows of the place for pictures.
    size: [u32; 2],
}

/// A picture that was finished.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finished {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Seconds since it was begun.
    pub seconds: f64,
}

impl<P: Painter> Session<P> {
    /// A session without a scene. A picture may take `frame_time` seconds while the camera moves.
    pub fn new(device: P::Device, frame_time: f64) -> Self {
        Self {
            device,
            slots: [None, None],
            controls: None,
            pace: Pace::new(frame_time),
            approximation: Approximation::default(),
            finest: 1,
            view: View::Color,
            background: None,
            comparison: Comparison::Slider(0.5),
            boxes: Vec::new(),
            has_boxes: false,
            photograph: PhotographOverlay::default(),
            recorder: Recorder::default(),
            quality: None,
            seconds: None,
            seconds_before: None,
            is_dirty: true,
            size: [1, 1],
        }
    }

    /// Shows a step of a file in slot `n`: a new scene, or more scales of the scene there. If it fails, the scene there
    /// stays.
    ///
    /// # Errors
    ///
    /// If the device is too small for the scene.
    pub fn take(&mut self, step: Step, is_next_step: bool, n: usize) -> Result<(), GpuError> {
        let metadata = &step.file.metadata;
        let is_new = n == 0 && !is_next_step;
        let controls = is_new.then(|| Controls::new(&step.file.scene, metadata.views.as_ref(), &metadata.cameras));
        let settings =
            |session: &Self| RenderSettings { approximation: session.approximation, divisor: session.finest };
        let before = if is_new { RenderSettings::default() } else { settings(self) };
        // The last section of a file holds its stored settings.
        let stored = if n == 0 && step.is_whole { named_choices(&metadata.notes) } else { Vec::new() };
        let chosen = stored.into_iter().find(|(name, _)| self.quality.as_ref() == Some(name));
        let RenderSettings { approximation, divisor } = chosen.map_or(before, |(_, choice)| choice);
        let scales = step.file.scene.scales.len();
        let mut slot = SceneSlot::<P>::new(step, &self.device, &approximation)?;
        if let Some(before) = self.slots[n].as_mut().filter(|_| is_next_step) {
            slot.set_near(before.scene.frame.near);
            slot.painter.take_picture_of(&mut before.painter);
        }
        if n == 0
            && approximation != self.approximation
            && let Some(second) = &mut self.slots[1]
        {
            second.approximate(&self.device, &approximation)?;
        }
        if n == 0 {
            (self.approximation, self.finest) = (approximation, divisor);
        }
        if let Some(controls) = controls {
            self.controls = Some(controls);
            self.background = None;
            (self.seconds, self.seconds_before) = (None, None);
            self.photograph = PhotographOverlay::default();
            self.boxes.clear();
        }
        if n == 0 {
            self.boxes.resize(scales, true);
        }
        self.slots[n] = Some(slot);
        self.pace.abandoned();
        self.changed();
        Ok(())
    }

    /// Closes both scenes.
    pub fn close(&mut self) {
        (self.slots, self.is_dirty) = ([None, None], true);
    }

    /// Closes the second scene.
    pub fn close_second(&mut self) {
        self.slots[1] = None;
        self.pace.abandoned();
        self.changed();
    }

    /// Marks the displayed picture as out of date.
    pub fn changed(&mut self) {
        self.pace.changed();
        self.is_dirty = true;
    }

    /// Sets columns and rows of the place for pictures.
    pub fn resize(&mut self, size: [u32; 2]) {
        if self.size != size {
            self.size = size;
            self.changed();
        }
    }

    /// Flies, records, or follows a path for `elapsed` seconds. Returns whether the camera flies or follows a path.
    pub fn move_camera(&mut self, elapsed: f64) -> bool {
        let (Some(slot), Some(controls)) = (&self.slots[0], &mut self.controls) else { return false };
        let is_flying = controls.fly(elapsed);
        let is_moving = self.recorder.follow(elapsed, controls, &slot.scene.frame.model_from_dataset) || is_flying;
        if is_moving {
            self.changed();
        }
        is_moving
    }

    /// True if the displayed picture is as fine as the settings allow.
    pub fn is_fine_enough(&self) -> bool {
        self.pace.shown().is_some_and(|shown| shown <= self.finest)
    }

    /// True if a picture is being drawn.
    pub fn is_drawing(&self) -> bool {
        self.slots.iter().flatten().any(SceneSlot::is_drawing)
    }

    /// True if there is something to draw, to record, or to wait for.
    pub fn is_busy(&self) -> bool {
        let is_unfinished = self.slots[0].is_some() && !self.is_fine_enough();
        let is_waiting = self.slots.iter().flatten().any(|slot| !slot.painter.is_ready());
        is_unfinished || is_waiting || self.is_drawing() || self.recorder.is_recording()
    }

    /// The arrangement, if there are two scenes.
    pub fn active_comparison(&self) -> Option<Comparison> {
        self.slots.iter().all(Option::is_some).then_some(self.comparison)
    }

    /// Columns and rows of each scene's picture in a window of `size`.
    pub fn picture_size(&self, size: [u32; 2]) -> [u32; 2] {
        self.active_comparison().map_or(size, |comparison| comparison.picture_size(size))
    }

    /// Columns and rows of each scene's picture in this window.
    pub fn full_size(&self) -> [u32; 2] {
        self.picture_size(self.size)
    }

    /// Places of the scenes' pictures in `area`: left, top, right, bottom.
    pub fn places(&self, area: [f32; 4]) -> [PictureRect; 2] {
        self.active_comparison().map_or([PictureRect::of(area); 2], |comparison| comparison.places(area))
    }

    /// The camera of scene `n` for a picture of `size`.
    pub fn camera_of(&self, n: usize, size: [u32; 2]) -> Option<Camera> {
        let camera = self.controls.as_ref()?.camera(size);
        let frames = [self.slots[0].as_ref()?, self.slots[n].as_ref()?].map(|slot| &slot.scene.frame);
        Some(Comparison::camera_of_second(&camera, frames[0], frames[1]))
    }

    /// Draws until the clock is at `until`, or until there is nothing to do or the painters do not wait. Returns the
    /// pictures that were finished.
    ///
    /// # Errors
    ///
    /// If the device fails.
    pub fn draw(&mut self, until: f64) -> Result<Vec<Finished>, GpuError> {
        let mut finished = Vec::new();
        let size = self.full_size();
        let pixels = u64::from(size[0]) * u64::from(size[1]) * self.slots.iter().flatten().count() as u64;
        if self.slots[0].is_none() || pixels == 0 {
            return Ok(finished);
        }
        loop {
            if self.slots.iter().flatten().any(|slot| !slot.painter.is_ready()) {
                return Ok(finished);
            }
            self.begin_next(size, pixels)?;
            if !self.is_drawing() {
                return Ok(finished);
            }
            let Some(seconds) = self.advance(until)? else { return Ok(finished) };
            self.pace.finished();
            self.is_dirty = true;
            if let Some(camera) = self.slots[0].as_ref().and_then(|slot| slot.painter.shown()) {
                let drawn = [camera.width, camera.height];
                if drawn == size {
                    self.seconds = Some(seconds);
                }
                finished.push(Finished { size: drawn, seconds });
            }
            // If the camera has moved, the next frame sets the next picture's camera.
            if clock::now() >= until || self.pace.shown().is_none() {
                return Ok(finished);
            }
        }
    }

    /// Begins the next picture of all scenes, if one is due; at full resolution it is `size` large, of `pixels` in all
    /// scenes.
    fn begin_next(&mut self, size: [u32; 2], pixels: u64) -> Result<(), GpuError> {
        let due = self.pace.next(pixels).map(|divisor| divisor.max(self.finest));
        let Some(divisor) = due.filter(|_| !self.is_fine_enough()) else { return Ok(()) };
        let small = size.map(|v| v.div_ceil(divisor).max(1));
        for n in 0..2 {
            let camera = self.camera_of(n, small);
            if let (Some(slot), Some(camera)) = (&mut self.slots[n], camera) {
                slot.begin(&camera, self.view == View::Normals)?;
            }
        }
        self.pace.begun(divisor);
        Ok(())
    }

    /// Draws the pictures that are begun. Returns their seconds once all are finished.
    fn advance(&mut self, until: f64) -> Result<Option<f64>, GpuError> {
        let mut seconds: f64 = 0.0;
        for slot in self.slots.iter_mut().flatten().filter(|slot| slot.is_drawing()) {
            let (rays, pace) = (self.pace.rays_at_once(), &mut self.pace);
            loop {
                if let Some(taken) = slot.advance(rays, |rays, seconds| pace.measured(rays, seconds))? {
                    seconds = seconds.max(taken);
                    break;
                }
                let left = until - clock::now();
                if left <= 0.0 || !slot.painter.wait(&self.device, left)? {
                    return Ok(None);
                }
            }
        }
        Ok(Some(seconds))
    }

    /// Display settings of slot `n`; `None` if it is empty.
    pub fn show(&self, n: usize) -> Option<Show> {
        let slot = self.slots[n].as_ref()?;
        let shown = slot.painter.shown();
        let show = Show::new(&slot.scene, shown, self.view, self.background);
        let place = shown.and_then(|shown| self.photograph.place(&slot.cameras, shown)).filter(|_| n == 0);
        Some(match place {
            Some(photograph) => Show { photograph_share: self.photograph.shown_share(), photograph, ..show },
            None => show,
        })
    }

    /// Where rays begin, and the largest value to choose, in units of the dataset of the first scene; `None` without a
    /// scene.
    pub fn near(&self) -> Option<[f64; 2]> {
        let slot = self.slots[0].as_ref()?;
        Some([slot.scene.frame.near, slot.max_near()].map(|near| near / slot.scene.frame.model_from_dataset.scale))
    }

    /// Begins rays at the distance `near`, in units of the dataset. Does nothing if it is negative or not finite.
    pub fn set_near(&mut self, near: f64) {
        if near.is_finite() && near >= 0.0 {
            for slot in self.slots.iter_mut().flatten() {
                slot.set_near((near * slot.scene.frame.model_from_dataset.scale).min(slot.scene.frame.far));
            }
            self.pace.abandoned();
            self.changed();
        }
    }

    /// Moves the camera by `input`, which returns whether it has moved it.
    pub fn steer(&mut self, input: impl FnOnce(&mut Controls) -> bool) {
        if self.controls.as_mut().is_some_and(input) {
            self.changed();
        }
    }

    /// Handles a key of W3C code `code`. Returns its action, of which the caller does focus, help, panel, screenshot
    /// and paths.
    pub fn key(&mut self, code: &str, is_pressed: bool, is_modified: bool) -> Option<Action> {
        if is_pressed && self.controls.as_mut().is_some_and(|controls| controls.step(code)) {
            self.changed();
            return None;
        }
        let action = match &mut self.controls {
            Some(controls) => controls.key(code, is_pressed, is_modified),
            None => action_of(code, is_modified).filter(|_| is_pressed),
        }?;
        self.on_action(action);
        Some(action)
    }

    /// Does `action`, as if its key were pressed.
    pub fn act(&mut self, action: Action) {
        if let Some(controls) = &mut self.controls {
            controls.act(action);
        }
        self.on_action(action);
    }

    fn on_action(&mut self, action: Action) {
        match action {
            Action::NextView => self.set_view(self.view.next()),
            Action::Boxes => (self.has_boxes, self.is_dirty) = (!self.has_boxes, true),
            Action::Reset | Action::Recall(_) => self.changed(),
            Action::NextCamera | Action::PreviousCamera => {
                let count = self.slots[0].as_ref().map_or(0, |slot| slot.cameras.len());
                self.go_to_camera(self.photograph.neighbor(count, action == Action::NextCamera));
            }
            _ => {}
        }
    }

    /// True if a scene shows the background: nothing shows through a sky.
    pub fn shows_background(&self) -> bool {
        self.slots.iter().flatten().any(|slot| slot.scene.rules.sky.is_none())
    }

    /// Sets the displayed quantity.
    pub fn set_view(&mut self, view: View) {
        // Normals are only drawn for this view.
        if view == View::Normals {
            self.changed();
        }
        (self.view, self.is_dirty) = (view, true);
    }

    /// Sets the arrangement of two scenes.
    pub fn set_comparison(&mut self, comparison: Comparison) {
        let before = self.full_size();
        (self.comparison, self.is_dirty) = (comparison, true);
        if self.full_size() != before {
            self.changed();
        }
    }

    /// Moves the camera to training camera `n` of the file.
    pub fn go_to_camera(&mut self, n: usize) {
        let (Some(slot), Some(controls)) = (&self.slots[0], &mut self.controls) else { return };
        if self.photograph.go_to(n, &slot.cameras, controls) {
            self.changed();
        }
    }

    /// Blends in the photograph of the chosen training camera by `share`, from 0 to 1.
    pub fn set_photograph_share(&mut self, share: f32) {
        (self.photograph.share, self.is_dirty) = (share.clamp(0.0, 1.0), true);
        if self.photograph.camera.is_none() {
            self.go_to_camera(0);
        }
    }

    /// Sets the photograph of training camera `n`, `size` columns and rows, unless another camera is chosen by now.
    pub fn set_photograph(&mut self, n: usize, size: [u32; 2], rgba: Vec<u8>) {
        let (Some(slot), true) = (&mut self.slots[0], self.photograph.camera == Some(n)) else { return };
        slot.painter.set_photograph(size, rgba);
        (self.photograph.is_loaded, self.is_dirty) = (true, true);
    }

    /// Draws by the settings that the first scene's file stores as `name`. Returns whether there are such settings.
    ///
    /// # Errors
    ///
    /// The errors of [`Session::approximate`].
    pub fn choose(&mut self, name: &str) -> Result<bool, GpuError> {
        let Some(choice) = self.slots[0].as_ref().and_then(|slot| slot.choice(name)) else { return Ok(false) };
        self.approximate(&choice)?;
        Ok(true)
    }

    /// Draws by `settings` from now on.
    ///
    /// # Errors
    ///
    /// If the device is too small, or if the approximation is out of range.
    pub fn approximate(&mut self, settings: &RenderSettings) -> Result<(), GpuError> {
        if self.finest != settings.divisor {
            self.finest = settings.divisor;
            self.changed();
        }
        if self.approximation == settings.approximation {
            return Ok(());
        }
        for slot in self.slots.iter_mut().flatten() {
            slot.approximate(&self.device, &settings.approximation)?;
        }
        self.approximation = settings.approximation;
        self.seconds_before = self.seconds.take();
        self.pace.abandoned();
        self.changed();
        Ok(())
    }
}

//! The player of a page.

use std::cell::RefCell;
use std::rc::Rc;

use wasm_bindgen::Clamped;
use wasm_bindgen::prelude::{JsError, wasm_bindgen};
use web_sys::HtmlCanvasElement;

use super::app::{App, rgba};
use super::canvas::Canvas;
use super::download::Download;
use strivec_field::render::gpu::{Gpu, GpuError, GpuRenderer, Precision};
use strivec_field::render::{Approximation, RenderSettings};
use strivec_format::container::{Limits, decode_scene_file, sections};
use strivec_format::geometry::Camera;
use strivec_player::{Action, Comparison, Drag, Step, View, scale_count};

/// A canvas that shows one scene or two. Place 0 is the scene, place 1 the one that it is compared with.
///
/// After each call that changes something, call [`Player::frame`] until it returns false.
#[derive(Debug)]
#[wasm_bindgen]
pub struct Player {
    app: Rc<RefCell<App>>,
}

#[wasm_bindgen]
impl Player {
    /// Opens a player on `canvas` without a scene.
    ///
    /// # Errors
    ///
    /// If the browser has no WebGPU device.
    pub async fn on(canvas: HtmlCanvasElement) -> Result<Self, JsError> {
        Ok(Self { app: Rc::new(RefCell::new(App::new(Canvas::new(canvas).await?))) })
    }

    /// Opens the `.strivec` file of these bytes at `place`.
    ///
    /// # Errors
    ///
    /// If the bytes are not such a file, or if the device is too small for it; the scene at `place` then stays.
    pub fn open(&self, bytes: Vec<u8>, place: usize) -> Result<(), JsError> {
        let file = decode_scene_file(&bytes, Limits::of_file(bytes.len() as u64))?;
        let contents = sections(&bytes)?;
        drop(bytes);
        let step = Step { file, scales: scale_count(&contents), contents, is_whole: true };
        Ok(self.app.borrow_mut().session.take(step, false, place.min(1))?)
    }

    /// Shows the next step of a download at `place`; all its wanted bytes must have arrived. Returns whether it was the
    /// last.
    ///
    /// # Errors
    ///
    /// The errors of [`Player::open`].
    pub fn take(&self, download: &mut Download, place: usize) -> Result<bool, JsError> {
        let is_next_step = download.is_shown;
        let (step, is_done) = download.step()?;
        if let Some(step) = step {
            self.app.borrow_mut().session.take(step, is_next_step, place.min(1))?;
            download.is_shown = true;
        }
        Ok(is_done)
    }

    /// Closes the second scene.
    pub fn close_second(&self) {
        self.app.borrow_mut().session.close_second();
    }

    /// Sets the divider of two scenes, in parts of the width: the first is left of it, the second right. Without a
    /// divider they are side by side.
    pub fn set_divider(&self, at: Option<f32>) {
        let comparison = at.filter(|v| v.is_finite()).map_or(Comparison::SideBySide, Comparison::Slider);
        self.app.borrow_mut().session.set_comparison(comparison);
    }

    /// Moves the camera to training camera `number` of the file, from 0.
    pub fn go_to_camera(&self, number: usize) {
        self.app.borrow_mut().session.go_to_camera(number);
    }

    /// Pose of training camera `number` of the file: 16 numbers, a row-major camera-to-world matrix in the dataset's
    /// space.
    pub fn training_camera(&self, number: usize) -> Option<Vec<f64>> {
        self.app.borrow().training_camera(number)
    }

    /// Blends in the photograph by `share`, from 0 to 1, once it is set.
    pub fn set_photograph_share(&self, share: f32) {
        self.app.borrow_mut().session.set_photograph_share(share);
    }

    /// Sets the photograph of training camera `number`: red, green, blue and opacity of each pixel. Ignored if another
    /// camera was chosen since.
    ///
    /// # Errors
    ///
    /// If the number of bytes does not match the size.
    pub fn set_photograph(&self, number: usize, width: u32, height: u32, rgba: Vec<u8>) -> Result<(), JsError> {
        if rgba.is_empty() || rgba.len() as u64 != 4 * u64::from(width) * u64::from(height) {
            return Err(JsError::new(&format!(
                "photograph: {width} x {height} pixels need {} bytes, but {} were given",
                4 * u64::from(width) * u64::from(height),
                rgba.len()
            )));
        }
        self.app.borrow_mut().session.set_photograph(number, [width, height], rgba);
        Ok(())
    }

    /// Begins or ends recording the camera path. Returns whether there is a new path.
    pub fn record(&self) -> bool {
        let session = &mut self.app.borrow_mut().session;
        let is_new = session.slots[0].is_some() && session.recorder.record();
        session.move_camera(0.0);
        is_new
    }

    /// Plays the path that was recorded or opened last, or stops. Ends a recording first. Returns whether there is a
    /// new path.
    pub fn play(&self) -> bool {
        let session = &mut self.app.borrow_mut().session;
        let is_new = session.recorder.play();
        session.move_camera(0.0);
        is_new
    }

    /// The path that was recorded or opened last, as the JSON of its file.
    #[wasm_bindgen(getter)]
    pub fn path(&self) -> Option<String> {
        self.app.borrow().session.recorder.file()
    }

    /// Plays the camera path in the bytes of a file.
    ///
    /// # Errors
    ///
    /// If they are not a camera path.
    pub fn open_path(&self, bytes: &[u8]) -> Result<(), JsError> {
        let session = &mut self.app.borrow_mut().session;
        session.recorder.open(bytes)?;
        session.move_camera(0.0);
        Ok(())
    }

    /// Moves the camera, draws, and updates the canvas, which is now `width` by `height` pixels; `now` is the frame's
    /// time in milliseconds. Returns whether another frame is needed.
    ///
    /// # Errors
    ///
    /// If the device fails; the scenes are then closed.
    pub fn frame(&self, now: f64, width: u32, height: u32) -> Result<bool, JsError> {
        let has_more = self.app.borrow_mut().frame(1e-3 * now, [width, height])?;
        wait_for_device(&self.app);
        Ok(has_more)
    }

    /// A button of the pointer went down on the canvas: 0 left, 1 middle, 2 right.
    pub fn press(&self, button: u8, is_control: bool, is_shift: bool) {
        self.app.borrow_mut().dragging = match button {
            0 if is_control => Some(Drag::Look),
            0 if is_shift => Some(Drag::Pan),
            0 => Some(Drag::Orbit),
            1 | 2 => Some(Drag::Pan),
            _ => None,
        };
    }

    /// Moves the pointer, in parts of the canvas's height from its top left corner.
    pub fn point(&self, x: f64, y: f64) {
        self.app.borrow_mut().pointed([x, y]);
    }

    /// Releases the buttons.
    pub fn release(&self) {
        self.app.borrow_mut().dragging = None;
    }

    /// Turns the wheel by lines: positive is towards the scene.
    pub fn wheel(&self, lines: f64) {
        self.app.borrow_mut().session.steer(|controls| {
            controls.wheel(lines);
            true
        });
    }

    /// Moves finger `id`, in parts of the canvas's height from its top left corner.
    pub fn touch(&self, id: f64, x: f64, y: f64) {
        self.app.borrow_mut().session.steer(|controls| controls.touched(id as u64, Some([x, y])));
    }

    /// Lifts finger `id`.
    pub fn lift(&self, id: f64) {
        self.app.borrow_mut().session.steer(|controls| controls.touched(id as u64, None));
    }

    /// Handles the key of W3C code `code`, or a button like it. Returns its action, if any besides flying; the page
    /// does `"help"`, `"panel"`, `"screenshot"`, `"record"` and `"play"`.
    pub fn key(&self, code: &str, is_pressed: bool, is_modified: bool) -> Option<String> {
        let action = self.app.borrow_mut().session.key(code, is_pressed, is_modified)?;
        if action == Action::Focus {
            let app = Rc::clone(&self.app);
            wasm_bindgen_futures::spawn_local(async move { focus(&app).await });
        }
        let name = match action {
            Action::Focus => "focus",
            Action::Reset => "reset",
            Action::Recall(_) => "recall",
            Action::Keep(_) => "keep",
            Action::Help => "help",
            Action::NextView => "view",
            Action::Screenshot => "screenshot",
            Action::Record => "record",
            Action::Play => "play",
            Action::NextCamera | Action::PreviousCamera => "camera",
            Action::Boxes => "boxes",
            Action::Panel => "panel",
        };
        Some(name.to_owned())
    }

    /// Releases all keys and buttons, when the page loses the focus.
    pub fn release_keys(&self) {
        let mut app = self.app.borrow_mut();
        app.dragging = None;
        if let Some(controls) = &mut app.session.controls {
            controls.release_keys();
        }
    }

    /// Displays color, depth, opacity, normals or samples, by name.
    ///
    /// # Errors
    ///
    /// If there is no such view.
    pub fn set_view(&self, name: &str) -> Result<(), JsError> {
        let view = View::ALL.into_iter().find(|view| view.name() == name);
        let view = view.ok_or_else(|| {
            JsError::new(&format!(
                "view: there is no view {name}; choose one of {}",
                View::ALL.map(View::name).join(", ")
            ))
        })?;
        self.app.borrow_mut().session.set_view(view);
        Ok(())
    }

    /// Sets the background, sRGB from 0 to 1; the scene's own if there are not three numbers. No effect on a scene with
    /// a sky.
    pub fn set_background(&self, color: Vec<f32>) {
        self.app.borrow_mut().set_background(color.try_into().ok());
    }

    /// Shows or hides tensor boxes.
    pub fn set_boxes(&self, are_shown: bool) {
        self.app.borrow_mut().set_boxes(are_shown);
    }

    /// Shows or hides the tensor boxes of a scale.
    pub fn set_boxes_of(&self, scale: usize, are_shown: bool) {
        self.app.borrow_mut().set_boxes_of(scale, are_shown);
    }

    /// Draws with these settings from now on; an absent one is the scene's. `finest` is the least divisor of the
    /// canvas's resolution.
    ///
    /// # Errors
    ///
    /// If one of them is out of range.
    pub fn set_quality(&self, step: f64, threshold: Option<f64>, finest: u32) -> Result<(), JsError> {
        let approximation = Approximation { step_scale: step, min_weight: threshold, ..Approximation::default() };
        let settings = RenderSettings { approximation, divisor: finest.clamp(1, 16) };
        Ok(self.app.borrow_mut().session.approximate(&settings)?)
    }

    /// Draws by the settings that the file stores as `name`, one of the state's `choices`: `fast`, `balanced` or
    /// `best`. Returns whether there are such settings.
    ///
    /// # Errors
    ///
    /// If the device is too small.
    pub fn choose(&self, name: &str) -> Result<bool, JsError> {
        Ok(self.app.borrow_mut().session.choose(name)?)
    }

    /// Begins rays at the distance `near` from the camera, in units of the dataset.
    pub fn set_near(&self, near: f64) {
        self.app.borrow_mut().session.set_near(near);
    }

    /// Sets the time of a picture while the camera moves, in milliseconds.
    pub fn set_frame_time(&self, milliseconds: f64) {
        self.app.borrow_mut().session.pace.set_target(1e-3 * milliseconds);
    }

    /// Settings, facts of the file and progress, as JSON; `null` if no scene is open.
    #[wasm_bindgen(getter)]
    pub fn state(&self) -> String {
        self.app.borrow().state().to_string()
    }

    /// The camera: 16 numbers, a row-major camera-to-world matrix in the dataset's space, and the vertical angle of
    /// view in degrees. Nothing if no scene is open.
    #[wasm_bindgen(getter)]
    pub fn camera(&self) -> Option<Vec<f64>> {
        self.app.borrow().camera()
    }

    /// Sets the camera from the numbers of [`Player::camera`]; the angle may be absent.
    ///
    /// # Errors
    ///
    /// If they are not a pose.
    pub fn set_camera(&self, numbers: Vec<f64>) -> Result<(), JsError> {
        self.app.borrow_mut().set_camera(&numbers).map_err(|error| JsError::new(&format!("camera: {error}")))
    }

    /// Draws the current view in `width` by `height` pixels: 8-bit sRGB with full opacity, row-major from the top left.
    ///
    /// # Errors
    ///
    /// If no scene is open, if the picture is too large, or if the device fails.
    pub async fn screenshot(&self, width: u32, height: u32) -> Result<Clamped<Vec<u8>>, JsError> {
        let mut pictures = [None, None];
        for n in 0..2 {
            let camera = {
                let session = &self.app.borrow().session;
                session.camera_of(n, session.picture_size([width, height]))
            };
            let Some(camera) = camera else { continue };
            let gpu = self.app.borrow().canvas.gpu.clone();
            let draw = async |renderer: &mut GpuRenderer| checked(&gpu, renderer.render_async(&camera)).await;
            if let Some(picture) = with_renderer(&self.app, n, draw).await {
                pictures[n] = Some(picture?.pixels);
            }
        }
        if pictures[0].is_none() {
            return Err(no_scene());
        }
        Ok(Clamped(self.app.borrow().composed(&pictures, [width, height])))
    }

    /// Draws the picture of `strivec render`, exact and within near and far of the file: `width` by `height` pixels,
    /// from `pose` (16 numbers, as in [`Player::camera`]), with a horizontal angle of view of `degrees`.
    ///
    /// # Errors
    ///
    /// If `pose` is not a pose, if `degrees` are not from 1 to 170, and as for [`Player::screenshot`].
    pub async fn render(
        &self,
        width: u32,
        height: u32,
        pose: Vec<f64>,
        degrees: f64,
    ) -> Result<Clamped<Vec<u8>>, JsError> {
        if !(1.0..=170.0).contains(&degrees) {
            return Err(JsError::new(&format!("angle of view: {degrees} degrees; it must be from 1 to 170")));
        }
        let (mut scene, gpu) = {
            let app = self.app.borrow();
            let slot = app.session.slots[0].as_ref().ok_or_else(no_scene)?;
            let mut scene = slot.scene.clone();
            [scene.frame.near, scene.frame.far] = slot.near_far;
            (Some(scene), app.canvas.gpu.clone())
        };
        let focal = Camera::focal_of_angle(width, degrees.to_radians());
        let work = async {
            // Moved, so that the scene is freed before the picture is drawn.
            let Some(scene) = scene.take() else { return Ok(Err(no_scene())) };
            let camera = match Camera::posed(&pose, [width, height], focal) {
                Ok(camera) => camera.mapped(&scene.frame.model_from_dataset),
                Err(error) => return Ok(Err(JsError::new(&format!("pose: {error}")))),
            };
            let mut renderer = GpuRenderer::new(&gpu, scene, &Approximation::default(), Precision::default())?;
            Ok(Ok(renderer.render_async(&camera).await?))
        };
        let picture = checked(&gpu, work).await??;
        Ok(Clamped(rgba(&picture.pixels, [0.0; 3])))
    }
}

fn no_scene() -> JsError {
    JsError::new("no scene is open")
}

/// Submits the next rays as soon as the device has finished the last ones: frames come too rarely for that.
fn wait_for_device(app: &Rc<RefCell<App>>) {
    let mut borrowed = app.borrow_mut();
    if borrowed.is_waiting || !borrowed.session.is_drawing() {
        return;
    }
    borrowed.is_waiting = true;
    let idle = borrowed.canvas.idle();
    let app = Rc::clone(app);
    wasm_bindgen_futures::spawn_local(async move {
        idle.await;
        let mut borrowed = app.borrow_mut();
        borrowed.is_waiting = false;
        borrowed.draw();
        drop(borrowed);
        wait_for_device(&app);
    });
}

/// Takes scene `n`'s renderer out of the app, runs `work` on it, and puts it back. Waits while it is lent. Returns
/// `None` without such a scene.
async fn with_renderer<T>(
    app: &Rc<RefCell<App>>,
    n: usize,
    work: impl AsyncFnOnce(&mut GpuRenderer) -> T,
) -> Option<T> {
    let mut lent = loop {
        let idle = {
            let mut app = app.borrow_mut();
            app.session.slots[n].as_ref()?;
            match app.lend(n) {
                Some(lent) => break lent,
                None => app.canvas.idle(),
            }
        };
        idle.await;
    };
    let result = work(&mut lent.renderer).await;
    app.borrow_mut().take_back(n, lent);
    Some(result)
}

/// Sets the pivot under the pointer.
async fn focus(app: &Rc<RefCell<App>>) {
    let Some((camera, [x, y])) = app.borrow().pointed_at() else { return };
    let Some(ray) = camera.ray_through(x, y) else { return };
    let traced = with_renderer(app, 0, async |renderer| renderer.trace_async(&[ray]).await).await;
    let Some(Ok(pixels)) = traced else { return };
    let mut app = app.borrow_mut();
    // The sky is opaque and has no depth.
    let seen = pixels.first().filter(|p| p.opacity > 0.1 && p.depth > 0.0);
    if let (Some(pixel), Some(controls)) = (seen, &mut app.session.controls) {
        controls.focus(ray.at(f64::from(pixel.depth)));
    }
    app.session.changed();
}

/// The result of `work`, or the device's error: browsers report errors after the call that causes them.
async fn checked<T>(gpu: &Gpu, work: impl Future<Output = Result<T, GpuError>>) -> Result<T, GpuError> {
    let filters = [wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Validation];
    let mut scopes = filters.map(|filter| gpu.device().push_error_scope(filter)).into_iter().rev();
    let result = work.await;
    let mut error = None;
    for scope in &mut scopes {
        error = error.or(scope.pop().await);
    }
    match error {
        Some(error) => Err(GpuError::Device(error.to_string())),
        None => result,
    }
}

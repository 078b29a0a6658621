//! The player as a page sees it.

use std::cell::RefCell;
use std::rc::Rc;

use wasm_bindgen::Clamped;
use wasm_bindgen::prelude::{JsError, wasm_bindgen};
use web_sys::HtmlCanvasElement;

use super::app::{App, rgba};
use super::canvas::Canvas;
use super::download::Download;
use crate::container::{Limits, decode_scene_file, sections};
use crate::geometry::Camera;
use crate::player::{Action, Comparison, Drag, Step, View, scale_count};
use crate::render::Approximation;
use crate::render::gpu::{Gpu, GpuError, GpuRenderer, Precision};

/// A canvas that shows a scene, or two: where a place is asked for, 0 is the first scene and 1 the one that it is compared with.
///
/// After every call that changes something, ask for frames until [`Player::frame`] says that none is needed.
#[wasm_bindgen]
pub struct Player {
    app: Rc<RefCell<App>>,
}

#[wasm_bindgen]
impl Player {
    /// A player on `canvas`, on the browser's best device, without a scene.
    ///
    /// # Errors
    ///
    /// Where there is no device.
    pub async fn on(canvas: HtmlCanvasElement) -> Result<Self, JsError> {
        Ok(Self { app: Rc::new(RefCell::new(App::new(Canvas::new(canvas).await?))) })
    }

    /// Opens the `.strivec` file of these bytes in place of what is shown at `place`.
    ///
    /// # Errors
    ///
    /// Where the bytes are no such file, and where the device is too small for it; what is shown then stays.
    pub fn open(&self, bytes: Vec<u8>, place: usize) -> Result<(), JsError> {
        let document = decode_scene_file(&bytes, Limits::default())?;
        let contents = sections(&bytes)?;
        drop(bytes);
        let step = Step { document, scales: scale_count(&contents), contents, is_whole: true };
        Ok(self.app.borrow_mut().take(step, false, place.min(1))?)
    }

    /// Shows at `place` what has arrived of a file, whose wanted bytes must all be there. Whether that is all of it.
    ///
    /// # Errors
    ///
    /// As [`Player::open`]'s.
    pub fn take(&self, download: &mut Download, place: usize) -> Result<bool, JsError> {
        let is_more_of_the_same = download.is_shown;
        let (step, is_done) = download.step()?;
        if let Some(step) = step {
            self.app.borrow_mut().take(step, is_more_of_the_same, place.min(1))?;
            download.is_shown = true;
        }
        Ok(is_done)
    }

    /// Closes the second scene.
    pub fn close_second(&self) {
        self.app.borrow_mut().close_second();
    }

    /// Shows the first scene left of this part of the width and the second right of it; where it is absent, each in a half of
    /// the canvas.
    pub fn set_divider(&self, at: Option<f32>) {
        let comparison = at.filter(|v| v.is_finite()).map_or(Comparison::SideBySide, Comparison::Slider);
        self.app.borrow_mut().set_comparison(comparison);
    }

    /// Puts the camera where training camera `number` of the file was, from 0.
    pub fn go_to_camera(&self, number: usize) {
        self.app.borrow_mut().go_to_camera(number);
    }

    /// Where training camera `number` of the file was: 16 numbers, a row-major camera-to-world matrix in the dataset's space.
    pub fn training_camera(&self, number: usize) -> Option<Vec<f64>> {
        self.app.borrow().training_camera(number)
    }

    /// Shows this much of the photograph, from 0 to 1, once there is one.
    pub fn set_photograph_share(&self, share: f32) {
        self.app.borrow_mut().set_photograph_share(share);
    }

    /// Takes the photograph of training camera `number`: red, green, blue and opacity of each pixel. Where another camera was
    /// gone to since, it is too late.
    ///
    /// # Errors
    ///
    /// Where the bytes are not those of so many pixels.
    pub fn set_photograph(&self, number: usize, width: u32, height: u32, rgba: Vec<u8>) -> Result<(), JsError> {
        if rgba.is_empty() || rgba.len() as u64 != 4 * u64::from(width) * u64::from(height) {
            return Err(JsError::new(&format!(
                "photograph: expected {width} x {height} pixels, found {} bytes",
                rgba.len()
            )));
        }
        self.app.borrow_mut().set_photograph(number, [width, height], &rgba);
        Ok(())
    }

    /// Begins to record the camera's path, or ends that: then whether there is a new path.
    pub fn record(&self) -> bool {
        let app = &mut *self.app.borrow_mut();
        let is_new = app.slots[0].is_some() && app.recorder.record();
        app.move_camera(0.0);
        is_new
    }

    /// Plays the path that was recorded or opened last, or stops. Where one is being recorded, that ends first: then whether
    /// there is a new path.
    pub fn play(&self) -> bool {
        let app = &mut *self.app.borrow_mut();
        let is_new = app.recorder.play();
        app.move_camera(0.0);
        is_new
    }

    /// The file of that path, if there is one.
    #[wasm_bindgen(getter)]
    pub fn path(&self) -> Option<String> {
        self.app.borrow().recorder.file()
    }

    /// Plays the path of this file's bytes.
    ///
    /// # Errors
    ///
    /// Where they are no camera path.
    pub fn open_path(&self, bytes: &[u8]) -> Result<(), JsError> {
        let app = &mut *self.app.borrow_mut();
        app.recorder.open(bytes)?;
        app.move_camera(0.0);
        Ok(())
    }

    /// Moves the camera, draws, and shows what is drawn on the canvas, which is now `width` by `height` pixels large; `now` is
    /// the frame's time in milliseconds. Whether another frame is needed.
    ///
    /// # Errors
    ///
    /// Where the device fails; the scene is then closed.
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

    /// The pointer is now there, in parts of the canvas's height from its corner.
    pub fn point(&self, x: f64, y: f64) {
        self.app.borrow_mut().pointed([x, y]);
    }

    /// No button is down.
    pub fn release(&self) {
        self.app.borrow_mut().dragging = None;
    }

    /// Turns around the scene, as a drag by these parts of the canvas's height would.
    pub fn turn(&self, right: f64, down: f64) {
        self.app.borrow_mut().steer(|controls| {
            controls.dragged([right, down], Drag::Orbit);
            true
        });
    }

    /// A wheel's turn in lines: positive is towards the scene.
    pub fn wheel(&self, lines: f64) {
        self.app.borrow_mut().steer(|controls| {
            controls.wheel(lines);
            true
        });
    }

    /// Finger `id` is there, in parts of the canvas's height from its corner.
    pub fn touch(&self, id: f64, x: f64, y: f64) {
        self.app.borrow_mut().steer(|controls| controls.touched(id as u64, Some([x, y])));
    }

    /// Finger `id` is gone.
    pub fn lift(&self, id: f64) {
        self.app.borrow_mut().steer(|controls| controls.touched(id as u64, None));
    }

    /// The key of W3C code `code` went down or up, or a button like it was clicked. Says what it asks for, if for anything
    /// besides flying; `"help"`, `"panel"`, `"screenshot"`, `"record"` and `"play"` are for the page to do.
    pub fn key(&self, code: &str, is_pressed: bool, is_modified: bool) -> Option<String> {
        let action = self.app.borrow_mut().key(code, is_pressed, is_modified)?;
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
            Action::NextCamera | Action::CameraBefore => "camera",
            Action::Boxes => "boxes",
            Action::Panel => "panel",
        };
        Some(name.to_owned())
    }

    /// All keys are up, and no finger or button is down: the page has lost them.
    pub fn release_keys(&self) {
        let mut app = self.app.borrow_mut();
        app.dragging = None;
        if let Some(controls) = &mut app.controls {
            controls.release_keys();
        }
    }

    /// Shows color, depth, opacity, normals or samples, by name.
    ///
    /// # Errors
    ///
    /// Where there is no such view.
    pub fn set_view(&self, name: &str) -> Result<(), JsError> {
        let view = View::ALL.into_iter().find(|view| view.name() == name);
        let view = view.ok_or_else(|| JsError::new(&format!("view: expected one of the state's, found {name}")))?;
        self.app.borrow_mut().set_view(view);
        Ok(())
    }

    /// Shows the scene on this background, sRGB from 0 to 1; on its own one where there are not three numbers.
    pub fn set_background(&self, color: Vec<f32>) {
        self.app.borrow_mut().set_background(color.try_into().ok());
    }

    /// Shows tensor boxes, or hides them.
    pub fn set_boxes(&self, are_shown: bool) {
        self.app.borrow_mut().set_boxes(are_shown);
    }

    /// Shows boxes of this scale, or hides them.
    pub fn set_boxes_of(&self, scale: usize, are_shown: bool) {
        self.app.borrow_mut().set_boxes_of(scale, are_shown);
    }

    /// Draws with these settings from now on; where one is absent, as the scene says. Pictures get no finer than `finest`
    /// times smaller than the canvas.
    ///
    /// # Errors
    ///
    /// Where one of them is out of range.
    pub fn set_quality(
        &self,
        neighbors: Option<u32>,
        scales: Option<u32>,
        step: f64,
        threshold: Option<f64>,
        finest: u32,
    ) -> Result<(), JsError> {
        let exact = Approximation::default();
        let approximation = Approximation { neighbors, scales, step_scale: step, min_weight: threshold, ..exact };
        Ok(self.app.borrow_mut().approximate(&approximation, finest.clamp(1, 16))?)
    }

    /// Draws from now on as the file names it, for which see `choices` of the state: as `fast`, `balanced` or `best`. Whether it
    /// does.
    ///
    /// # Errors
    ///
    /// Where the device is too small.
    pub fn choose(&self, name: &str) -> Result<bool, JsError> {
        Ok(self.app.borrow_mut().choose(name)?)
    }

    /// Milliseconds that a picture may take while the camera moves.
    pub fn set_frame_time(&self, milliseconds: f64) {
        self.app.borrow_mut().set_frame_time(1e-3 * milliseconds);
    }

    /// The settings, what is known of the file and how drawing goes, as JSON; `null` where no scene is open.
    #[wasm_bindgen(getter)]
    pub fn state(&self) -> String {
        self.app.borrow().state().to_string()
    }

    /// Where the camera is: 16 numbers, a row-major camera-to-world matrix in the dataset's space, and the degrees that the
    /// picture spans from top to bottom. Nothing where no scene is open.
    #[wasm_bindgen(getter)]
    pub fn camera(&self) -> Option<Vec<f64>> {
        self.app.borrow().camera()
    }

    /// Puts the camera where `numbers` say, as [`Player::camera`] has them; the degrees may be absent.
    ///
    /// # Errors
    ///
    /// Where they are no pose.
    pub fn set_camera(&self, numbers: Vec<f64>) -> Result<(), JsError> {
        self.app.borrow_mut().set_camera(&numbers).map_err(|error| JsError::new(&format!("camera: {error}")))
    }

    /// What is seen now, as a picture of `width` by `height` pixels: 8-bit sRGB with full opacity, row-major from the top left.
    ///
    /// # Errors
    ///
    /// Where no scene is open, where the picture is too large, and where the device fails.
    pub async fn screenshot(&self, width: u32, height: u32) -> Result<Clamped<Vec<u8>>, JsError> {
        let mut pictures = [None, None];
        for n in 0..2 {
            let Some(camera) = self.app.borrow().camera_of(n, [width, height]) else { continue };
            let gpu = self.app.borrow().canvas.gpu.clone();
            let draw = async |renderer: &mut GpuRenderer| complaints_of(&gpu, renderer.render_async(&camera)).await;
            if let Some(picture) = with_renderer(&self.app, n, draw).await {
                pictures[n] = Some(picture?.pixels);
            }
        }
        if pictures[0].is_none() {
            return Err(no_scene());
        }
        Ok(Clamped(self.app.borrow().composed(&pictures, [width, height])))
    }

    /// The picture that `strivec render` makes of the scene, exact and with rays that begin and end where the scene says: of
    /// `width` by `height` pixels, from `pose` (16 numbers, as in [`Player::camera`]), `degrees` from left to right.
    ///
    /// # Errors
    ///
    /// Where `pose` is none or `degrees` are not between 1 and 170, and as for [`Player::screenshot`].
    pub async fn render(
        &self,
        width: u32,
        height: u32,
        pose: Vec<f64>,
        degrees: f64,
    ) -> Result<Clamped<Vec<u8>>, JsError> {
        if !(1.0..=170.0).contains(&degrees) {
            return Err(JsError::new(&format!("angle of view: expected 1 to 170 degrees, found {degrees}")));
        }
        let (mut scene, gpu) = {
            let app = self.app.borrow();
            let slot = app.slots[0].as_ref().ok_or_else(no_scene)?;
            let mut scene = slot.scene.clone();
            [scene.frame.near, scene.frame.far] = slot.near_far;
            (Some(scene), app.canvas.gpu.clone())
        };
        let focal = Camera::focal_of_angle(width, degrees.to_radians());
        let work = async {
            // Taken out: the renderer need not lie beside what it was made from.
            let Some(scene) = scene.take() else { return Ok(Err(no_scene())) };
            let camera = match Camera::posed(&pose, [width, height], focal) {
                Ok(camera) => camera.mapped(&scene.frame.model_from_dataset),
                Err(error) => return Ok(Err(JsError::new(&format!("pose: {error}")))),
            };
            let mut renderer = GpuRenderer::new(&gpu, scene, &Approximation::default(), Precision::default())?;
            Ok(Ok(renderer.render_async(&camera).await?))
        };
        let picture = complaints_of(&gpu, work).await??;
        Ok(Clamped(rgba(&picture.pixels, [0.0; 3])))
    }
}

fn no_scene() -> JsError {
    JsError::new("no scene is open")
}

/// Has the next rays be drawn as soon as the device is done with the last ones: frames come too rarely for that.
fn wait_for_device(app: &Rc<RefCell<App>>) {
    let mut borrowed = app.borrow_mut();
    if borrowed.is_waiting || !borrowed.is_drawing() {
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

/// What `work` makes of scene `n`'s renderer, which the app has to do without for as long; `None` where there is no such scene. Waits for
/// whoever has it now.
async fn with_renderer<T>(
    app: &Rc<RefCell<App>>,
    n: usize,
    work: impl AsyncFnOnce(&mut GpuRenderer) -> T,
) -> Option<T> {
    let (mut renderer, number) = loop {
        let idle = {
            let mut app = app.borrow_mut();
            app.slots[n].as_ref()?;
            match app.lend(n) {
                Some(lent) => break lent,
                None => app.canvas.idle(),
            }
        };
        idle.await;
    };
    let result = work(&mut renderer).await;
    app.borrow_mut().take_back(renderer, n, number);
    Some(result)
}

/// Turns around what is under the pointer from now on.
async fn focus(app: &Rc<RefCell<App>>) {
    let Some((camera, [x, y])) = app.borrow().pointed_at() else { return };
    let ray = camera.ray_through(x, y);
    let traced = with_renderer(app, 0, async |renderer| renderer.trace_async(&[ray]).await).await;
    let Some(Ok(pixels)) = traced else { return };
    let mut app = app.borrow_mut();
    if let (Some(pixel), Some(controls)) = (pixels.first().filter(|p| p.opacity > 0.1), &mut app.controls) {
        controls.focus(ray.at(f64::from(pixel.depth)));
    }
    app.changed();
}

/// What `work` comes to, or else what the device says against it: browsers refuse what they were asked for later than the
/// asking.
async fn complaints_of<T>(gpu: &Gpu, work: impl Future<Output = Result<T, GpuError>>) -> Result<T, GpuError> {
    let filters = [wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Validation];
    let mut scopes = filters.map(|filter| gpu.device().push_error_scope(filter)).into_iter().rev();
    let result = work.await;
    let mut complaint = None;
    for scope in &mut scopes {
        complaint = complaint.or(scope.pop().await);
    }
    match complaint {
        Some(complaint) => Err(GpuError::Device(complaint.to_string())),
        None => result,
    }
}

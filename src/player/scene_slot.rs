//! An open scene, and the picture of it that is being drawn.

use super::first_view::extent;
use super::{Fact, Step, clock, facts, named_choices, scale_count};
use strivec_field::render::gpu::GpuError;
use strivec_field::render::{Approximation, RenderSettings, Turntable};
use strivec_format::container::{SceneFile, TrainingCamera};
use strivec_format::geometry::Camera;
use strivec_format::model::Scene;

/// Draws one scene and keeps its last finished picture. Implemented by the desktop player and by the page.
pub trait Painter: Sized {
    /// The device that it draws on.
    type Device;

    /// Prepares `scene` for drawing.
    ///
    /// # Errors
    ///
    /// If the device is too small for the scene, or if the approximation is out of range.
    fn new(device: &Self::Device, scene: &Scene, approximation: &Approximation) -> Result<Self, GpuError>;

    /// Draws with `approximation` from now on. The finished picture stays.
    ///
    /// # Errors
    ///
    /// The errors of [`Painter::new`].
    fn approximate(
        &mut self,
        device: &Self::Device,
        scene: &Scene,
        approximation: &Approximation,
    ) -> Result<(), GpuError>;

    /// Begins rays at the distance `near`, in model units, from the next picture on.
    fn set_near(&mut self, near: f64);

    /// True if it can draw now.
    fn is_ready(&self) -> bool {
        true
    }

    /// Begins the picture that `camera` takes, in place of an unfinished one.
    ///
    /// # Errors
    ///
    /// If the device fails.
    fn begin(&mut self, camera: &Camera, has_normals: bool) -> Result<(), GpuError>;

    /// Submits at most `most_rays` more rays. Returns the number of finished rays, `None` if all are finished.
    ///
    /// # Errors
    ///
    /// If the device fails.
    fn advance(&mut self, most_rays: u32) -> Result<Option<u32>, GpuError>;

    /// Waits at most `seconds` for progress. Returns whether to call [`Painter::advance`] again now.
    ///
    /// # Errors
    ///
    /// If the device fails.
    fn wait(&self, device: &Self::Device, seconds: f64) -> Result<bool, GpuError>;

    /// Keeps the picture that is finished now, which `camera` took, for display.
    fn keep(&mut self, camera: &Camera);

    /// The camera of the displayed picture.
    fn shown(&self) -> Option<&Camera>;

    /// Displays the picture of `before` until there is a new one.
    fn take_picture_of(&mut self, before: &mut Self);

    /// Sets the photograph to blend with the picture: `size` columns and rows, `rgba` row-major.
    fn set_photograph(&mut self, size: [u32; 2], rgba: Vec<u8>);
}

/// An open scene.
#[derive(Debug)]
pub struct SceneSlot<P> {
    /// The file's scene. Far is extended, as the camera of a player may be anywhere. Near is the chosen one.
    pub scene: Scene,
    /// Near and far of the file.
    pub near_far: [f64; 2],
    /// Number of scales in the file.
    pub all_scales: usize,
    /// Number of scales that have arrived.
    pub scales: usize,
    /// True if all scales have arrived.
    pub is_whole: bool,
    /// Contents of the file, for the panel.
    pub facts: Vec<Fact>,
    /// Training cameras, in the model's space.
    pub cameras: Vec<TrainingCamera>,
    /// Render settings that are stored in the file, by name.
    pub choices: Vec<(String, RenderSettings)>,
    /// Draws the scene.
    pub painter: P,
    /// The camera of the picture that is being drawn.
    drawing: Option<Camera>,
    /// When that picture was begun, in seconds of the clock.
    begun: f64,
    /// Finished rays of that picture.
    done: u32,
    /// When the rays after those were submitted; `None` before the first.
    done_at: Option<f64>,
}

impl<P: Painter> SceneSlot<P> {
    /// Prepares a step of a file for drawing on `device`.
    ///
    /// # Errors
    ///
    /// The errors of [`Painter::new`].
    pub fn new(step: Step, device: &P::Device, approximation: &Approximation) -> Result<Self, GpuError> {
        let Step { file, contents, scales, is_whole } = step;
        let facts = facts(&file, &contents, contents.file_length);
        let SceneFile { mut scene, metadata, .. } = file;
        let near_far = [scene.frame.near, scene.frame.far];
        // No photograph shows what is before near. A camera that is outside of the bounds may come as near as it likes;
        // one that is within the scene would see what is left there.
        if Turntable::of(&scene, metadata.views.as_ref(), &metadata.cameras).is_none() {
            scene.frame.near = 0.0;
        }
        scene.frame.far = scene.frame.far.max(1e4 * scene.bounds.size().max_element());
        let painter = P::new(device, &scene, approximation)?;
        Ok(Self {
            scene,
            near_far,
            all_scales: scale_count(&contents),
            scales,
            is_whole,
            facts,
            cameras: metadata.cameras,
            choices: named_choices(&metadata.notes),
            painter,
            drawing: None,
            begun: 0.0,
            done: 0,
            done_at: None,
        })
    }

    /// The stored settings called `name`.
    pub fn choice(&self, name: &str) -> Option<RenderSettings> {
        self.choices.iter().find(|(of, _)| of == name).map(|(_, choice)| *choice)
    }

    /// Draws with `approximation` from now on.
    ///
    /// # Errors
    ///
    /// The errors of [`Painter::approximate`].
    pub fn approximate(&mut self, device: &P::Device, approximation: &Approximation) -> Result<(), GpuError> {
        self.painter.approximate(device, &self.scene, approximation)?;
        self.drawing = None;
        Ok(())
    }

    /// Begins rays at the distance `near`, in model units, from the next picture on.
    pub fn set_near(&mut self, near: f64) {
        self.scene.frame.near = near;
        self.painter.set_near(near);
        self.drawing = None;
    }

    /// The largest value of near to choose, in model units.
    pub fn max_near(&self) -> f64 {
        (2.0 * self.near_far[0]).max(0.5 * extent(&self.scene))
    }

    /// Begins the picture that `camera` takes, in place of an unfinished one. Does nothing while the painter is not
    /// ready.
    ///
    /// # Errors
    ///
    /// If the device fails.
    pub fn begin(&mut self, camera: &Camera, has_normals: bool) -> Result<(), GpuError> {
        if self.painter.is_ready() {
            self.painter.begin(camera, has_normals)?;
            self.drawing = Some(*camera);
            (self.begun, self.done, self.done_at) = (clock::now(), 0, None);
        }
        Ok(())
    }

    /// True if a picture is being drawn.
    pub fn is_drawing(&self) -> bool {
        self.drawing.is_some()
    }

    /// Discards the picture that is being drawn.
    pub fn stop(&mut self) {
        self.drawing = None;
    }

    /// Submits at most `most_rays` more rays; calls `measured` with the number and the seconds of finished rays.
    /// Returns the seconds since the picture was begun, once it is finished. Never waits.
    ///
    /// # Errors
    ///
    /// If the device fails.
    pub fn advance(&mut self, most_rays: u32, measured: impl FnOnce(u32, f64)) -> Result<Option<f64>, GpuError> {
        let Some(camera) = self.drawing.filter(|_| self.painter.is_ready()) else { return Ok(None) };
        // The second of two scenes waits for the first: its rays begin now.
        let done_at = *self.done_at.get_or_insert_with(clock::now);
        let rays = camera.width * camera.height;
        let done = self.painter.advance(most_rays)?;
        let (now, now_done) = (clock::now(), done.unwrap_or(rays).min(rays));
        if now_done > self.done {
            measured(now_done - self.done, now - done_at);
            (self.done, self.done_at) = (now_done, Some(now));
        }
        if done.is_some() {
            return Ok(None);
        }
        self.painter.keep(&camera);
        self.drawing = None;
        Ok(Some(now - self.begun))
    }
}

//! A scene that is open, and what draws it.

use super::clock;
use crate::container::{Prefix, SceneFile, TrainingCamera};
use crate::geometry::Camera;
use crate::model::Scene;
use crate::player::{BoxLines, Fact, Screen, Step, adapted, facts, named_choices, scale_count};
use crate::render::gpu::{Drawing, Gpu, GpuError, GpuRenderer, Precision};
use crate::render::{Approximation, RenderSettings};

/// A scene that is open.
pub(super) struct SceneSlot {
    /// As the file has it, but for where rays begin and end.
    pub(super) scene: Scene,
    /// Those of the file.
    pub(super) near_far: [f64; 2],
    /// Scales of the file, and those that are there.
    pub(super) all_scales: usize,
    pub(super) scales: usize,
    pub(super) is_whole: bool,
    pub(super) facts: Vec<Fact>,
    /// Those that the scene was trained from, as far as the file tells.
    pub(super) cameras: Vec<TrainingCamera>,
    /// What it names.
    pub(super) choices: Vec<(String, RenderSettings)>,
    prefixes: Vec<Option<Prefix>>,
    pub(super) screen: Screen,
    pub(super) boxes: BoxLines,
    /// Absent while it is lent: to something that waits for the device.
    pub(super) renderer: Option<GpuRenderer>,
    /// The camera of the picture that is being drawn.
    drawing: Option<Camera>,
    begun: f64,
    /// Rays that are done, and since when the device is at the next; absent before the first.
    done: u32,
    done_at: Option<f64>,
}

impl SceneSlot {
    /// Prepares what has arrived to be drawn on `gpu`, on a surface of `format`.
    pub(super) fn new(
        gpu: &Gpu,
        format: wgpu::TextureFormat,
        step: Step,
        approximation: &Approximation,
    ) -> Result<Self, GpuError> {
        let Step { document, contents, scales, is_whole } = step;
        let facts = facts(&document, &contents, contents.file_length);
        let SceneFile { mut scene, metadata } = document;
        let near_far = [scene.frame.near, scene.frame.far];
        // A viewer goes where no photograph was taken from; the bounds say where the scene is.
        scene.frame.near = 0.0;
        scene.frame.far = scene.frame.far.max(1e4 * scene.bounds.size().max_element());
        let renderer = renderer(gpu, &scene, &metadata.prefixes, approximation)?;
        let (screen, boxes) = (Screen::new(gpu, format), BoxLines::new(gpu, &scene, format));
        Ok(Self {
            scene,
            near_far,
            all_scales: scale_count(&contents),
            scales,
            is_whole,
            facts,
            cameras: metadata.cameras,
            choices: named_choices(&metadata.notes),
            prefixes: metadata.prefixes,
            screen,
            boxes,
            renderer: Some(renderer),
            drawing: None,
            begun: 0.0,
            done: 0,
            done_at: None,
        })
    }

    /// Draws with `approximation` from now on.
    pub(super) fn approximate(&mut self, gpu: &Gpu, approximation: &Approximation) -> Result<(), GpuError> {
        self.renderer = Some(renderer(gpu, &self.scene, &self.prefixes, approximation)?);
        self.drawing = None;
        Ok(())
    }

    /// Begins the picture that `camera` takes, in place of any that is unfinished.
    pub(super) fn begin(&mut self, camera: &Camera, has_normals: bool) -> Result<(), GpuError> {
        let Some(renderer) = &mut self.renderer else { return Ok(()) };
        renderer.set_normals(has_normals);
        renderer.begin(camera)?;
        self.drawing = Some(*camera);
        (self.begun, self.done, self.done_at) = (clock::now(), 0, None);
        Ok(())
    }

    /// Whether a picture is being drawn.
    pub(super) fn is_drawing(&self) -> bool {
        self.drawing.is_some()
    }

    /// Looks how far the device is, and gives it at most `most_rays` rays more; calls `measured` with rays and seconds of each
    /// batch. Returns the seconds that the picture took, once it is whole. Never waits.
    pub(super) fn advance(
        &mut self,
        most_rays: u32,
        mut measured: impl FnMut(u32, f64),
    ) -> Result<Option<f64>, GpuError> {
        let (Some(camera), Some(renderer)) = (self.drawing, &mut self.renderer) else { return Ok(None) };
        let done_at = *self.done_at.get_or_insert_with(clock::now);
        let rays = camera.width * camera.height;
        let (now_done, is_finished) = match renderer.advance(most_rays)? {
            Drawing::Unfinished { done, .. } => (done.min(rays), false),
            Drawing::Finished => (rays, true),
        };
        let now = clock::now();
        if now_done > self.done {
            measured(now_done - self.done, now - done_at);
            (self.done, self.done_at) = (now_done, Some(now));
        }
        if !is_finished {
            return Ok(None);
        }
        self.screen.keep(renderer, &camera);
        self.drawing = None;
        Ok(Some(now - self.begun))
    }

    /// Forgets the picture that is being drawn.
    pub(super) fn stop(&mut self) {
        self.drawing = None;
    }

    /// The most neighbors that a scale asks for.
    pub(super) fn most_neighbors(&self) -> u32 {
        self.scene.scales.iter().map(|s| s.top_k).max().unwrap_or(1)
    }
}

/// What draws `scene` on `gpu`.
fn renderer(
    gpu: &Gpu,
    scene: &Scene,
    prefixes: &[Option<Prefix>],
    approximation: &Approximation,
) -> Result<GpuRenderer, GpuError> {
    let (drawn, approximation) = adapted(scene, prefixes, approximation, false);
    GpuRenderer::new(gpu, drawn, &approximation, Precision::default())
}

//! A scene that is open, and what draws it.

use std::time::{Duration, Instant};

use super::opening::Opened;
use crate::container::Prefix;
use crate::geometry::{Camera, Ray};
use crate::model::Scene;
use crate::player::{BoxLines, Fact, Screen, adapted, facts, named_choices};
use crate::render::gpu::{Drawing, Gpu, GpuError, GpuRenderer, Precision};
use crate::render::{Approximation, CpuRenderer, Pixel, RenderSettings, Renderer, TraceInfo};

/// What there is to draw with.
#[derive(Clone)]
pub(super) struct Device {
    /// What the window is painted on, and its surface's format; memory where there is none.
    pub(super) gpu: Option<(Gpu, wgpu::TextureFormat)>,
    /// Whether pictures are drawn on it, too.
    pub(super) draws: bool,
    pub(super) precision: Precision,
}

impl Device {
    /// What draws pictures, for people.
    pub(super) fn name(&self) -> String {
        match &self.gpu {
            Some((gpu, _)) if self.draws => gpu.info().name.clone(),
            Some((gpu, _)) => format!("processor, on a window of {}", gpu.info().name),
            None => "processor, without a graphics device".to_owned(),
        }
    }
}

/// What draws a scene, and what shows it.
pub(super) struct Painter {
    pub(super) artist: Artist,
    /// Absent where the window is painted in memory.
    pub(super) screen: Option<(Screen, BoxLines)>,
    /// There, the photograph that is seen through the picture.
    pub(super) photograph: Option<Photograph>,
}

/// A photograph in memory.
pub(super) struct Photograph {
    /// Columns and rows.
    pub(super) size: [u32; 2],
    /// \[row\]\[column\] red, green, blue, opacity.
    pub(super) rgba: Vec<u8>,
}

/// What draws a scene.
pub(super) enum Artist {
    Gpu(Box<GpuRenderer>),
    Cpu(Box<CpuPainter>),
}

/// Pictures by the CPU, some rays at a time.
pub(super) struct CpuPainter {
    renderer: CpuRenderer,
    camera: Option<Camera>,
    has_normals: bool,
    looks: Vec<TraceInfo>,
    /// The last one that was finished.
    pub(super) kept: Option<(Camera, Vec<TraceInfo>)>,
}

/// A scene that is open.
pub(super) struct SceneSlot {
    /// As the file has it, but for where rays begin and end.
    pub(super) scene: Scene,
    pub(super) opened: Opened,
    pub(super) facts: Vec<Fact>,
    /// What the file names.
    pub(super) choices: Vec<(String, RenderSettings)>,
    pub(super) painter: Painter,
    /// The camera of the picture that is being drawn.
    drawing: Option<Camera>,
    begun: Instant,
    /// Rays that are done, and since when the next are being drawn; absent before the first.
    done: u32,
    done_at: Option<Instant>,
}

impl SceneSlot {
    /// Prepares `opened` to be drawn on `device` with `approximation`.
    pub(super) fn new(opened: Opened, device: &Device, approximation: &Approximation) -> Result<Self, String> {
        let mut scene = opened.document.scene.clone();
        // A viewer goes where no photograph was taken from; the bounds say where the scene is.
        scene.frame.near = 0.0;
        scene.frame.far = scene.frame.far.max(1e4 * scene.bounds.size().max_element());
        let painter = Painter::new(&scene, &opened.document.metadata.prefixes, device, approximation)?;
        let facts = facts(&opened.document, &opened.contents, opened.contents.file_length);
        let choices = named_choices(&opened.document.metadata.notes);
        Ok(Self {
            scene,
            opened,
            facts,
            choices,
            painter,
            drawing: None,
            begun: Instant::now(),
            done: 0,
            done_at: None,
        })
    }

    /// Draws with `approximation` from now on.
    pub(super) fn approximate(&mut self, device: &Device, approximation: &Approximation) -> Result<(), String> {
        let prefixes = &self.opened.document.metadata.prefixes;
        let mut painter = Painter::new(&self.scene, prefixes, device, approximation)?;
        painter.take_picture_of(&mut self.painter);
        (self.painter, self.drawing) = (painter, None);
        Ok(())
    }

    /// Begins the picture that `camera` takes, in place of any that is unfinished.
    pub(super) fn begin(&mut self, camera: &Camera, has_normals: bool) -> Result<(), GpuError> {
        match &mut self.painter.artist {
            Artist::Gpu(renderer) => {
                renderer.set_normals(has_normals);
                renderer.begin(camera)?;
            }
            Artist::Cpu(painter) => painter.begin(camera, has_normals),
        }
        self.drawing = Some(*camera);
        (self.begun, self.done, self.done_at) = (Instant::now(), 0, None);
        Ok(())
    }

    /// Whether a picture is being drawn.
    pub(super) fn is_drawing(&self) -> bool {
        self.drawing.is_some()
    }

    /// Draws until `until`, `most_rays` rays at a time; calls `measured` with rays and seconds of each batch. Returns the
    /// seconds that the picture took, once it is whole.
    pub(super) fn draw(
        &mut self,
        device: &Device,
        most_rays: u32,
        until: Instant,
        mut measured: impl FnMut(u32, f64),
    ) -> Result<Option<f64>, GpuError> {
        let Some(camera) = self.drawing else { return Ok(None) };
        loop {
            // The second of two scenes waits for the first.
            let done_at = *self.done_at.get_or_insert_with(Instant::now);
            let now_done = match &mut self.painter.artist {
                Artist::Gpu(renderer) => match renderer.advance(most_rays)? {
                    Drawing::Unfinished { done, .. } => done,
                    Drawing::Finished => u32::MAX,
                },
                Artist::Cpu(painter) => painter.advance(most_rays as usize),
            };
            let rays = camera.width * camera.height;
            let new = now_done.min(rays).saturating_sub(self.done);
            if new > 0 {
                measured(new, done_at.elapsed().as_secs_f64());
                (self.done, self.done_at) = (now_done.min(rays), Some(Instant::now()));
            }
            if now_done == u32::MAX {
                self.painter.keep(&camera);
                self.drawing = None;
                return Ok(Some(self.begun.elapsed().as_secs_f64()));
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            if let (Artist::Gpu(_), Some((gpu, _))) = (&self.painter.artist, &device.gpu) {
                gpu.wait_for(left.max(Duration::from_millis(1)))?;
            }
        }
    }

    /// The camera of the picture that is shown.
    pub(super) fn shown(&self) -> Option<&Camera> {
        match (&self.painter.screen, &self.painter.artist) {
            (Some((screen, _)), _) => screen.camera(),
            (None, Artist::Cpu(painter)) => painter.kept.as_ref().map(|(camera, _)| camera),
            (None, Artist::Gpu(_)) => None,
        }
    }

    /// What the ray through a place of the window sees, `at` in parts of the window's width and height: a point in the
    /// model's space.
    pub(super) fn point_at(&mut self, camera: &Camera, at: [f64; 2]) -> Option<glam::DVec3> {
        let ray = camera.ray_through(at[0] * f64::from(camera.width), at[1] * f64::from(camera.height));
        let pixel = match &mut self.painter.artist {
            Artist::Gpu(renderer) => renderer.trace(&[ray]).ok()?.first().copied(),
            Artist::Cpu(painter) => painter.renderer.trace(&[ray]).first().copied(),
        }?;
        (pixel.opacity > 0.1).then(|| ray.at(f64::from(pixel.depth)))
    }

    /// A whole picture, waited for.
    pub(super) fn picture(&mut self, camera: &Camera) -> Result<Vec<Pixel>, GpuError> {
        self.drawing = None;
        match &mut self.painter.artist {
            Artist::Gpu(renderer) => Ok(renderer.render(camera)?.pixels),
            Artist::Cpu(painter) => Ok(painter.renderer.render(camera).pixels),
        }
    }

    /// Device memory in bytes: the scene's, and of the work; absent without a device.
    pub(super) fn memory_bytes(&self) -> Option<[u64; 2]> {
        match &self.painter.artist {
            Artist::Gpu(renderer) => Some(renderer.memory_bytes()),
            Artist::Cpu(_) => None,
        }
    }
}

impl Painter {
    fn new(
        scene: &Scene,
        prefixes: &[Option<Prefix>],
        device: &Device,
        approximation: &Approximation,
    ) -> Result<Self, String> {
        let (drawn, approximation) = adapted(scene, prefixes, approximation, !device.draws);
        let artist = match &device.gpu {
            Some((gpu, _)) if device.draws => {
                let renderer = GpuRenderer::new(gpu, drawn, &approximation, device.precision);
                Artist::Gpu(Box::new(renderer.map_err(|e| e.to_string())?))
            }
            _ => Artist::Cpu(Box::new(CpuPainter {
                renderer: CpuRenderer::with_approximation(drawn, &approximation).map_err(|e| e.to_string())?,
                camera: None,
                has_normals: false,
                looks: Vec::new(),
                kept: None,
            })),
        };
        let screen =
            device.gpu.as_ref().map(|(gpu, format)| (Screen::new(gpu, *format), BoxLines::new(gpu, scene, *format)));
        Ok(Self { artist, screen, photograph: None })
    }

    /// Shows what `before` showed, until there is a new picture.
    pub(super) fn take_picture_of(&mut self, before: &mut Self) {
        if let (Some((old, _)), Some((new, _))) = (&mut before.screen, &mut self.screen) {
            std::mem::swap(old, new);
        }
        if let (Artist::Cpu(old), Artist::Cpu(new)) = (&mut before.artist, &mut self.artist) {
            new.kept = old.kept.take();
        }
        self.photograph = before.photograph.take();
    }

    /// Takes the photograph that is seen through the picture: RGBA, `size` columns and rows.
    pub(super) fn set_photograph(&mut self, size: [u32; 2], rgba: Vec<u8>) {
        match &mut self.screen {
            Some((screen, _)) => screen.set_photograph(size, &rgba),
            None => self.photograph = Some(Photograph { size, rgba }),
        }
    }

    /// Keeps the picture that is whole now, which `camera` took.
    fn keep(&mut self, camera: &Camera) {
        match (&mut self.artist, &mut self.screen) {
            (Artist::Gpu(renderer), Some((screen, _))) => screen.keep(renderer, camera),
            (Artist::Gpu(_), None) => {}
            (Artist::Cpu(painter), screen) => {
                painter.keep();
                if let (Some((screen, _)), Some((camera, looks))) = (screen, &painter.kept) {
                    screen.keep_looks(looks, camera);
                }
            }
        }
    }
}

impl CpuPainter {
    fn begin(&mut self, camera: &Camera, has_normals: bool) {
        (self.camera, self.has_normals) = (Some(*camera), has_normals);
        self.looks.clear();
    }

    /// Draws the next rows, of about `most_rays` rays; how many rays are done, u32::MAX for all.
    fn advance(&mut self, most_rays: usize) -> u32 {
        let Some(camera) = self.camera else { return u32::MAX };
        let row = self.looks.len() as u32 / camera.width;
        let rows = (most_rays as u32 / camera.width).clamp(1, camera.height - row);
        let rays: Vec<Ray> = (row..row + rows).flat_map(|y| (0..camera.width).map(move |x| camera.ray(x, y))).collect();
        self.looks.extend(self.renderer.trace_info(&rays, self.has_normals));
        if row + rows == camera.height { u32::MAX } else { self.looks.len() as u32 }
    }

    fn keep(&mut self) {
        if let Some(camera) = self.camera.take() {
            self.kept = Some((camera, std::mem::take(&mut self.looks)));
        }
    }
}

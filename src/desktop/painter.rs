//! Drawing a scene on the graphics device or on the CPU, and displaying it in the window.

use strivec_field::render::gpu::{Drawing, Gpu, GpuError, GpuRenderer, Precision};
use strivec_field::render::{Approximation, CpuRenderer, Pixel, Renderer, TraceInfo};
use strivec_format::geometry::{Camera, Ray};
use strivec_format::model::Scene;
use strivec_player::{BoxLines, Painter, Screen, adapted};

/// The device that draws.
#[derive(Clone, Debug)]
pub(super) struct Device {
    /// The graphics device that paints the window, and its surface's format; `None` if the CPU paints it.
    pub(super) gpu: Option<(Gpu, wgpu::TextureFormat)>,
    /// True if the graphics device also renders the pictures.
    pub(super) draws: bool,
    pub(super) precision: Precision,
}

impl Device {
    /// Name for the panel.
    pub(super) fn name(&self) -> String {
        match &self.gpu {
            Some((gpu, _)) if self.draws => gpu.info().name.clone(),
            Some((gpu, _)) => format!("CPU; displayed by {}", gpu.info().name),
            None => "CPU, without a graphics device".to_owned(),
        }
    }
}

/// Draws a scene and displays its pictures.
pub(super) struct DesktopPainter {
    pub(super) renderer: SceneRenderer,
    /// `None` if the CPU paints the window.
    pub(super) screen: Option<(Screen, BoxLines)>,
    /// Without a screen, the photograph to blend in.
    pub(super) photograph: Option<LoadedPhotograph>,
}

/// A photograph in memory.
pub(super) struct LoadedPhotograph {
    /// Columns and rows.
    pub(super) size: [u32; 2],
    /// \[row\]\[column\] red, green, blue, opacity.
    pub(super) rgba: Vec<u8>,
}

/// A renderer of the scene, on the graphics device or on the CPU.
pub(super) enum SceneRenderer {
    Gpu(Box<GpuRenderer>),
    Cpu(Box<CpuPainter>),
}

/// Draws pictures on the CPU, some rows at a time.
pub(super) struct CpuPainter {
    renderer: CpuRenderer,
    camera: Option<Camera>,
    has_normals: bool,
    traced: Vec<TraceInfo>,
    /// The last finished picture.
    pub(super) kept: Option<(Camera, Vec<TraceInfo>)>,
}

impl SceneRenderer {
    fn new(device: &Device, scene: &Scene, approximation: &Approximation) -> Result<Self, GpuError> {
        let (drawn, approximation) = (scene.clone(), adapted(scene, approximation));
        Ok(match &device.gpu {
            Some((gpu, _)) if device.draws => {
                Self::Gpu(Box::new(GpuRenderer::new(gpu, drawn, &approximation, device.precision)?))
            }
            _ => Self::Cpu(Box::new(CpuPainter {
                renderer: CpuRenderer::with_approximation(drawn, &approximation)?,
                camera: None,
                has_normals: false,
                traced: Vec::new(),
                kept: None,
            })),
        })
    }
}

impl Painter for DesktopPainter {
    type Device = Device;

    fn new(device: &Device, scene: &Scene, approximation: &Approximation) -> Result<Self, GpuError> {
        let renderer = SceneRenderer::new(device, scene, approximation)?;
        let screen =
            device.gpu.as_ref().map(|(gpu, format)| (Screen::new(gpu, *format), BoxLines::new(gpu, scene, *format)));
        Ok(Self { renderer, screen, photograph: None })
    }

    fn approximate(&mut self, device: &Device, scene: &Scene, approximation: &Approximation) -> Result<(), GpuError> {
        let mut renderer = SceneRenderer::new(device, scene, approximation)?;
        if let (SceneRenderer::Cpu(old), SceneRenderer::Cpu(new)) = (&mut self.renderer, &mut renderer) {
            new.kept = old.kept.take();
        }
        self.renderer = renderer;
        Ok(())
    }

    fn set_near(&mut self, near: f64) {
        match &mut self.renderer {
            SceneRenderer::Gpu(renderer) => renderer.set_near(near),
            SceneRenderer::Cpu(painter) => painter.renderer.set_near(near),
        }
    }

    fn begin(&mut self, camera: &Camera, has_normals: bool) -> Result<(), GpuError> {
        match &mut self.renderer {
            SceneRenderer::Gpu(renderer) => {
                renderer.set_normals(has_normals);
                renderer.begin(camera)?;
            }
            SceneRenderer::Cpu(painter) => painter.begin(camera, has_normals),
        }
        Ok(())
    }

    fn advance(&mut self, most_rays: u32) -> Result<Option<u32>, GpuError> {
        match &mut self.renderer {
            SceneRenderer::Gpu(renderer) => Ok(match renderer.advance(most_rays)? {
                Drawing::Unfinished { done, .. } => Some(done),
                Drawing::Finished => None,
            }),
            SceneRenderer::Cpu(painter) => Ok(painter.advance(most_rays)),
        }
    }

    fn wait(&self, device: &Device, seconds: f64) -> Result<bool, GpuError> {
        const SHORTEST: f64 = 1e-3;
        if let (SceneRenderer::Gpu(_), Some((gpu, _))) = (&self.renderer, &device.gpu) {
            gpu.wait_for(std::time::Duration::from_secs_f64(seconds.max(SHORTEST)))?;
        }
        Ok(true)
    }

    fn keep(&mut self, camera: &Camera) {
        match (&mut self.renderer, &mut self.screen) {
            (SceneRenderer::Gpu(renderer), Some((screen, _))) => screen.keep(renderer, camera),
            (SceneRenderer::Gpu(_), None) => {}
            (SceneRenderer::Cpu(painter), screen) => {
                painter.keep();
                if let (Some((screen, _)), Some((camera, traced))) = (screen, &painter.kept) {
                    screen.keep_traced(traced, camera);
                }
            }
        }
    }

    fn shown(&self) -> Option<&Camera> {
        match (&self.screen, &self.renderer) {
            (Some((screen, _)), _) => screen.camera(),
            (None, SceneRenderer::Cpu(painter)) => painter.kept.as_ref().map(|(camera, _)| camera),
            (None, SceneRenderer::Gpu(_)) => None,
        }
    }

    fn take_picture_of(&mut self, before: &mut Self) {
        if let (Some((old, _)), Some((new, _))) = (&mut before.screen, &mut self.screen) {
            std::mem::swap(old, new);
        }
        if let (SceneRenderer::Cpu(old), SceneRenderer::Cpu(new)) = (&mut before.renderer, &mut self.renderer) {
            new.kept = old.kept.take();
        }
        self.photograph = before.photograph.take();
    }

    fn set_photograph(&mut self, size: [u32; 2], rgba: Vec<u8>) {
        match &mut self.screen {
            Some((screen, _)) => screen.set_photograph(size, &rgba),
            None => self.photograph = Some(LoadedPhotograph { size, rgba }),
        }
    }
}

impl DesktopPainter {
    /// The visible point at `at`, in parts of the picture's width and height, in the model's space.
    pub(super) fn point_at(&mut self, camera: &Camera, at: [f64; 2]) -> Option<glam::DVec3> {
        let ray = camera.ray_through(at[0] * f64::from(camera.width), at[1] * f64::from(camera.height))?;
        let pixel = match &mut self.renderer {
            SceneRenderer::Gpu(renderer) => renderer.trace(&[ray]).ok()?.first().copied(),
            SceneRenderer::Cpu(painter) => painter.renderer.trace(&[ray]).first().copied(),
        }?;
        // The sky is opaque and has no depth.
        (pixel.opacity > 0.1 && pixel.depth > 0.0).then(|| ray.at(f64::from(pixel.depth)))
    }

    /// Draws a whole picture and waits for it.
    pub(super) fn picture(&mut self, camera: &Camera) -> Result<Vec<Pixel>, GpuError> {
        match &mut self.renderer {
            SceneRenderer::Gpu(renderer) => Ok(renderer.render(camera)?.pixels),
            SceneRenderer::Cpu(painter) => Ok(painter.renderer.render(camera).pixels),
        }
    }

    /// Device memory in bytes, of the scene and of the workspace; `None` on the CPU.
    pub(super) fn memory_bytes(&self) -> Option<[u64; 2]> {
        match &self.renderer {
            SceneRenderer::Gpu(renderer) => Some(renderer.memory_bytes()),
            SceneRenderer::Cpu(_) => None,
        }
    }
}

impl CpuPainter {
    fn begin(&mut self, camera: &Camera, has_normals: bool) {
        (self.camera, self.has_normals) = (Some(*camera), has_normals);
        self.traced.clear();
    }

    /// Draws the next rows, of about `most_rays` rays. Returns the number of finished rays, `None` if all are finished.
    fn advance(&mut self, most_rays: u32) -> Option<u32> {
        let camera = self.camera?;
        let row = self.traced.len() as u32 / camera.width;
        let rows = (most_rays / camera.width).clamp(1, camera.height - row);
        // The player draws pinhole cameras only, which have a ray for each pixel.
        let rays: Vec<Ray> = camera.rays(row..row + rows).flatten().collect();
        self.traced.extend(self.renderer.trace_info(&rays, self.has_normals));
        (row + rows < camera.height).then_some(self.traced.len() as u32)
    }

    fn keep(&mut self) {
        if let Some(camera) = self.camera.take() {
            self.kept = Some((camera, std::mem::take(&mut self.traced)));
        }
    }
}

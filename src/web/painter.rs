//! Drawing a scene on the page's device.

use std::sync::atomic::{AtomicU64, Ordering};

use strivec_field::render::Approximation;
use strivec_field::render::gpu::{Drawing, Gpu, GpuError, GpuRenderer, Precision};
use strivec_format::geometry::Camera;
use strivec_format::model::Scene;
use strivec_player::{BoxLines, Painter, Screen, adapted};

/// The device, and the format of the canvas.
#[derive(Debug)]
pub(super) struct Device {
    pub(super) gpu: Gpu,
    pub(super) format: wgpu::TextureFormat,
}

/// Draws a scene and displays its pictures.
#[derive(Debug)]
pub(super) struct PagePainter {
    pub(super) screen: Screen,
    pub(super) boxes: BoxLines,
    /// `None` while it is lent to work that waits for the device.
    renderer: Option<GpuRenderer>,
    /// Number of the renderer, lent or not.
    number: u64,
    /// The distance at which rays begin, if it changed while the renderer was lent.
    near: Option<f64>,
}

/// A renderer that is lent.
pub(super) struct Lent {
    pub(super) renderer: GpuRenderer,
    number: u64,
}

fn next_number() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

fn renderer(device: &Device, scene: &Scene, approximation: &Approximation) -> Result<GpuRenderer, GpuError> {
    GpuRenderer::new(&device.gpu, scene.clone(), &adapted(scene, approximation), Precision::default())
}

impl Painter for PagePainter {
    type Device = Device;

    fn new(device: &Device, scene: &Scene, approximation: &Approximation) -> Result<Self, GpuError> {
        let renderer = Some(renderer(device, scene, approximation)?);
        let screen = Screen::new(&device.gpu, device.format);
        let boxes = BoxLines::new(&device.gpu, scene, device.format);
        Ok(Self { screen, boxes, renderer, number: next_number(), near: None })
    }

    fn approximate(&mut self, device: &Device, scene: &Scene, approximation: &Approximation) -> Result<(), GpuError> {
        self.renderer = Some(renderer(device, scene, approximation)?);
        (self.number, self.near) = (next_number(), None);
        Ok(())
    }

    fn set_near(&mut self, near: f64) {
        match &mut self.renderer {
            Some(renderer) => renderer.set_near(near),
            None => self.near = Some(near),
        }
    }

    fn is_ready(&self) -> bool {
        self.renderer.is_some()
    }

    fn begin(&mut self, camera: &Camera, has_normals: bool) -> Result<(), GpuError> {
        let Some(renderer) = &mut self.renderer else { return Ok(()) };
        renderer.set_normals(has_normals);
        renderer.begin(camera)
    }

    fn advance(&mut self, most_rays: u32) -> Result<Option<u32>, GpuError> {
        let Some(renderer) = &mut self.renderer else { return Ok(Some(0)) };
        Ok(match renderer.advance(most_rays)? {
            Drawing::Unfinished { done, .. } => Some(done),
            Drawing::Finished => None,
        })
    }

    /// A page never waits.
    fn wait(&self, _: &Device, _: f64) -> Result<bool, GpuError> {
        Ok(false)
    }

    fn keep(&mut self, camera: &Camera) {
        if let Some(renderer) = &self.renderer {
            self.screen.keep(renderer, camera);
        }
    }

    fn shown(&self) -> Option<&Camera> {
        self.screen.camera()
    }

    fn take_picture_of(&mut self, before: &mut Self) {
        std::mem::swap(&mut self.screen, &mut before.screen);
    }

    fn set_photograph(&mut self, size: [u32; 2], rgba: Vec<u8>) {
        self.screen.set_photograph(size, &rgba);
    }
}

impl PagePainter {
    /// Lends the renderer, unless it is lent.
    pub(super) fn lend(&mut self) -> Option<Lent> {
        Some(Lent { renderer: self.renderer.take()?, number: self.number })
    }

    /// Takes the renderer back, unless it was replaced. Returns whether it did.
    pub(super) fn take_back(&mut self, mut lent: Lent) -> bool {
        let is_own = lent.number == self.number;
        if is_own {
            if let Some(near) = self.near.take() {
                lent.renderer.set_near(near);
            }
            self.renderer = Some(lent.renderer);
        }
        is_own
    }

    /// Device memory in bytes, of the scene and of the workspace; `None` while the renderer is lent.
    pub(super) fn memory_bytes(&self) -> Option<[u64; 2]> {
        self.renderer.as_ref().map(GpuRenderer::memory_bytes)
    }
}

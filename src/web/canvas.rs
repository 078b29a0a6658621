//! A canvas to draw on.

use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Poll, Waker};

use web_sys::HtmlCanvasElement;

use strivec_field::render::gpu::{Gpu, GpuError};

/// Gray level behind the pictures.
const DARK: f64 = 0.06;

/// A canvas and the device that draws on it.
#[derive(Debug)]
pub(super) struct Canvas {
    pub(super) gpu: Gpu,
    surface: wgpu::Surface<'static>,
    configuration: wgpu::SurfaceConfiguration,
}

impl Canvas {
    /// Opens the browser's best device for `canvas`.
    pub(super) async fn new(canvas: HtmlCanvasElement) -> Result<Self, GpuError> {
        let [width, height] = [canvas.width(), canvas.height()].map(|v| v.max(1));
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let target = wgpu::SurfaceTarget::Canvas(canvas);
        let surface = instance.create_surface(target).map_err(|e| GpuError::NoAdapter(e.to_string()))?;
        let gpu = Gpu::request(&instance, Some(&surface)).await?;
        let mut configuration = surface
            .get_default_config(gpu.adapter(), width, height)
            .ok_or_else(|| GpuError::NoAdapter("the adapter cannot draw on a canvas".into()))?;
        // Colors are display-referred already.
        let formats = surface.get_capabilities(gpu.adapter()).formats;
        let plain = [wgpu::TextureFormat::Bgra8Unorm, wgpu::TextureFormat::Rgba8Unorm];
        configuration.format = formats.into_iter().find(|f| plain.contains(f)).unwrap_or(configuration.format);
        surface.configure(gpu.device(), &configuration);
        Ok(Self { gpu, surface, configuration })
    }

    /// Columns and rows.
    pub(super) fn size(&self) -> [u32; 2] {
        [self.configuration.width, self.configuration.height]
    }

    /// Format of its pixels.
    pub(super) fn format(&self) -> wgpu::TextureFormat {
        self.configuration.format
    }

    /// Sets its size, clamped to the device's limit.
    pub(super) fn resize(&mut self, size: [u32; 2]) {
        let most = self.gpu.device().limits().max_texture_dimension_2d;
        let size = size.map(|v| v.clamp(1, most));
        if size != self.size() {
            [self.configuration.width, self.configuration.height] = size;
            self.surface.configure(self.gpu.device(), &self.configuration);
        }
    }

    /// Completes when the device has finished all work that is submitted now.
    pub(super) fn idle(&self) -> impl Future<Output = ()> + use<> {
        let state = Arc::new(Mutex::new((false, None::<Waker>)));
        let there = Arc::clone(&state);
        self.gpu.queue().on_submitted_work_done(move || {
            let (is_idle, waiting) = &mut *there.lock().unwrap_or_else(PoisonError::into_inner);
            *is_idle = true;
            if let Some(waiting) = waiting.take() {
                waiting.wake();
            }
        });
        std::future::poll_fn(move |context| {
            let (is_idle, waiting) = &mut *state.lock().unwrap_or_else(PoisonError::into_inner);
            if *is_idle {
                return Poll::Ready(());
            }
            *waiting = Some(context.waker().clone());
            Poll::Pending
        })
    }

    /// Clears the canvas and draws by `draw`.
    pub(super) fn paint(&self, draw: impl FnOnce(&mut wgpu::RenderPass<'_>)) {
        use wgpu::CurrentSurfaceTexture::{Suboptimal, Success};
        let (Success(frame) | Suboptimal(frame)) = self.surface.get_current_texture() else { return };
        let view = frame.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = self.gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("canvas"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r: DARK, g: DARK, b: DARK, a: 1.0 }),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..wgpu::RenderPassDescriptor::default()
        });
        draw(&mut pass);
        drop(pass);
        self.gpu.queue().submit([encoder.finish()]);
        self.gpu.queue().present(frame);
    }
}

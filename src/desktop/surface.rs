//! The surface of the window: that of a graphics device, or memory.

use std::num::NonZeroU32;
use std::sync::Arc;

use egui::epaint::ClippedPrimitive;
use egui::{Color32, Rect, TexturesDelta};
use winit::window::Window;

use super::app::App;
use super::memory::fill_slot;
use super::software::{Textures, WindowPixels};
use strivec_field::render::gpu::{Gpu, GpuError};
use strivec_player::{Painter as _, PictureRect};

/// Gray level behind the pictures.
const DARK: f64 = 0.06;

/// egui's shapes and textures of a frame.
pub(super) struct Painting {
    pub(super) primitives: Vec<ClippedPrimitive>,
    pub(super) textures: TexturesDelta,
    pub(super) pixels_per_point: f32,
    /// The picture's place, in pixels.
    pub(super) picture: Rect,
}

/// A surface of the window.
pub(super) enum WindowSurface {
    Gpu(Box<GpuSurface>),
    Memory { surface: softbuffer::Surface<Arc<Window>, Arc<Window>>, textures: Textures },
}

/// A graphics device's surface.
pub(super) struct GpuSurface {
    gpu: Gpu,
    surface: wgpu::Surface<'static>,
    configuration: wgpu::SurfaceConfiguration,
    egui: egui_wgpu::Renderer,
}

impl WindowSurface {
    /// A device's surface of `window`, and the device.
    pub(super) fn on_gpu(window: &Arc<Window>) -> Result<(Self, Gpu, wgpu::TextureFormat), GpuError> {
        let descriptor = wgpu::InstanceDescriptor::new_with_display_handle_from_env(Box::new(Arc::clone(window)));
        let instance = wgpu::Instance::new(descriptor);
        let surface = instance
            .create_surface(Arc::clone(window))
            .map_err(|_| GpuError::NoAdapter("no Vulkan, Metal or DirectX 12 device can draw on this window".into()))?;
        let gpu = pollster::block_on(Gpu::request(&instance, Some(&surface)))?;
        let size = window.inner_size();
        let mut configuration = surface
            .get_default_config(gpu.adapter(), size.width.max(1), size.height.max(1))
            .ok_or_else(|| GpuError::NoAdapter("the device cannot draw on this window".into()))?;
        // Colors are display-referred already.
        let formats = surface.get_capabilities(gpu.adapter()).formats;
        let plain = [wgpu::TextureFormat::Bgra8Unorm, wgpu::TextureFormat::Rgba8Unorm];
        configuration.format = plain.into_iter().find(|f| formats.contains(f)).unwrap_or(configuration.format);
        surface.configure(gpu.device(), &configuration);
        let egui = egui_wgpu::Renderer::new(gpu.device(), configuration.format, egui_wgpu::RendererOptions::default());
        let format = configuration.format;
        let on_gpu = Self::Gpu(Box::new(GpuSurface { gpu: gpu.clone(), surface, configuration, egui }));
        Ok((on_gpu, gpu, format))
    }

    /// Memory that the system shows in `window`.
    pub(super) fn in_memory(window: &Arc<Window>) -> Result<Self, String> {
        let fail = |e: softbuffer::SoftBufferError| format!("cannot draw on the window from memory: {e}");
        let context = softbuffer::Context::new(Arc::clone(window)).map_err(fail)?;
        let surface = softbuffer::Surface::new(&context, Arc::clone(window)).map_err(fail)?;
        Ok(Self::Memory { surface, textures: Textures::default() })
    }

    /// Sets the window's size.
    pub(super) fn resize(&mut self, width: u32, height: u32) {
        if let Self::Gpu(gpu) = self
            && width > 0
            && height > 0
        {
            let most = gpu.gpu.device().limits().max_texture_dimension_2d;
            (gpu.configuration.width, gpu.configuration.height) = (width.min(most), height.min(most));
            gpu.surface.configure(gpu.gpu.device(), &gpu.configuration);
        }
    }

    /// Paints the pictures, and egui over them.
    pub(super) fn paint(&mut self, app: &App, painting: Painting, window: &Window) -> Result<(), String> {
        match self {
            Self::Gpu(gpu) => {
                gpu.paint(app, painting);
                Ok(())
            }
            Self::Memory { surface, textures } => paint_memory(surface, textures, app, painting, window),
        }
    }
}

impl GpuSurface {
    fn paint(&mut self, app: &App, mut painting: Painting) {
        let (device, queue) = (self.gpu.device(), self.gpu.queue());
        for (id, deltas) in painting.textures.set.drain() {
            for delta in &deltas {
                self.egui.update_texture(device, queue, id, delta);
            }
        }
        if let Some(frame) = self.next_frame() {
            let (device, queue) = (self.gpu.device(), self.gpu.queue());
            let view = frame.texture.create_view(&wgpu::TextureViewDescriptor::default());
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let descriptor = egui_wgpu::ScreenDescriptor {
                size_in_pixels: [self.configuration.width, self.configuration.height],
                pixels_per_point: painting.pixels_per_point,
            };
            let mut buffers = self.egui.update_buffers(device, queue, &mut encoder, &painting.primitives, &descriptor);
            let mut pass = encoder
                .begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("window"),
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
                })
                .forget_lifetime();
            for (n, place) in places(app, painting.picture).into_iter().enumerate() {
                self.paint_slot(app, n, place, &mut pass);
            }
            pass.set_viewport(0.0, 0.0, self.configuration.width as f32, self.configuration.height as f32, 0.0, 1.0);
            self.egui.render(&mut pass, &painting.primitives, &descriptor);
            drop(pass);
            buffers.push(encoder.finish());
            queue.submit(buffers);
            queue.present(frame);
        }
        for id in painting.textures.free.drain() {
            self.egui.free_texture(&id);
        }
    }

    /// Paints the picture of slot `n` at `place`, if it has one.
    fn paint_slot(&self, app: &App, n: usize, place: PictureRect, pass: &mut wgpu::RenderPass<'static>) {
        let Some((show, slot)) = app.session.show(n).zip(app.session.slots[n].as_ref()) else { return };
        let Some((camera, (screen, boxes))) = slot.painter.shown().zip(slot.painter.screen.as_ref()) else { return };
        if !place.enter(pass, [self.configuration.width, self.configuration.height]) {
            return;
        }
        let [left, top, right, bottom] = place.whole;
        screen.draw(pass, [left, top], [right - left, bottom - top], &show);
        if app.session.has_boxes {
            boxes.draw(&self.gpu, pass, camera, &app.session.boxes);
        }
    }

    /// The texture to paint on; `None` if there is none, for example while the window is hidden.
    fn next_frame(&mut self) -> Option<wgpu::SurfaceTexture> {
        for _ in 0..2 {
            match self.surface.get_current_texture() {
                wgpu::CurrentSurfaceTexture::Success(frame) | wgpu::CurrentSurfaceTexture::Suboptimal(frame) => {
                    return Some(frame);
                }
                wgpu::CurrentSurfaceTexture::Outdated | wgpu::CurrentSurfaceTexture::Lost => {
                    self.surface.configure(self.gpu.device(), &self.configuration);
                }
                _ => return None,
            }
        }
        None
    }
}

/// The places of both slots' pictures.
fn places(app: &App, picture: Rect) -> [PictureRect; 2] {
    app.session.places([picture.left(), picture.top(), picture.right(), picture.bottom()])
}

fn paint_memory(
    surface: &mut softbuffer::Surface<Arc<Window>, Arc<Window>>,
    textures: &mut Textures,
    app: &App,
    mut painting: Painting,
    window: &Window,
) -> Result<(), String> {
    for (id, deltas) in painting.textures.set.drain() {
        deltas.iter().for_each(|delta| textures.set(id, delta));
    }
    let size = window.inner_size();
    if let (Some(width), Some(height)) = (NonZeroU32::new(size.width), NonZeroU32::new(size.height)) {
        let dark = (255.0 * DARK) as u8;
        let mut canvas = WindowPixels::new(size.width as usize, size.height as usize, Color32::from_gray(dark));
        for (n, place) in places(app, painting.picture).into_iter().enumerate() {
            fill_slot(app, n, &place, &mut canvas);
        }
        textures.paint(&mut canvas, &painting.primitives, painting.pixels_per_point);
        surface.resize(width, height).map_err(|e| e.to_string())?;
        let mut buffer = surface.buffer_mut().map_err(|e| e.to_string())?;
        for (to, color) in buffer.iter_mut().zip(&canvas.colors) {
            *to = u32::from_be_bytes([0, color.r(), color.g(), color.b()]);
        }
        buffer.present().map_err(|e| e.to_string())?;
    }
    painting.textures.free.drain().for_each(|id| textures.free(id));
    Ok(())
}

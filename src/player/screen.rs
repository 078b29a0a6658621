//! Display of the last finished picture on a surface.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec2Swizzles as _, Vec3};

use super::first_view::extent;
use strivec_field::render::TraceInfo;
use strivec_field::render::gpu::{Gpu, GpuRenderer};
use strivec_format::geometry::Camera;
use strivec_format::model::Scene;

const SHADER: &str = strivec_shaders::DISPLAY;
/// Bytes of a pixel of the renderer.
const PIXEL_BYTES: u64 = 32;

strivec_format::named! {
    /// Displayed quantity of a picture.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum View {
        /// Colors.
        #[default]
        Color = "color",
        /// Expected depth, near is bright.
        Depth = "depth",
        /// Opacity.
        Opacity = "opacity",
        /// Normals from density, in the camera's axes.
        Normals = "normals",
        /// Samples that were evaluated.
        Samples = "samples",
    }
}

impl View {
    /// Name in the panel.
    pub fn label(self) -> &'static str {
        match self {
            Self::Color => "Color",
            Self::Depth => "Depth",
            Self::Opacity => "Opacity",
            Self::Normals => "Normals",
            Self::Samples => "Samples",
        }
    }

    /// The next quantity; the first follows the last.
    pub fn next(self) -> Self {
        Self::ALL[(self as usize + 1) % Self::ALL.len()]
    }
}

/// Display settings of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Show {
    /// The displayed quantity.
    pub view: View,
    /// The scene's background, which the picture was composited on.
    pub scene_background: [f32; 3],
    /// The displayed background.
    pub background: [f32; 3],
    /// Depths that are displayed brightest and darkest, in model units.
    pub depths: [f32; 2],
    /// In an unbounded scene, the depth of medium gray: nearer surfaces are brighter, and only an infinite depth is darkest.
    /// Otherwise 0.
    pub depth_scale: f32,
    /// Number of samples that is displayed brightest.
    pub most_samples: f32,
    /// Share of the photograph in the picture, from 0 to 1.
    pub photograph_share: f32,
    /// The photograph's corner and size, in parts of the picture's place.
    pub photograph: [f32; 4],
}

impl Show {
    /// Brightness of `depth`, from 0 to 1. Twin: `fragment` of `shaders/display.wgsl`.
    pub fn nearness(&self, depth: f32) -> f32 {
        let [near, far] = self.depths;
        let between = (far - depth) / (far - near).max(1e-6);
        let scale = self.depth_scale;
        if scale > 0.0 { scale / (scale + depth).max(1e-6) } else { between }.clamp(0.0, 1.0)
    }

    /// Settings for the picture of `scene` that `camera` took: `view`, on `background` or else the scene's own, without
    /// a photograph.
    pub fn new(scene: &Scene, camera: Option<&Camera>, view: View, background: Option<[f32; 3]>) -> Self {
        let (own, bounds) = (scene.frame.background, &scene.bounds);
        let distance = camera.map_or(1.0, |camera| (camera.position - bounds.center()).length());
        let reach = 0.5 * bounds.size().length();
        Self {
            view,
            scene_background: own,
            background: background.unwrap_or(own),
            depths: [(distance - reach).max(0.0), distance + reach].map(|v| v as f32),
            depth_scale: scene.rules.contraction.map_or(0.0, |_| extent(scene) as f32),
            most_samples: (bounds.size().max_element() / scene.rules.step).min(256.0) as f32,
            photograph_share: 0.0,
            photograph: [0.0, 0.0, 1.0, 1.0],
        }
    }
}

/// `Display` of `shaders/display.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Uniform {
    picture: [u32; 2],
    corner: [f32; 2],
    size: [f32; 2],
    view: u32,
    is_linear: u32,
    scene_background: [f32; 3],
    photograph_share: f32,
    background: [f32; 3],
    most_samples: f32,
    depths: [f32; 2],
    depth_scale: f32,
    padding: f32,
    photograph: [f32; 4],
    right: [f32; 3],
    padding1: f32,
    up: [f32; 3],
    padding2: f32,
    back: [f32; 3],
    padding3: f32,
}

/// A finished picture in device memory.
#[derive(Debug)]
struct KeptPicture {
    pixels: wgpu::Buffer,
    camera: Camera,
}

/// Displays the last finished picture while the next one is being drawn.
#[derive(Debug)]
pub struct Screen {
    gpu: Gpu,
    pipeline: wgpu::RenderPipeline,
    uniform: wgpu::Buffer,
    sampler: wgpu::Sampler,
    photograph: wgpu::TextureView,
    kept: Option<KeptPicture>,
    is_linear: bool,
}

impl Screen {
    /// A screen without a picture, for surfaces of `format`.
    pub fn new(gpu: &Gpu, format: wgpu::TextureFormat) -> Self {
        let device = gpu.device();
        let uniform = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("display"),
            size: size_of::<Uniform>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        Self {
            gpu: gpu.clone(),
            pipeline: pipeline(device, format),
            uniform,
            sampler,
            photograph: texture(gpu, [1, 1], &[0; 4]),
            kept: None,
            is_linear: format.is_srgb(),
        }
    }

    /// Keeps the picture that `renderer` has finished, which `camera` took.
    pub fn keep(&mut self, renderer: &GpuRenderer, camera: &Camera) {
        let pixels = self.room_for(camera);
        let mut encoder = self.gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(renderer.pixels(), 0, &pixels, 0, Some(pixels.size()));
        self.gpu.queue().submit([encoder.finish()]);
        self.kept = Some(KeptPicture { pixels, camera: *camera });
    }

    /// Keeps a picture that was not drawn on the device: the pixels that `camera` saw.
    pub fn keep_traced(&mut self, traced: &[TraceInfo], camera: &Camera) {
        let pixels = self.room_for(camera);
        let values: Vec<[f32; 8]> = (traced.iter())
            .map(|info| {
                let ([r, g, b], opacity, depth) = (info.pixel.color, info.pixel.opacity, info.pixel.depth);
                [r, g, b, opacity, depth, info.samples as f32, 0.0, info.normal.map_or(0.0, coded)]
            })
            .collect();
        self.gpu.queue().write_buffer(&pixels, 0, bytemuck::cast_slice(&values));
        self.kept = Some(KeptPicture { pixels, camera: *camera });
    }

    /// A buffer for `camera`'s pixels: that of the previous picture if it has the same size.
    fn room_for(&mut self, camera: &Camera) -> wgpu::Buffer {
        let bytes = u64::from(camera.width) * u64::from(camera.height) * PIXEL_BYTES;
        match self.kept.take() {
            Some(kept) if kept.pixels.size() == bytes => kept.pixels,
            _ => self.gpu.device().create_buffer(&wgpu::BufferDescriptor {
                label: Some("kept"),
                size: bytes,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
        }
    }

    /// The camera of the picture; `None` if there is no picture.
    pub fn camera(&self) -> Option<&Camera> {
        self.kept.as_ref().map(|kept| &kept.camera)
    }

    /// Sets the photograph to blend with the picture: RGBA, `size` columns and rows.
    pub fn set_photograph(&mut self, size: [u32; 2], rgba: &[u8]) {
        self.photograph = texture(&self.gpu, size, rgba);
    }

    /// Draws the picture into `pass`, with its corner at `corner` and of `size`, in the surface's pixels. The scissor
    /// rectangle of `pass` selects the visible part.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, corner: [f32; 2], size: [f32; 2], show: &Show) {
        let Some(KeptPicture { pixels, camera }) = &self.kept else { return };
        let axis = |n: usize| camera.world_from_camera.col(n).to_array().map(|v| v as f32);
        let uniform = Uniform {
            picture: [camera.width, camera.height],
            corner,
            size,
            view: show.view as u32,
            is_linear: u32::from(self.is_linear),
            scene_background: show.scene_background,
            photograph_share: show.photograph_share,
            background: show.background,
            most_samples: show.most_samples,
            depths: show.depths,
            depth_scale: show.depth_scale,
            padding: 0.0,
            photograph: show.photograph,
            right: axis(0),
            padding1: 0.0,
            up: axis(1),
            padding2: 0.0,
            back: axis(2),
            padding3: 0.0,
        };
        self.gpu.queue().write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        let bind_group = self.gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("display"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: self.uniform.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: pixels.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 2, resource: wgpu::BindingResource::TextureView(&self.photograph) },
                wgpu::BindGroupEntry { binding: 3, resource: wgpu::BindingResource::Sampler(&self.sampler) },
            ],
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// Encodes a direction as a number. Twin: `coded` of `shaders/normals.wgsl`.
fn coded(direction: Vec3) -> f32 {
    let flat = direction.truncate() / direction.abs().element_sum();
    let signs = Vec2::select(flat.cmpge(Vec2::ZERO), Vec2::ONE, Vec2::NEG_ONE);
    let folded = if direction.z < 0.0 { (1.0 - flat.yx().abs()) * signs } else { flat };
    let steps = ((0.5 + 0.5 * folded) * 2047.0).round();
    1.0 + steps.x * 2048.0 + steps.y
}

fn texture(gpu: &Gpu, size: [u32; 2], rgba: &[u8]) -> wgpu::TextureView {
    let extent = wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 };
    let texture = gpu.device().create_texture(&wgpu::TextureDescriptor {
        label: Some("photograph"),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * size[0]), rows_per_image: Some(size[1]) };
    gpu.queue().write_texture(texture.as_image_copy(), rgba, layout, extent);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

fn pipeline(device: &wgpu::Device, format: wgpu::TextureFormat) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("display"),
        source: wgpu::ShaderSource::Wgsl(SHADER.into()),
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("display"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(wgpu::ColorTargetState { format, blend: None, write_mask: wgpu::ColorWrites::ALL })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_field::render::gpu::testing::assert_same_layout;

    #[test]
    fn the_uniform_lies_as_the_shader_has_it() {
        assert_same_layout!(
            SHADER,
            "Display",
            Uniform,
            picture,
            corner,
            size,
            view,
            is_linear,
            scene_background,
            photograph_share,
            background,
            most_samples,
            depths,
            depth_scale,
            photograph,
            right,
            up,
            back
        );
    }

    #[test]
    fn directions_survive_their_code() {
        for direction in [Vec3::X, -Vec3::Z, Vec3::new(-0.3, 0.5, -0.8), Vec3::new(0.2, -0.9, 0.4)] {
            let code = coded(direction.normalize()) - 1.0;
            // The decoding is that of display.wgsl.
            let flat = Vec2::new((code / 2048.0).floor(), code % 2048.0) / 2047.0 * 2.0 - 1.0;
            let z = 1.0 - flat.abs().element_sum();
            let signs = Vec2::select(flat.cmpge(Vec2::ZERO), Vec2::ONE, Vec2::NEG_ONE);
            let back = if z < 0.0 { (1.0 - flat.yx().abs()) * signs } else { flat }.extend(z).normalize();
            assert!(back.distance(direction.normalize()) < 2e-3, "{direction} {back}");
        }
    }

    #[test]
    fn near_depths_of_an_unbounded_scene_differ_however_far_it_reaches() {
        let scene = strivec_format::container::decode(include_bytes!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../fixtures/v1/f32.strivec"
        )))
        .unwrap();
        let plain = Show::new(&scene, None, View::Depth, None);
        assert!((plain.nearness(plain.depths[0]) - 1.0).abs() < 1e-6 && plain.nearness(plain.depths[1]) < 1e-6);
        let contraction = strivec_format::geometry::Contraction { shell: 0.4 };
        let rules = strivec_format::model::Rules { contraction: Some(contraction), ..scene.rules.clone() };
        let unbounded = Scene { bounds: contraction.bounds(), rules, ..scene };
        let show = Show::new(&unbounded, None, View::Depth, None);
        let shown = [0.5, 1.0, 2.0, 4.0, 1e3].map(|depth| show.nearness(depth));
        assert!(shown.windows(2).all(|pair| pair[0] > pair[1] + 0.1), "{shown:?}");
    }

    #[test]
    fn views_wrap_around() {
        assert_eq!(View::ALL.iter().fold(View::Color, |view, _| view.next()), View::Color);
        assert_eq!(View::Color.next(), View::Depth);
    }
}

//! Rendering on a graphics processor, through the shaders in `shaders/`.
//!
//! In: a scene, an open device. Out: pictures that agree with the reference's within [`POSITION_ERROR`]. A batch of rays goes
//! through a few compute stages (`shader::Stage`); the host only says how many rays there are, and looks afterwards whether
//! their samples had limits. Whoever waits for the device can do so without holding up the thread; `blocking` does hold it up,
//! where there is more than a browser's one.

#[cfg(not(target_arch = "wasm32"))]
mod blocking;
mod device;
mod drawing;
mod layout;
mod packed;
mod shader;
#[cfg(test)]
pub(crate) mod testing;
mod workspace;

pub use device::Gpu;
pub use drawing::Drawing;
pub use shader::Precision;

use drawing::Job;
use layout::{Frame, PixelPair, Ray as DeviceRay};
use packed::{BufferLimits, Packed};
use shader::{RAY_LANES, Stage, TILE};
use workspace::Workspace;

use super::{Approximation, ApproximationError, Picture, Pixel};
use crate::field::Field;
use crate::geometry::{Aabb, Camera, Ray};
use crate::model::Scene;

/// How far the position of a sample may be from the reference's, relative to the distance that the ray comes from: rays are
/// computed in 32 bits.
pub const POSITION_ERROR: f64 = 1e-6;

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// No device, not even a software one (the system).
    #[error("no graphics adapter was found: {0}")]
    NoAdapter(String),
    /// The device failed, or was lost (the system).
    #[error("the graphics device failed: {0}")]
    Device(String),
    /// More than this device takes.
    #[error("{what}: this graphics device takes at most {limit}, found {found}")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How much there is.
        found: u64,
        /// How much there may be.
        limit: u64,
    },
    /// An option that makes no sense for the scene (the caller).
    #[error(transparent)]
    Approximation(#[from] ApproximationError),
}

/// What one stage took, where the device tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTime {
    /// The stage.
    pub name: &'static str,
    /// Milliseconds, over all batches.
    pub milliseconds: f64,
}

/// Renders a scene on a device.
#[derive(Debug)]
pub struct GpuRenderer {
    gpu: Gpu,
    pipelines: Vec<wgpu::ComputePipeline>,
    scene: wgpu::Buffer,
    chunks: Vec<wgpu::Buffer>,
    workspace: Workspace,
    job: Option<Job>,
    has_normals: bool,
    /// Strides that a ray takes in a pass of marching at most, and passes that rays have needed so far.
    strides: u32,
    passes: u32,
    /// One a stage while stages are timed.
    times: Vec<StageTime>,
    origin: glam::DVec3,
    bounds: Aabb,
    near_far: [f64; 2],
}

/// Turns of all its loops together that an invocation may take on a device that is no hardware: Mesa's llvmpipe ends loops
/// without a word after 65 535, a few of which are turns that other invocations of the same group need.
const MAX_TURNS: u32 = 1 << 15;
/// Strides that few rays exceed.
const USUAL_STRIDES: u32 = 1024;

impl GpuRenderer {
    /// Prepares `scene`, which must have passed [`Scene::check`], with `approximation`.
    ///
    /// # Errors
    ///
    /// Where an option is out of range, a density cache is asked for, or the device is too small for the scene.
    pub fn new(gpu: &Gpu, scene: Scene, approximation: &Approximation, precision: Precision) -> Result<Self, GpuError> {
        Self::with_room(gpu, scene, approximation, precision, gpu.limits())
    }

    /// As [`GpuRenderer::new`], with no more of the device than `limits`.
    fn with_room(
        gpu: &Gpu,
        mut scene: Scene,
        approximation: &Approximation,
        precision: Precision,
        limits: BufferLimits,
    ) -> Result<Self, GpuError> {
        approximation.check(&scene)?;
        if let Some(cells) = approximation.density_cache {
            let (option, expected, found) = ("density_cache", "none on a graphics device".into(), cells.to_string());
            return Err(ApproximationError { option, expected, found }.into());
        }
        approximation.reduce(&mut scene);
        let field = Field::<f32>::consuming(scene);
        let packed = Packed::new(&field, precision, limits)?;
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let scene = gpu.upload("scene", &packed.scene, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST);
        let chunks = (packed.words.chunks(4 << limits.chunk_shift))
            .map(|words| gpu.upload("quads", bytemuck::cast_slice(words), storage))
            .collect();
        let pipelines = Stage::ALL.map(|stage| gpu.pipeline(stage, &packed.shape)).into();
        let strides = match gpu.info().device_type {
            wgpu::DeviceType::Cpu => (MAX_TURNS / packed.turns_per_sample).max(1),
            _ => u32::MAX,
        };
        gpu.uncaptured_error()?;
        Ok(Self {
            gpu: gpu.clone(),
            pipelines,
            scene,
            chunks,
            workspace: Workspace::new(gpu, RAY_LANES, 1),
            job: None,
            has_normals: false,
            strides,
            passes: USUAL_STRIDES.div_ceil(strides),
            times: Vec::new(),
            origin: field.origin,
            bounds: field.bounds,
            near_far: field.near_far,
        })
    }

    /// The picture that `camera`, in the model's space, takes.
    ///
    /// # Errors
    ///
    /// [`GpuError::Device`], and [`GpuError::TooLarge`] for a picture of more pixels than the device takes.
    pub async fn render_async(&mut self, camera: &Camera) -> Result<Picture, GpuError> {
        self.begin(camera)?;
        self.finish().await?;
        let pixels = self.read_pixels(camera.width as usize * camera.height as usize).await?;
        Ok(Picture { width: camera.width, height: camera.height, pixels })
    }

    /// As [`GpuRenderer::render_async`], and what each stage took; without stages where the device does not tell.
    ///
    /// # Errors
    ///
    /// As [`GpuRenderer::render_async`]'s.
    pub async fn render_timed_async(&mut self, camera: &Camera) -> Result<(Picture, Vec<StageTime>), GpuError> {
        if self.gpu.has_timestamps() {
            self.times = Stage::ALL.map(|s| StageTime { name: s.name(), milliseconds: 0.0 }).into();
        }
        let picture = self.render_async(camera).await;
        let times = std::mem::take(&mut self.times);
        Ok((picture?, times))
    }

    /// What each of `rays`, in the model's space, sees.
    ///
    /// # Errors
    ///
    /// As [`GpuRenderer::render_async`]'s.
    pub async fn trace_async(&mut self, rays: &[Ray]) -> Result<Vec<Pixel>, GpuError> {
        self.abandon();
        let given: Vec<_> = rays.iter().map(|ray| self.device_ray(ray)).collect();
        self.make_room(rays.len() as u64, rays.len() as u64)?;
        let frame = Frame { rays_are_given: 1, ..Frame::default() };
        self.job = Some(Job::new(frame, rays.len() as u32, given, self.workspace.rays_at_once()));
        self.finish().await?;
        self.read_pixels(rays.len()).await
    }

    /// Begins the picture that `camera`, in the model's space, takes, in place of any that is unfinished;
    /// [`GpuRenderer::advance`] draws it.
    ///
    /// # Errors
    ///
    /// [`GpuError::TooLarge`] for a picture of more pixels than the device takes.
    pub fn begin(&mut self, camera: &Camera) -> Result<(), GpuError> {
        self.abandon();
        let tiles = u64::from(camera.width.div_ceil(TILE)) * u64::from(camera.height.div_ceil(TILE));
        let rays = tiles * u64::from(TILE * TILE);
        self.make_room(rays, u64::from(camera.width) * u64::from(camera.height))?;
        let axis = |n: usize| camera.world_from_camera.col(n).to_array().map(|v| v as f32);
        let frame = Frame {
            position: (camera.position - self.origin).to_array().map(|v| v as f32),
            width: camera.width,
            right: axis(0),
            height: camera.height,
            up: axis(1),
            back: axis(2),
            focal: camera.focal.map(|v| v as f32),
            principal: camera.principal.map(|v| v as f32),
            ..Frame::default()
        };
        self.job = Some(Job::new(frame, rays as u32, Vec::new(), self.workspace.rays_at_once()));
        Ok(())
    }

    /// Draws what was begun.
    async fn finish(&mut self) -> Result<(), GpuError> {
        while self.advance(u32::MAX)? != Drawing::Finished {
            if let Some(completion) = self.job.as_ref().and_then(Job::completion) {
                completion.await;
            }
            if !self.times.is_empty() {
                let mut times = std::mem::take(&mut self.times);
                self.workspace.add_times(&self.gpu, &mut times).await?;
                self.times = times;
            }
        }
        Ok(())
    }

    /// Forgets what was begun. What the device is at ends unheard.
    fn abandon(&mut self) {
        if self.job.take().is_some_and(|job| job.completion().is_some()) {
            self.workspace.counters_back.unmap();
        }
    }

    /// Whether pictures that are begun from now on have normals.
    pub fn set_normals(&mut self, are_wanted: bool) {
        self.has_normals = are_wanted;
    }

    /// Two vectors of four a pixel, as `shaders/layout.wgsl` says; of the picture that was finished last.
    pub fn pixels(&self) -> &wgpu::Buffer {
        &self.workspace.pixels
    }

    /// Bytes of device memory that are held: the scene's, and those of the work.
    pub fn memory_bytes(&self) -> [u64; 2] {
        let scene = self.scene.size() + self.chunks.iter().map(wgpu::Buffer::size).sum::<u64>();
        [scene, self.workspace.bytes()]
    }

    /// A ray as the first stage would make it, in 64 bits.
    fn device_ray(&self, ray: &Ray) -> DeviceRay {
        let span = self.bounds.intersect(ray).map(|(t0, t1)| (t0.max(self.near_far[0]), t1.min(self.near_far[1])));
        let (entry, exit) = span.filter(|(t0, t1)| t0 <= t1).unwrap_or((0.0, 0.0));
        let narrow = |v: glam::DVec3| v.to_array().map(|v| v as f32);
        DeviceRay {
            start: narrow(ray.at(entry) - self.origin),
            entry: entry as f32,
            direction: narrow(ray.direction),
            length: (exit - entry) as f32,
            ..DeviceRay::default()
        }
    }

    /// Sees to buffers for `rays` rays and `pixels` pixels.
    fn make_room(&mut self, rays: u64, pixels: u64) -> Result<(), GpuError> {
        let limit = self.gpu.binding_limit() / size_of::<PixelPair>() as u64;
        if pixels > limit {
            return Err(GpuError::TooLarge { what: "pixels of a picture", found: pixels, limit });
        }
        let at_once = rays.min(u64::from(self.gpu.most_rays_at_once())).max(u64::from(RAY_LANES));
        let at_once = (at_once as u32).next_multiple_of(RAY_LANES);
        if self.workspace.rays_at_once() < at_once || self.workspace.pixel_count() < pixels {
            let at_once = at_once.max(self.workspace.rays_at_once());
            let pixels = pixels.max(self.workspace.pixel_count());
            self.workspace = Workspace::new(&self.gpu, at_once, pixels);
        }
        Ok(())
    }

    async fn read_pixels(&self, count: usize) -> Result<Vec<Pixel>, GpuError> {
        let bytes = (count * size_of::<PixelPair>()) as u64;
        if bytes == 0 {
            return Ok(Vec::new());
        }
        let back = self.gpu.buffer("pixels back", bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&self.workspace.pixels, 0, &back, 0, Some(bytes));
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.gpu.read(&back).await?;
        let pixel = |p: &PixelPair| Pixel { color: p.color, opacity: p.opacity, depth: p.depth };
        Ok(bytemuck::cast_slice(&bytes).iter().map(pixel).collect())
    }
}

impl Gpu {
    /// What it has limits for.
    fn limits(&self) -> BufferLimits {
        let limits = self.device.limits();
        BufferLimits {
            // Rays, samples and counters take three bindings of a stage.
            chunks: limits.max_storage_buffers_per_shader_stage.saturating_sub(3),
            chunk_shift: shader::CHUNK_SHIFT,
            workgroup_bytes: limits.max_compute_workgroup_storage_size,
            extensions: self.extensions(),
        }
    }

    fn pipeline(&self, stage: Stage, shape: &shader::Shape) -> wgpu::ComputePipeline {
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(stage.name()),
            source: wgpu::ShaderSource::Wgsl(stage.source(shape).into()),
        });
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(stage.name()),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    }

    fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.device.create_buffer(&descriptor)
    }

    fn upload(&self, label: &str, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let buffer = self.buffer(label, bytes.len() as u64, usage);
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::shader::Extensions;
    use super::*;
    use crate::container;

    fn fixture(bytes: &[u8]) -> (Scene, Camera) {
        let scene = container::decode(bytes).unwrap();
        let distance = 0.5 * (scene.frame.near + scene.frame.far);
        let away = scene.bounds.center() + distance * DVec3::new(0.6, 0.5, 0.4).normalize();
        let camera = Camera::looking_at([24, 24], 40.0, away, scene.bounds.center(), DVec3::Z);
        (scene, camera)
    }

    fn picture(
        gpu: &Gpu,
        (scene, camera): &(Scene, Camera),
        precision: Precision,
        limits: BufferLimits,
    ) -> (Picture, usize) {
        let renderer = GpuRenderer::with_room(gpu, scene.clone(), &Approximation::default(), precision, limits);
        let mut renderer = renderer.unwrap();
        let picture = renderer.render(camera).unwrap();
        assert!(picture.pixels.iter().any(|p| p.opacity > 0.1));
        (picture, renderer.chunks.len())
    }

    /// A scene of 128 MiB is too much for a test: bindings of 4 KiB are as many.
    #[test]
    fn a_scene_in_many_bindings_is_the_same() {
        let gpu = Gpu::open().unwrap();
        let scene = fixture(include_bytes!("../../../fixtures/v1/occupancy.strivec"));
        for precision in [Precision::F32, Precision::F16] {
            let (whole, _) = picture(&gpu, &scene, precision, gpu.limits());
            let (split, chunks) = picture(&gpu, &scene, precision, BufferLimits { chunk_shift: 8, ..gpu.limits() });
            assert!(chunks > 2);
            assert_eq!(whole, split);
        }
        let small = BufferLimits { chunks: 2, chunk_shift: 4, ..gpu.limits() };
        let refused = Packed::new(&Field::consuming(scene.0), Precision::F32, small).err();
        assert!(
            matches!(refused, Some(GpuError::TooLarge { what: "bytes of the scene", limit: 512, .. })),
            "{refused:?}"
        );
    }

    #[test]
    fn a_device_without_extensions_draws_the_same() {
        let gpu = Gpu::open().unwrap();
        println!("{:?}", gpu.extensions());
        let plain = BufferLimits { extensions: Extensions::default(), ..gpu.limits() };
        for bytes in [
            &include_bytes!("../../../fixtures/v1/occupancy.strivec")[..],
            include_bytes!("../../../fixtures/v1/per-ray.strivec"),
            include_bytes!("../../../fixtures/v1/residual.strivec"),
        ] {
            let scene = fixture(bytes);
            let [with, without] = [gpu.limits(), plain].map(|limits| picture(&gpu, &scene, Precision::F32, limits).0);
            assert_eq!(with, without);
            // Numbers of 16 bits within the decoder are rounded; factors are in both.
            let [with, without] = [gpu.limits(), plain].map(|limits| picture(&gpu, &scene, Precision::F16, limits).0);
            let far = (with.pixels.iter().zip(&without.pixels))
                .flat_map(|(a, b)| [0, 1, 2].map(|c| (a.color[c] - b.color[c]).abs()))
                .fold(0.0, f32::max);
            assert!(far < 1e-3, "{far}");
        }
    }
}

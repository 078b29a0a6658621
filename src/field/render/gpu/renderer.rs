//! A scene on a graphics device: buffers, pipelines, and the pictures made with them.

use super::device::Gpu;
use super::error::GpuError;
use super::job::{Drawing, Job};
use super::layout::{FrameUniforms, PixelPair, Ray as DeviceRay, SceneHead};
use super::packed::{BufferLimits, Packed};
use super::shader::{Precision, RAY_LANES, ShaderStage, TILE};
use super::workspace::{StageTime, Workspace};
use crate::Field;
use crate::render::{Approximation, Picture, Pixel};
use strivec_format::geometry::{Aabb, Camera, Contraction, Ray, RayPath};
use strivec_format::model::Scene;

/// Renders a scene on a graphics device: whole pictures, or batch by batch with [`GpuRenderer::begin`] and
/// [`GpuRenderer::advance`].
#[derive(Debug)]
pub struct GpuRenderer {
    pub(super) gpu: Gpu,
    /// \[stage\] its pipeline.
    pub(super) pipelines: Vec<wgpu::ComputePipeline>,
    /// The uniform `scene`.
    pub(super) scene: wgpu::Buffer,
    pub(super) scene_buffer: SceneBuffer,
    pub(super) workspace: Workspace,
    /// The picture being drawn.
    pub(super) job: Option<Job>,
    pub(super) has_normals: bool,
    /// The most strides of a ray in a march pass, and the number of passes that rays have needed so far.
    pub(super) strides: u32,
    pub(super) passes: u32,
    /// \[stage\] times, while stages are timed.
    pub(super) times: Vec<StageTime>,
    origin: glam::DVec3,
    bounds: Aabb,
    contraction: Option<Contraction>,
    near_far: [f64; 2],
    background: [f32; 3],
}

/// The scene buffer on the device.
#[derive(Debug)]
pub(super) enum SceneBuffer {
    /// Split over bindings.
    Chunks(Vec<wgpu::Buffer>),
    /// For a software device.
    Texture(wgpu::Texture),
}

impl SceneBuffer {
    /// Bytes of device memory.
    fn bytes(&self) -> u64 {
        match self {
            Self::Chunks(chunks) => chunks.iter().map(wgpu::Buffer::size).sum(),
            Self::Texture(texture) => 16 * u64::from(texture.width()) * u64::from(texture.height()),
        }
    }
}

/// Maximum loop iterations per invocation on software adapters. Mesa's llvmpipe silently ends the loops of a workgroup
/// after 65 535 iterations, some of which serve other invocations of the group.
const MAX_ITERATIONS: u32 = 1 << 15;
/// A number of strides that few rays exceed.
const USUAL_STRIDES: u32 = 1024;

impl GpuRenderer {
    /// Prepares `scene`, which must have passed [`Scene::check`], with `approximation`.
    ///
    /// # Errors
    ///
    /// If an option is out of range, or the scene exceeds a limit of the device or takes more memory than it may.
    pub fn new(gpu: &Gpu, scene: Scene, approximation: &Approximation, precision: Precision) -> Result<Self, GpuError> {
        Self::with_limits(gpu, scene, approximation, precision, gpu.scene_limits())
    }

    /// Prepares `scene` like [`GpuRenderer::new`], within `limits`.
    fn with_limits(
        gpu: &Gpu,
        mut scene: Scene,
        approximation: &Approximation,
        precision: Precision,
        limits: BufferLimits,
    ) -> Result<Self, GpuError> {
        approximation.check(&scene)?;
        let own = approximation.reduce(&mut scene);
        let field = Field::<f32>::from_scene(&mut scene)?;
        let packed = Packed::new(&field, &own, precision, limits)?;
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let scene = gpu.upload("scene", &packed.scene, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST);
        let scene_buffer = if limits.is_software {
            SceneBuffer::Texture(gpu.upload_texture("quads", &packed.words))
        } else {
            let chunks = packed.words.chunks(4 << limits.chunk_shift);
            SceneBuffer::Chunks(chunks.map(|words| gpu.upload("quads", bytemuck::cast_slice(words), storage)).collect())
        };
        let pipelines = ShaderStage::ALL.map(|stage| gpu.pipeline(stage, &packed.shape)).into();
        // Software devices end long loops early; others march a ray in one pass.
        let strides = match gpu.info().device_type {
            wgpu::DeviceType::Cpu => (MAX_ITERATIONS / packed.iterations_per_sample).max(1),
            _ => u32::MAX,
        };
        gpu.uncaptured_error()?;
        Ok(Self {
            gpu: gpu.clone(),
            pipelines,
            scene,
            scene_buffer,
            workspace: Workspace::new(gpu, RAY_LANES, 1),
            job: None,
            has_normals: false,
            strides,
            passes: USUAL_STRIDES.div_ceil(strides),
            times: Vec::new(),
            origin: field.origin,
            bounds: field.bounds,
            contraction: field.rules.contraction,
            near_far: field.near_far,
            background: field.background,
        })
    }

    /// Renders the picture of `camera`, which is in model space.
    ///
    /// # Errors
    ///
    /// [`GpuError::Device`]; [`GpuError::TooLarge`] for a picture with more pixels than the device supports.
    pub async fn render_async(&mut self, camera: &Camera) -> Result<Picture, GpuError> {
        self.begin(camera)?;
        self.finish().await?;
        let pixels = self.read_pixels(camera.width as usize * camera.height as usize).await?;
        Ok(Picture { width: camera.width, height: camera.height, pixels })
    }

    /// Renders like [`GpuRenderer::render_async`], and returns the time of each stage; no stages if the device has no
    /// timestamps.
    ///
    /// # Errors
    ///
    /// The errors of [`GpuRenderer::render_async`].
    pub async fn render_timed_async(&mut self, camera: &Camera) -> Result<(Picture, Vec<StageTime>), GpuError> {
        if self.gpu.has_timestamps() {
            self.times = ShaderStage::ALL.map(|s| StageTime { name: s.name(), milliseconds: 0.0 }).into();
        }
        let picture = self.render_async(camera).await;
        let times = std::mem::take(&mut self.times);
        Ok((picture?, times))
    }

    /// The pixels of `rays`, which are in model space.
    ///
    /// # Errors
    ///
    /// The errors of [`GpuRenderer::render_async`].
    pub async fn trace_async(&mut self, rays: &[Ray]) -> Result<Vec<Pixel>, GpuError> {
        self.begin_rays(rays.iter().map(|ray| self.device_ray(ray)).collect())?;
        self.finish().await?;
        self.read_pixels(rays.len()).await
    }

    /// Begins the pixels of `rays`.
    fn begin_rays(&mut self, rays: Vec<DeviceRay>) -> Result<(), GpuError> {
        self.abandon();
        let count = rays.len();
        self.reserve(count as u64, count as u64)?;
        let frame = FrameUniforms { rays_are_given: 1, ..FrameUniforms::default() };
        self.job = Some(Job::new(frame, count as u32, rays, self.workspace.batch_rays()));
        Ok(())
    }

    /// Begins the picture of `camera`, which is in model space, and abandons any unfinished one.
    /// [`GpuRenderer::advance`] draws it.
    ///
    /// # Errors
    ///
    /// [`GpuError::TooLarge`] for a picture with more pixels than the device supports.
    pub fn begin(&mut self, camera: &Camera) -> Result<(), GpuError> {
        if !camera.lens.is_pinhole() {
            // The device inverts no distortion. A pixel without a ray has an empty one.
            // A negative unit of spacing marks it, so that it does not see the sky.
            let unseen = DeviceRay { direction: [0.0, 0.0, 1.0], scale: -1.0, ..DeviceRay::default() };
            let ray = |ray: Option<Ray>| ray.map_or(unseen, |ray| self.device_ray(&ray));
            return self.begin_rays(camera.rays(0..camera.height).map(ray).collect());
        }
        self.abandon();
        let tiles = u64::from(camera.width.div_ceil(TILE)) * u64::from(camera.height.div_ceil(TILE));
        let rays = tiles * u64::from(TILE * TILE);
        self.reserve(rays, u64::from(camera.width) * u64::from(camera.height))?;
        let axis = |column: usize| camera.world_from_camera.col(column).to_array().map(|v| v as f32);
        let frame = FrameUniforms {
            // Relative to the origin in f64, then rounded: a scene's place in the world costs no precision
            // (docs/numerics.md).
            position: (camera.position - self.origin).to_array().map(|v| v as f32),
            width: camera.width,
            right: axis(0),
            height: camera.height,
            up: axis(1),
            back: axis(2),
            focal: camera.focal.map(|v| v as f32),
            principal: camera.principal.map(|v| v as f32),
            ..FrameUniforms::default()
        };
        self.job = Some(Job::new(frame, rays as u32, Vec::new(), self.workspace.batch_rays()));
        Ok(())
    }

    /// Draws the picture that was begun, to its end.
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

    /// Abandons the picture that was begun. A batch in flight completes, and its result is discarded.
    fn abandon(&mut self) {
        if self.job.take().is_some_and(|job| job.completion().is_some()) {
            self.workspace.counters_back.unmap();
        }
    }

    /// The scene's background color in sRGB.
    pub fn background(&self) -> [f32; 3] {
        self.background
    }

    /// Turns normals on or off for pictures that are begun from now on.
    pub fn set_normals(&mut self, has_normals: bool) {
        self.has_normals = has_normals;
    }

    /// Begins rays at the distance `near`, in model units, in pictures that are begun from now on. Abandons an unfinished
    /// one.
    pub fn set_near(&mut self, near: f64) {
        self.abandon();
        self.near_far[0] = near;
        let at = std::mem::offset_of!(SceneHead, near) as u64;
        self.gpu.queue.write_buffer(&self.scene, at, &(near as f32).to_ne_bytes());
    }

    /// The pixels of the last finished picture, two `vec4<f32>` per pixel as in `shaders/layout.wgsl`.
    pub fn pixels(&self) -> &wgpu::Buffer {
        &self.workspace.pixels
    }

    /// Bytes of device memory: of the scene, and of the batch and picture buffers.
    pub fn memory_bytes(&self) -> [u64; 2] {
        [self.scene.size() + self.scene_buffer.bytes(), self.workspace.bytes()]
    }

    /// `ray` as the first stage computes it, but in 64 bits.
    fn device_ray(&self, ray: &Ray) -> DeviceRay {
        let path = RayPath::new(ray, &self.bounds, self.contraction, self.near_far);
        let (first, end) = path.span.filter(|(first, end)| first <= end).unwrap_or((0.0, 0.0));
        let (entry, scale) = path.contraction().map_or((first, 1.0), |(_, s)| (s.foot_distance, s.scale));
        let narrow = |v: glam::DVec3| v.to_array().map(|v| v as f32);
        DeviceRay {
            start: narrow(ray.at(entry) - self.origin),
            entry: entry as f32,
            direction: narrow(ray.direction),
            length: (end - first) as f32,
            scale: scale as f32,
            first: first as f32,
            ..DeviceRay::default()
        }
    }

    /// Enlarges the buffers, if necessary, for `rays` rays and `pixels` pixels.
    fn reserve(&mut self, rays: u64, pixels: u64) -> Result<(), GpuError> {
        let limit = self.gpu.binding_limit() / size_of::<PixelPair>() as u64;
        if pixels > limit {
            return Err(GpuError::TooLarge { what: "pixels in a picture", found: pixels, limit });
        }
        let batch_rays = rays.min(u64::from(self.gpu.max_batch_rays())).max(u64::from(RAY_LANES));
        let batch_rays = (batch_rays as u32).next_multiple_of(RAY_LANES);
        // Buffers only grow, so that pictures of changing size do not allocate each time.
        if self.workspace.batch_rays() < batch_rays || self.workspace.pixel_count() < pixels {
            let batch_rays = batch_rays.max(self.workspace.batch_rays());
            let pixels = pixels.max(self.workspace.pixel_count());
            self.workspace = Workspace::new(&self.gpu, batch_rays, pixels);
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::shader::Extensions;
    use super::*;
    use crate::render::approximation::OwnThresholds;
    use strivec_format::container;

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
        let renderer = GpuRenderer::with_limits(gpu, scene.clone(), &Approximation::default(), precision, limits);
        let mut renderer = renderer.unwrap();
        let picture = renderer.render(camera).unwrap();
        assert!(picture.pixels.iter().any(|p| p.opacity > 0.1));
        let chunks = match &renderer.scene_buffer {
            SceneBuffer::Chunks(chunks) => chunks.len(),
            SceneBuffer::Texture(_) => 0,
        };
        (picture, chunks)
    }

    /// A scene of more than 128 MiB is too large for a test; bindings of 4 KiB split a small scene as often.
    #[test]
    fn a_scene_in_many_bindings_is_the_same() {
        let gpu = Gpu::open().unwrap().as_hardware();
        let scene =
            fixture(include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/occupancy.strivec")));
        for precision in [Precision::F32, Precision::F16] {
            let (whole, _) = picture(&gpu, &scene, precision, gpu.scene_limits());
            let (split, chunks) =
                picture(&gpu, &scene, precision, BufferLimits { chunk_shift: 8, ..gpu.scene_limits() });
            assert!(chunks > 2);
            assert_eq!(whole, split);
        }
        let small = BufferLimits { chunks: 2, chunk_shift: 4, ..gpu.scene_limits() };
        let refused =
            Packed::new(&Field::unlimited(&scene.0), &OwnThresholds::of(&scene.0.rules), Precision::F32, small).err();
        assert!(
            matches!(refused, Some(GpuError::TooLarge { what: "bytes of scene data", limit: 512, .. })),
            "{refused:?}"
        );
    }

    #[test]
    fn a_device_without_extensions_draws_the_same() {
        let gpu = Gpu::open().unwrap();
        println!("{:?}", gpu.scene_limits().extensions);
        let plain = BufferLimits { extensions: Extensions::default(), ..gpu.scene_limits() };
        for bytes in [
            &include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/occupancy.strivec"))[..],
            include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/per-ray.strivec")),
            include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/residual.strivec")),
        ] {
            let scene = fixture(bytes);
            let [with, without] =
                [gpu.scene_limits(), plain].map(|limits| picture(&gpu, &scene, Precision::F32, limits).0);
            assert_eq!(with, without);
            // The decoder's activations are rounded to 16 bits in one of them, the factors in both.
            let [with, without] =
                [gpu.scene_limits(), plain].map(|limits| picture(&gpu, &scene, Precision::F16, limits).0);
            let far = (with.pixels.iter().zip(&without.pixels))
                .flat_map(|(a, b)| [0, 1, 2].map(|c| (a.color[c] - b.color[c]).abs()))
                .fold(0.0, f32::max);
            assert!(far < 1e-3, "{far}");
        }
    }
}

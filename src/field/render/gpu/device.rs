//! The graphics device: selection, capabilities, buffers and pipelines.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Poll, Waker};

use super::error::GpuError;
use super::packed::BufferLimits;
use super::shader::{CHUNK_SHIFT, Extensions, ShaderShape, ShaderStage, TEXTURE_SHIFT};

/// An open device.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    adapter: wgpu::Adapter,
    info: wgpu::AdapterInfo,
    /// True if shaders are made for a software device.
    is_software: bool,
    /// The first uncaptured device error.
    uncaptured_error: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Requests a device of `instance` that can present to `surface`, if one is given.
    ///
    /// # Errors
    ///
    /// [`GpuError::NoAdapter`], [`GpuError::Device`].
    pub async fn request(instance: &wgpu::Instance, surface: Option<&wgpu::Surface<'_>>) -> Result<Self, GpuError> {
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: surface,
            ..wgpu::RequestAdapterOptions::default()
        };
        let adapter = instance.request_adapter(&options).await.map_err(|e| GpuError::NoAdapter(e.to_string()))?;
        let own = adapter.limits();
        let required_limits = wgpu::Limits {
            max_buffer_size: own.max_buffer_size,
            max_storage_buffer_binding_size: own.max_storage_buffer_binding_size,
            max_storage_buffers_per_shader_stage: own.max_storage_buffers_per_shader_stage,
            max_compute_workgroup_storage_size: own.max_compute_workgroup_storage_size.min(MAX_WORKGROUP_BYTES),
            // All else is within the downlevel limits, which browsers and old devices have.
            ..wgpu::Limits::downlevel_defaults()
        };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("strivec"),
            // Optional: devices without 16-bit floats, subgroups or timestamps draw the same pictures, but for
            // rounding.
            required_features: adapter.features() & OPTIONAL_FEATURES,
            required_limits: required_limits.using_resolution(own),
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = adapter.request_device(&descriptor).await.map_err(|e| GpuError::Device(e.to_string()))?;
        let uncaptured_error = Arc::new(Mutex::new(None));
        let first = Arc::clone(&uncaptured_error);
        // Without a handler, wgpu ends the process.
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        let info = adapter.get_info();
        let is_software = info.device_type == wgpu::DeviceType::Cpu;
        Ok(Self { device, queue, info, adapter, is_software, uncaptured_error })
    }

    /// This device, with the shaders of a graphics processor also if it is a software device. Pictures stay the same;
    /// for tests.
    #[must_use]
    pub fn as_hardware(self) -> Self {
        Self { is_software: false, ..self }
    }

    /// The adapter's name, driver and kind.
    pub fn info(&self) -> &wgpu::AdapterInfo {
        &self.info
    }

    /// The adapter, for which surfaces are configured.
    pub fn adapter(&self) -> &wgpu::Adapter {
        &self.adapter
    }

    /// The device, for callers that draw on it.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// The device's queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// True if the device has timestamps, which time the stages.
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// The device's limits for a scene.
    pub(super) fn scene_limits(&self) -> BufferLimits {
        let limits = self.device.limits();
        BufferLimits {
            // Rays, samples and counters take three bindings of a stage.
            chunks: limits.max_storage_buffers_per_shader_stage.saturating_sub(3),
            chunk_shift: CHUNK_SHIFT,
            texture_rows: limits.max_texture_dimension_2d,
            workgroup_bytes: limits.max_compute_workgroup_storage_size,
            extensions: self.extensions(),
            is_software: self.is_software,
        }
    }

    /// The WGSL extensions that the device supports.
    fn extensions(&self) -> Extensions {
        let features = self.device.features();
        Extensions {
            f16: features.contains(wgpu::Features::SHADER_F16),
            subgroups: features.contains(wgpu::Features::SUBGROUP),
        }
    }

    /// Takes the first uncaptured error since the last call.
    pub(super) fn uncaptured_error(&self) -> Result<(), GpuError> {
        let uncaptured_error = self.uncaptured_error.lock().unwrap_or_else(PoisonError::into_inner).take();
        uncaptured_error.map_or(Ok(()), |text| Err(GpuError::Device(text)))
    }

    /// Waits until all submitted work is done, but at most for `time`.
    ///
    /// # Errors
    ///
    /// [`GpuError::Device`].
    pub fn wait_for(&self, time: std::time::Duration) -> Result<(), GpuError> {
        match self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(time) }) {
            Ok(_) | Err(wgpu::PollError::Timeout) => Ok(()),
            Err(e) => Err(GpuError::Device(e.to_string())),
        }
    }

    /// The compute pipeline of `stage` for scenes of `shape`.
    pub(super) fn pipeline(&self, stage: ShaderStage, shape: &ShaderShape) -> wgpu::ComputePipeline {
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

    pub(super) fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.device.create_buffer(&descriptor)
    }

    /// A new buffer of `bytes`.
    pub(super) fn upload(&self, label: &str, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let buffer = self.buffer(label, bytes.len() as u64, usage);
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    /// A new texture of the quads `words`, in rows of 1 << [`TEXTURE_SHIFT`].
    pub(super) fn upload_texture(&self, label: &str, words: &[u32]) -> wgpu::Texture {
        let extent = |width: usize, height: usize| wgpu::Extent3d {
            width: width as u32,
            height: height as u32,
            depth_or_array_layers: 1,
        };
        let width = 1 << TEXTURE_SHIFT;
        let rows = words.chunks(4 * width);
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: extent(width, rows.len().max(1)),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        for (y, row) in (0..).zip(rows) {
            let to = wgpu::TexelCopyTextureInfo { origin: wgpu::Origin3d { x: 0, y, z: 0 }, ..texture.as_image_copy() };
            let bytes = bytemuck::cast_slice(row);
            self.queue.write_texture(to, bytes, wgpu::TexelCopyBufferLayout::default(), extent(row.len() / 4, 1));
        }
        texture
    }

    /// Reads the bytes of `buffer`, which must be mappable, after all work submitted before.
    pub(super) async fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        let mapping = Mapping::new(buffer);
        mapping.clone().ended().await;
        mapping.result().unwrap_or(Ok(()))?;
        let bytes = buffer.get_mapped_range(..).map_err(|e| GpuError::Device(e.to_string()))?.to_vec();
        buffer.unmap();
        Ok(bytes)
    }
}

/// A buffer that is being mapped for reading.
#[derive(Clone, Debug)]
pub(super) struct Mapping(Arc<Mutex<MappingState>>);

/// The result of a mapping, and the task that waits for it.
#[derive(Debug, Default)]
struct MappingState {
    ended: Option<Result<(), String>>,
    waiting: Option<Waker>,
}

impl Mapping {
    /// Begins to map `buffer`.
    pub(super) fn new(buffer: &wgpu::Buffer) -> Self {
        let here = Self(Arc::default());
        let there = here.clone();
        buffer.map_async(wgpu::MapMode::Read, .., move |result| {
            let mut state = there.lock();
            state.ended = Some(result.map_err(|e| e.to_string()));
            if let Some(waiting) = state.waiting.take() {
                waiting.wake();
            }
        });
        here
    }

    fn lock(&self) -> MutexGuard<'_, MappingState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The result; `None` while the mapping is pending.
    pub(super) fn result(&self) -> Option<Result<(), GpuError>> {
        self.lock().ended.clone().map(|ended| ended.map_err(GpuError::Device))
    }

    /// Completes when the mapping has ended.
    pub(super) fn ended(self) -> impl Future<Output = ()> + use<> {
        std::future::poll_fn(move |context| {
            let mut state = self.lock();
            if state.ended.is_some() {
                return Poll::Ready(());
            }
            state.waiting = Some(context.waker().clone());
            Poll::Pending
        })
    }
}

/// The most workgroup memory requested, in bytes. Larger decoder tiles would reduce occupancy.
const MAX_WORKGROUP_BYTES: u32 = 32 << 10;

/// Features that are requested if the device supports them.
const OPTIONAL_FEATURES: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::SHADER_F16).union(wgpu::Features::SUBGROUP);

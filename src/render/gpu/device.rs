//! The graphics processor: finding one, and what it can do.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Poll, Waker};

use super::GpuError;
use super::shader::Extensions;

/// An open device.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    adapter: wgpu::Adapter,
    info: wgpu::AdapterInfo,
    /// What the device has complained of first, where nobody asked it to.
    uncaptured_error: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// A device of `instance` that can show on `surface`, where there is one.
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
            ..wgpu::Limits::downlevel_defaults()
        };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("strivec"),
            required_features: adapter.features() & OPTIONAL_FEATURES,
            required_limits: required_limits.using_resolution(own),
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = adapter.request_device(&descriptor).await.map_err(|e| GpuError::Device(e.to_string()))?;
        let uncaptured_error = Arc::new(Mutex::new(None));
        let first = Arc::clone(&uncaptured_error);
        // Without this the process would end.
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        Ok(Self { device, queue, info: adapter.get_info(), adapter, uncaptured_error })
    }

    /// Name, driver and kind.
    pub fn info(&self) -> &wgpu::AdapterInfo {
        &self.info
    }

    /// What surfaces are made for.
    pub fn adapter(&self) -> &wgpu::Adapter {
        &self.adapter
    }

    /// The device, for those who draw on it.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// Its queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// Whether stages can be timed.
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// What it has of WGSL's extensions.
    pub(super) fn extensions(&self) -> Extensions {
        let features = self.device.features();
        Extensions {
            f16: features.contains(wgpu::Features::SHADER_F16),
            subgroups: features.contains(wgpu::Features::SUBGROUP),
        }
    }

    /// What went wrong on the device, if anything did since this was asked last.
    pub(super) fn uncaptured_error(&self) -> Result<(), GpuError> {
        let uncaptured_error = self.uncaptured_error.lock().unwrap_or_else(PoisonError::into_inner).take();
        uncaptured_error.map_or(Ok(()), |text| Err(GpuError::Device(text)))
    }

    /// Waits for all work that was given to the device, but no longer than `time`.
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

    /// The bytes of `buffer`, which can be mapped, once all work before is done.
    pub(super) async fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        let mapping = Mapping::of(buffer);
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

/// How it ended, and who waits for it.
#[derive(Debug, Default)]
struct MappingState {
    ended: Option<Result<(), String>>,
    waiting: Option<Waker>,
}

impl Mapping {
    /// Begins to map `buffer`.
    pub(super) fn of(buffer: &wgpu::Buffer) -> Self {
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

    /// How it ended; `None` before it has.
    pub(super) fn result(&self) -> Option<Result<(), GpuError>> {
        self.lock().ended.clone().map(|ended| ended.map_err(GpuError::Device))
    }

    /// Its end.
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

/// Larger tiles of the decoder would leave limits for fewer of them at a time.
const MAX_WORKGROUP_BYTES: u32 = 32 << 10;

/// What is used where a device has it.
const OPTIONAL_FEATURES: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::SHADER_F16).union(wgpu::Features::SUBGROUP);

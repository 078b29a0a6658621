//! The graphics processor: finding one, and what it can do.

use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Poll, Waker};

use super::GpuError;

/// An open device.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
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
            max_compute_workgroup_storage_size: own.max_compute_workgroup_storage_size.min(MOST_WORKGROUP_BYTES),
            ..wgpu::Limits::downlevel_defaults()
        };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("strivec"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: required_limits.using_resolution(own),
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = adapter.request_device(&descriptor).await.map_err(|e| GpuError::Device(e.to_string()))?;
        Ok(Self { device, queue, info: adapter.get_info() })
    }

    /// Name, driver and kind.
    pub fn info(&self) -> &wgpu::AdapterInfo {
        &self.info
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

    /// The bytes of `buffer`, which can be mapped, once all work before is done.
    pub(super) async fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        let lost = |e: &dyn std::fmt::Display| GpuError::Device(e.to_string());
        mapped(buffer).await.map_err(|e| lost(&e))?;
        let bytes = buffer.get_mapped_range(..).map_err(|e| lost(&e))?.to_vec();
        buffer.unmap();
        Ok(bytes)
    }
}

/// A mapping under way: how it ended, and who waits for it.
#[derive(Default)]
struct Mapping {
    ended: Option<Result<(), wgpu::BufferAsyncError>>,
    waiting: Option<Waker>,
}

/// Maps `buffer` for reading.
fn mapped(buffer: &wgpu::Buffer) -> impl Future<Output = Result<(), wgpu::BufferAsyncError>> + use<> {
    let here = Arc::new(Mutex::new(Mapping::default()));
    let there = here.clone();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        let mut mapping = there.lock().unwrap_or_else(PoisonError::into_inner);
        mapping.ended = Some(result);
        if let Some(waiting) = mapping.waiting.take() {
            waiting.wake();
        }
    });
    std::future::poll_fn(move |context| {
        let mut mapping = here.lock().unwrap_or_else(PoisonError::into_inner);
        match mapping.ended.take() {
            Some(result) => Poll::Ready(result),
            None => {
                mapping.waiting = Some(context.waker().clone());
                Poll::Pending
            }
        }
    })
}

/// Larger tiles of the decoder would leave room for fewer of them at a time.
const MOST_WORKGROUP_BYTES: u32 = 32 << 10;

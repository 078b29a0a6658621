//! The graphics processor: finding one, and what it can do.

use std::sync::{Arc, Mutex, PoisonError};

use super::GpuError;

/// An open device.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    adapter: wgpu::Adapter,
    info: wgpu::AdapterInfo,
    /// What the device has complained of first, where nobody asked it to.
    complaint: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// The system's best device, or a software one where there is no other.
    ///
    /// # Errors
    ///
    /// [`GpuError::NoAdapter`], [`GpuError::Device`].
    pub fn open() -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        pollster::block_on(Self::request(&instance, None))
    }

    /// A device of `instance` that can show on `surface`, where there is one.
    ///
    /// # Errors
    ///
    /// As [`Gpu::open`]'s.
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
        let complaint = Arc::new(Mutex::new(None));
        let first = Arc::clone(&complaint);
        // Without this the process would end.
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        Ok(Self { device, queue, info: adapter.get_info(), adapter, complaint })
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

    /// What went wrong on the device, if anything did since this was asked last.
    pub(super) fn complaint(&self) -> Result<(), GpuError> {
        let complaint = self.complaint.lock().unwrap_or_else(PoisonError::into_inner).take();
        complaint.map_or(Ok(()), |text| Err(GpuError::Device(text)))
    }

    /// Waits for all work that was given to the device.
    pub(super) fn wait(&self) -> Result<(), GpuError> {
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| GpuError::Device(e.to_string()))?;
        Ok(())
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

    /// The bytes of `buffer`, which can be mapped; waits for all work before.
    pub(super) fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        let (sender, receiver) = std::sync::mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |mapped| drop(sender.send(mapped)));
        let lost = |e: &dyn std::fmt::Display| GpuError::Device(e.to_string());
        self.wait()?;
        receiver.try_recv().map_err(|e| lost(&e))?.map_err(|e| lost(&e))?;
        let bytes = buffer.get_mapped_range(..).map_err(|e| lost(&e))?.to_vec();
        buffer.unmap();
        Ok(bytes)
    }
}

/// Larger tiles of the decoder would leave room for fewer of them at a time.
const MOST_WORKGROUP_BYTES: u32 = 32 << 10;

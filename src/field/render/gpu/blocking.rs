//! Blocking versions of the asynchronous calls, for native targets. In a browser, blocking the thread would block the
//! device.

use std::pin::pin;
use std::task::{Context, Poll, Waker};

use super::device::Gpu;
use super::error::GpuError;
use super::renderer::GpuRenderer;
use super::workspace::StageTime;
use crate::render::{Picture, Pixel};
use strivec_format::geometry::{Camera, Ray};

impl Gpu {
    /// Opens the system's best device, or a software device if there is no other.
    ///
    /// # Errors
    ///
    /// [`GpuError::NoAdapter`], [`GpuError::Device`].
    pub fn open() -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        pollster::block_on(Self::request(&instance, None))
    }

    /// Runs `work`, which may wait for this device only, to its end.
    fn block_on<T>(&self, work: impl Future<Output = Result<T, GpuError>>) -> Result<T, GpuError> {
        let mut work = pin!(work);
        let mut context = Context::from_waker(Waker::noop());
        loop {
            if let Poll::Ready(result) = work.as_mut().poll(&mut context) {
                return result;
            }
            let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
            waited.map_err(|e| GpuError::Device(e.to_string()))?;
        }
    }
}

impl GpuRenderer {
    /// Renders the picture of `camera`, which is in model space.
    ///
    /// # Errors
    ///
    /// [`GpuError::Device`]; [`GpuError::TooLarge`] for a picture with more pixels than the device supports.
    pub fn render(&mut self, camera: &Camera) -> Result<Picture, GpuError> {
        self.gpu.clone().block_on(self.render_async(camera))
    }

    /// Renders like [`GpuRenderer::render`], and returns the time of each stage; no stages if the device has no
    /// timestamps.
    ///
    /// # Errors
    ///
    /// The errors of [`GpuRenderer::render`].
    pub fn render_timed(&mut self, camera: &Camera) -> Result<(Picture, Vec<StageTime>), GpuError> {
        self.gpu.clone().block_on(self.render_timed_async(camera))
    }

    /// The pixels of `rays`, which are in model space.
    ///
    /// # Errors
    ///
    /// The errors of [`GpuRenderer::render`].
    pub fn trace(&mut self, rays: &[Ray]) -> Result<Vec<Pixel>, GpuError> {
        self.gpu.clone().block_on(self.trace_async(rays))
    }
}

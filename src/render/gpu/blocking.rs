//! The same work for those who wait. In a browser there is no waiting: the device goes on only when the page's own work is
//! done.

use std::pin::pin;
use std::task::{Context, Poll, Waker};

use super::{Gpu, GpuError, GpuRenderer, StageTime};
use crate::geometry::{Camera, Ray};
use crate::render::{Picture, Pixel};

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

    /// What `work`, which waits for nothing but this device, comes to.
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
    /// The picture that `camera`, in the model's space, takes.
    ///
    /// # Errors
    ///
    /// [`GpuError::Device`], and [`GpuError::TooLarge`] for a picture of more pixels than the device takes.
    pub fn render(&mut self, camera: &Camera) -> Result<Picture, GpuError> {
        self.gpu.clone().block_on(self.render_async(camera))
    }

    /// As [`GpuRenderer::render`], and what each stage took; without stages where the device does not tell.
    ///
    /// # Errors
    ///
    /// As [`GpuRenderer::render`]'s.
    pub fn render_timed(&mut self, camera: &Camera) -> Result<(Picture, Vec<StageTime>), GpuError> {
        self.gpu.clone().block_on(self.render_timed_async(camera))
    }

    /// What each of `rays`, in the model's space, sees.
    ///
    /// # Errors
    ///
    /// As [`GpuRenderer::render`]'s.
    pub fn trace(&mut self, rays: &[Ray]) -> Result<Vec<Pixel>, GpuError> {
        self.gpu.clone().block_on(self.trace_async(rays))
    }
}

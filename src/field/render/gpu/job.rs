//! The state of a picture that is drawn batch by batch.

use super::device::Mapping;
use super::layout::{FrameUniforms, Ray};

/// The progress of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drawing {
    /// Some rays are not done: call [`super::GpuRenderer::advance`] again.
    Unfinished {
        /// Number of rays done.
        done: u32,
        /// Number of rays of the picture.
        rays: u32,
    },
    /// All rays are done.
    Finished,
}

/// A picture that is being drawn.
#[derive(Debug)]
pub(super) struct Job {
    /// The uniforms that all batches have in common.
    pub(super) frame: FrameUniforms,
    /// The rays, if they are given instead of a camera.
    pub(super) given: Vec<Ray>,
    pub(super) rays: u32,
    pub(super) done: u32,
    /// The most rays of a batch: their samples have fit the buffers so far.
    pub(super) batch_rays: u32,
    pub(super) in_flight: Option<InFlightBatch>,
}

/// A submitted batch.
#[derive(Debug)]
pub(super) struct InFlightBatch {
    pub(super) rays: u32,
    /// The mapping of its counters.
    pub(super) mapping: Mapping,
}

impl Job {
    pub(super) fn new(frame: FrameUniforms, rays: u32, given: Vec<Ray>, batch_rays: u32) -> Self {
        Self { frame, given, rays, done: 0, batch_rays, in_flight: None }
    }

    /// Completes at the end of the batch in flight; `None` if there is none.
    pub(super) fn completion(&self) -> Option<impl Future<Output = ()> + use<>> {
        self.in_flight.as_ref().map(|batch| batch.mapping.clone().ended())
    }
}

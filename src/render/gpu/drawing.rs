//! One picture, batch after batch. Nothing here waits for the device: whoever draws asks again.

use super::device::Mapping;
use super::layout::{Counters, Frame, Ray};
use super::shader::{COMPACT_LANES, FIRST_CHUNK, RAY_LANES, Stage};
use super::{Gpu, GpuError, GpuRenderer};

/// Twice the samples that a ray of a sound scene may take.
const MAX_STRIDES: u64 = 1 << 21;

/// How far a picture is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drawing {
    /// Some rays are missing: ask again.
    Unfinished {
        /// Rays that are done.
        done: u32,
        /// Rays in all.
        rays: u32,
    },
    /// All rays are done.
    Finished,
}

/// A picture that is being drawn.
#[derive(Debug)]
pub(super) struct Job {
    /// What all batches have in common.
    frame: Frame,
    /// The rays, where no camera gives them.
    given: Vec<Ray>,
    rays: u32,
    done: u32,
    /// Rays whose samples have limits together, as far as is known.
    at_once: u32,
    flight: Option<InFlightBatch>,
}

/// A batch that the device is at.
#[derive(Debug)]
struct InFlightBatch {
    rays: u32,
    /// Of its counters.
    mapping: Mapping,
}

impl Job {
    pub(super) fn new(frame: Frame, rays: u32, given: Vec<Ray>, at_once: u32) -> Self {
        Self { frame, given, rays, done: 0, at_once, flight: None }
    }

    /// The end of the batch that the device is at, if it is at one.
    pub(super) fn completion(&self) -> Option<impl Future<Output = ()> + use<>> {
        self.flight.as_ref().map(|flight| flight.mapping.clone().ended())
    }
}

impl GpuRenderer {
    /// Looks whether the device is done with the last batch of the picture that was begun, and if so gives it the next one,
    /// of at most `most_rays` rays. Never waits.
    ///
    /// # Errors
    ///
    /// [`GpuError::Device`]; [`GpuError::TooLarge`] where the samples of a few rays have no limits.
    pub fn advance(&mut self, most_rays: u32) -> Result<Drawing, GpuError> {
        let Some(mut job) = self.job.take() else { return Ok(Drawing::Finished) };
        let advanced = self.advance_job(&mut job, most_rays);
        if matches!(advanced, Ok(Drawing::Unfinished { .. })) {
            self.job = Some(job);
        }
        advanced
    }

    fn advance_job(&mut self, job: &mut Job, most_rays: u32) -> Result<Drawing, GpuError> {
        self.gpu.uncaptured_error()?;
        if let Some(flight) = &job.flight {
            self.gpu.device.poll(wgpu::PollType::Poll).map_err(|e| GpuError::Device(e.to_string()))?;
            match flight.mapping.result() {
                None => return Ok(Drawing::Unfinished { done: job.done, rays: job.rays }),
                Some(mapped) => mapped.and_then(|()| self.land(job))?,
            }
        }
        if job.done >= job.rays {
            return Ok(Drawing::Finished);
        }
        let rays = job.at_once.min(most_rays).min(job.rays - job.done).max(1);
        job.flight = Some(self.submit(job, rays));
        Ok(Drawing::Unfinished { done: job.done, rays: job.rays })
    }

    /// Books the batch that the device is done with.
    fn land(&mut self, job: &mut Job) -> Result<(), GpuError> {
        let Some(InFlightBatch { rays, .. }) = job.flight.take() else { return Ok(()) };
        let back = &self.workspace.counters_back;
        let counters: Counters = {
            let bytes = back.get_mapped_range(..).map_err(|e| GpuError::Device(e.to_string()))?;
            bytemuck::pod_read_unaligned(&bytes)
        };
        back.unmap();
        let limits = self.workspace.blocks();
        if counters.unfinished > 0 && counters.blocks <= limits {
            // The same rays again, and as many passes for all that come after them.
            if u64::from(self.passes) * u64::from(self.strides) > MAX_STRIDES {
                return Err(GpuError::Device("rays do not come to their end: it leaves loops early".into()));
            }
            self.passes *= 2;
        } else if counters.blocks <= limits {
            job.done += rays;
        } else if rays > RAY_LANES {
            job.at_once = (rays / 2).next_multiple_of(RAY_LANES);
        } else {
            let (found, limit) = (u64::from(counters.blocks), u64::from(limits));
            return Err(GpuError::TooLarge { what: "samples of a few rays", found, limit });
        }
        Ok(())
    }

    /// Gives the device the next `ray_count` rays.
    fn submit(&self, job: &Job, ray_count: u32) -> InFlightBatch {
        let Gpu { device, queue, .. } = &self.gpu;
        let work = &self.workspace;
        let strides = self.strides;
        let frame = Frame { first_ray: job.done, ray_count, blocks: work.blocks(), strides, ..job.frame };
        let given = job.given.get(job.done as usize..(job.done + ray_count) as usize).unwrap_or_default();
        queue.write_buffer(&work.frame, 0, bytemuck::bytes_of(&frame));
        queue.write_buffer(&work.rays, 0, bytemuck::cast_slice(given));
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(&work.counters, 0, None);
        let queries = (!self.times.is_empty()).then(|| work.queries(&self.gpu));
        for (n, (&stage, pipeline)) in Stage::ALL.iter().zip(&self.pipelines).enumerate() {
            let is_left_out = match stage {
                Stage::Rays => !given.is_empty(),
                Stage::Normals => !self.has_normals,
                _ => false,
            };
            if is_left_out {
                continue;
            }
            let timestamp_writes = queries.as_ref().map(|set| wgpu::ComputePassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: Some(2 * n as u32),
                end_of_pass_write_index: Some(2 * n as u32 + 1),
            });
            let descriptor = wgpu::ComputePassDescriptor { label: Some(stage.name()), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &self.bind_group(stage, pipeline), &[]);
            match stage {
                Stage::Rays | Stage::Resolve | Stage::Normals => {
                    pass.dispatch_workgroups(ray_count.div_ceil(RAY_LANES), 1, 1);
                }
                Stage::March => {
                    (0..self.passes).for_each(|_| pass.dispatch_workgroups(ray_count.div_ceil(RAY_LANES), 1, 1));
                }
                Stage::ShadedSamples => pass.dispatch_workgroups(ray_count.div_ceil(COMPACT_LANES), 1, 1),
                Stage::Workgroups => pass.dispatch_workgroups(1, 1, 1),
                Stage::Decoder => pass.dispatch_workgroups_indirect(&work.workgroups, 0),
            }
        }
        encoder.copy_buffer_to_buffer(&work.counters, 0, &work.counters_back, 0, None);
        if let Some(set) = &queries {
            work.resolve_queries(&mut encoder, set);
        }
        queue.submit([encoder.finish()]);
        InFlightBatch { rays: ray_count, mapping: Mapping::of(&work.counters_back) }
    }

    fn bind_group(&self, stage: Stage, pipeline: &wgpu::ComputePipeline) -> wgpu::BindGroup {
        let work = &self.workspace;
        let (bindings, reads_scene) = stage.bindings();
        let buffer = |binding: u32| match binding {
            0 => &self.scene,
            1 => &work.frame,
            2 => &work.rays,
            3 => &work.slots,
            4 => &work.rows,
            5 => &work.counters,
            6 => &work.workgroups,
            _ => &work.pixels,
        };
        let own = bindings.iter().map(|&b| (b, buffer(b)));
        let chunks = (FIRST_CHUNK..).zip(self.chunks.iter().filter(|_| reads_scene));
        let entries: Vec<_> = (own.chain(chunks))
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(stage.name()),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        })
    }
}

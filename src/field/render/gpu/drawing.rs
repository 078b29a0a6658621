//! Drawing a picture batch by batch. Non-blocking: callers poll until the picture is finished.

use super::device::{Gpu, Mapping};
use super::error::GpuError;
use super::job::{Drawing, InFlightBatch, Job};
use super::layout::{Counters, FrameUniforms};
use super::renderer::{GpuRenderer, SceneBuffer};
use super::shader::{COMPACT_LANES, FIRST_CHUNK, RAY_LANES, ShaderStage};

/// The most strides of a ray over all passes: twice the samples that a valid scene allows.
const MAX_STRIDES: u64 = 1 << 21;

impl GpuRenderer {
    /// If the last batch of the picture that was begun is done, submits the next one, of at most `max_rays` rays. Never
    /// waits.
    ///
    /// # Errors
    ///
    /// [`GpuError::Device`]; [`GpuError::TooLarge`] if the samples of the smallest batch do not fit the buffers.
    pub fn advance(&mut self, max_rays: u32) -> Result<Drawing, GpuError> {
        let Some(mut job) = self.job.take() else { return Ok(Drawing::Finished) };
        let advanced = self.advance_job(&mut job, max_rays);
        if matches!(advanced, Ok(Drawing::Unfinished { .. })) {
            self.job = Some(job);
        }
        advanced
    }

    fn advance_job(&mut self, job: &mut Job, max_rays: u32) -> Result<Drawing, GpuError> {
        self.gpu.uncaptured_error()?;
        if let Some(batch) = &job.in_flight {
            self.gpu.device.poll(wgpu::PollType::Poll).map_err(|e| GpuError::Device(e.to_string()))?;
            match batch.mapping.result() {
                None => return Ok(Drawing::Unfinished { done: job.done, rays: job.rays }),
                Some(mapped) => mapped.and_then(|()| self.complete(job))?,
            }
        }
        if job.done >= job.rays {
            return Ok(Drawing::Finished);
        }
        let rays = job.batch_rays.min(max_rays).min(job.rays - job.done).max(1);
        job.in_flight = Some(self.submit(job, rays));
        Ok(Drawing::Unfinished { done: job.done, rays: job.rays })
    }

    /// Books the batch in flight, which is done.
    fn complete(&mut self, job: &mut Job) -> Result<(), GpuError> {
        let Some(InFlightBatch { rays, .. }) = job.in_flight.take() else { return Ok(()) };
        let back = &self.workspace.counters_back;
        let counters: Counters = {
            let bytes = back.get_mapped_range(..).map_err(|e| GpuError::Device(e.to_string()))?;
            bytemuck::pod_read_unaligned(&bytes)
        };
        back.unmap();
        let limit = self.workspace.blocks();
        // No picture depends on passes or batches: rays that did not end are drawn anew.
        if counters.unfinished > 0 && counters.blocks <= limit {
            // Repeat these rays with twice the passes, which all later batches then have too.
            if u64::from(self.passes) * u64::from(self.strides) > MAX_STRIDES {
                return Err(GpuError::Device(
                    "rays did not end within the maximum number of strides: the driver ends loops early".into(),
                ));
            }
            // Twice, so that a driver that needs many passes is found in few repetitions.
            self.passes *= 2;
        } else if counters.blocks <= limit {
            job.done += rays;
        } else if rays > RAY_LANES {
            // The pool of slots was too small for the batch, whose rays have unusually many samples.
            job.batch_rays = (rays / 2).next_multiple_of(RAY_LANES);
        } else {
            let (found, limit) = (u64::from(counters.blocks), u64::from(limit));
            return Err(GpuError::TooLarge { what: "blocks of shaded samples per batch", found, limit });
        }
        Ok(())
    }

    /// Submits the next `ray_count` rays.
    fn submit(&self, job: &Job, ray_count: u32) -> InFlightBatch {
        let Gpu { device, queue, .. } = &self.gpu;
        let work = &self.workspace;
        let strides = self.strides;
        let frame = FrameUniforms { first_ray: job.done, ray_count, blocks: work.blocks(), strides, ..job.frame };
        // Rays of a camera are made on the device.
        let given = job.given.get(job.done as usize..(job.done + ray_count) as usize).unwrap_or_default();
        queue.write_buffer(&work.frame, 0, bytemuck::bytes_of(&frame));
        queue.write_buffer(&work.rays, 0, bytemuck::cast_slice(given));
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(&work.counters, 0, None);
        let queries = (!self.times.is_empty()).then(|| work.queries(&self.gpu));
        for (index, (&stage, pipeline)) in ShaderStage::ALL.iter().zip(&self.pipelines).enumerate() {
            let is_skipped = match stage {
                ShaderStage::Rays => !given.is_empty(),
                ShaderStage::Normals => !self.has_normals,
                _ => false,
            };
            if is_skipped {
                continue;
            }
            let timestamp_writes = queries.as_ref().map(|set| wgpu::ComputePassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: Some(2 * index as u32),
                end_of_pass_write_index: Some(2 * index as u32 + 1),
            });
            let descriptor = wgpu::ComputePassDescriptor { label: Some(stage.name()), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &self.bind_group(stage, pipeline), &[]);
            match stage {
                ShaderStage::Rays | ShaderStage::Resolve | ShaderStage::Normals => {
                    pass.dispatch_workgroups(ray_count.div_ceil(RAY_LANES), 1, 1);
                }
                ShaderStage::March => {
                    // All passes in one submission: the host need not wait to learn which rays are unfinished.
                    (0..self.passes).for_each(|_| pass.dispatch_workgroups(ray_count.div_ceil(RAY_LANES), 1, 1));
                }
                ShaderStage::Compact => pass.dispatch_workgroups(ray_count.div_ceil(COMPACT_LANES), 1, 1),
                ShaderStage::Workgroups => pass.dispatch_workgroups(1, 1, 1),
                // The number of shaded samples is known on the device alone.
                ShaderStage::Decoder => pass.dispatch_workgroups_indirect(&work.workgroups, 0),
            }
        }
        encoder.copy_buffer_to_buffer(&work.counters, 0, &work.counters_back, 0, None);
        if let Some(set) = &queries {
            work.resolve_queries(&mut encoder, set);
        }
        queue.submit([encoder.finish()]);
        InFlightBatch { rays: ray_count, mapping: Mapping::new(&work.counters_back) }
    }

    fn bind_group(&self, stage: ShaderStage, pipeline: &wgpu::ComputePipeline) -> wgpu::BindGroup {
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
        let mut resources: Vec<_> = bindings.iter().map(|&b| (b, buffer(b).as_entire_binding())).collect();
        let view;
        match &self.scene_buffer {
            _ if !reads_scene => {}
            SceneBuffer::Chunks(chunks) => {
                resources.extend((FIRST_CHUNK..).zip(chunks.iter().map(wgpu::Buffer::as_entire_binding)));
            }
            SceneBuffer::Texture(texture) => {
                view = texture.create_view(&wgpu::TextureViewDescriptor::default());
                resources.push((FIRST_CHUNK, wgpu::BindingResource::TextureView(&view)));
            }
        }
        let entries: Vec<_> =
            resources.into_iter().map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(stage.name()),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        })
    }
}

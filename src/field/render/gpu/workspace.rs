//! The buffers of a batch of rays and of a picture, and timestamps.

use super::device::Gpu;
use super::error::GpuError;
use super::layout::{Counters, FrameUniforms, PixelPair, Ray};
use super::shader::{RAY_LANES, SLOTS, ShaderStage};

/// Blocks of shaded samples per ray of a batch. Rays that hit something have about 40 shaded samples, seven to a block.
const BLOCKS_PER_RAY: u32 = 8;
/// The least number of blocks, for small batches whose rays have many shaded samples.
const MIN_BLOCKS: u32 = 1 << 14;
/// The most rays of a batch; larger batches are not faster.
const MAX_RAYS: u32 = 1 << 18;
const ROW_BYTES: u32 = 16;
const SLOT_BYTES: u32 = 8;

/// The time of one stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTime {
    /// The stage's name, the stem of its shader.
    pub name: &'static str,
    /// Milliseconds, over all batches.
    pub milliseconds: f64,
}

/// Buffers for batches of rays, and for a picture.
#[derive(Debug)]
pub(super) struct Workspace {
    batch_rays: u32,
    pub(super) frame: wgpu::Buffer,
    pub(super) rays: wgpu::Buffer,
    pub(super) slots: wgpu::Buffer,
    pub(super) rows: wgpu::Buffer,
    pub(super) counters: wgpu::Buffer,
    pub(super) counters_back: wgpu::Buffer,
    pub(super) workgroups: wgpu::Buffer,
    pub(super) pixels: wgpu::Buffer,
    times: wgpu::Buffer,
    times_back: wgpu::Buffer,
}

impl Gpu {
    /// The most bytes of one storage binding.
    pub(super) fn binding_limit(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// The most rays of a batch whose largest buffer is within the device's limits.
    pub(super) fn max_batch_rays(&self) -> u32 {
        // Rows are the largest buffer of a batch.
        let row_bytes = u64::from(BLOCKS_PER_RAY * (SLOTS - 1) * ROW_BYTES);
        let rays = (self.binding_limit() / row_bytes).min(u64::from(MAX_RAYS)) as u32;
        (rays / RAY_LANES * RAY_LANES).max(RAY_LANES)
    }
}

impl Workspace {
    /// Buffers for batches of `batch_rays` rays and pictures of `pixels` pixels.
    pub(super) fn new(gpu: &Gpu, batch_rays: u32, pixels: u64) -> Self {
        use wgpu::BufferUsages as Usage;
        let blocks = blocks_for(batch_rays);
        let times = 8 * 2 * ShaderStage::ALL.len() as u64;
        let storage = Usage::STORAGE | Usage::COPY_DST;
        let back = Usage::MAP_READ | Usage::COPY_DST;
        Self {
            batch_rays,
            frame: gpu.buffer("frame", size_of::<FrameUniforms>() as u64, Usage::UNIFORM | Usage::COPY_DST),
            rays: gpu.buffer("rays", u64::from(batch_rays) * size_of::<Ray>() as u64, storage),
            slots: gpu.buffer("slots", u64::from(blocks * SLOTS * SLOT_BYTES), storage),
            // One slot of a block holds the number of the next block.
            rows: gpu.buffer("rows", u64::from(blocks * (SLOTS - 1) * ROW_BYTES), storage),
            counters: gpu.buffer("counters", size_of::<Counters>() as u64, storage | Usage::COPY_SRC),
            counters_back: gpu.buffer("counters back", size_of::<Counters>() as u64, back),
            workgroups: gpu.buffer("workgroups", 12, storage | Usage::INDIRECT),
            pixels: gpu.buffer("pixels", pixels.max(1) * size_of::<PixelPair>() as u64, storage | Usage::COPY_SRC),
            times: gpu.buffer("times", times, Usage::QUERY_RESOLVE | Usage::COPY_SRC),
            times_back: gpu.buffer("times back", times, back),
        }
    }

    pub(super) fn batch_rays(&self) -> u32 {
        self.batch_rays
    }

    /// Number of blocks in the pool of slots.
    pub(super) fn blocks(&self) -> u32 {
        blocks_for(self.batch_rays)
    }

    pub(super) fn pixel_count(&self) -> u64 {
        self.pixels.size() / size_of::<PixelPair>() as u64
    }

    pub(super) fn bytes(&self) -> u64 {
        [&self.rays, &self.slots, &self.rows, &self.pixels].iter().map(|buffer| buffer.size()).sum()
    }

    /// A query set of two timestamps per stage.
    pub(super) fn queries(&self, gpu: &Gpu) -> wgpu::QuerySet {
        gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("times"),
            ty: wgpu::QueryType::Timestamp,
            count: 2 * ShaderStage::ALL.len() as u32,
        })
    }

    pub(super) fn resolve_queries(&self, encoder: &mut wgpu::CommandEncoder, set: &wgpu::QuerySet) {
        encoder.resolve_query_set(set, 0..2 * ShaderStage::ALL.len() as u32, &self.times, 0);
        encoder.copy_buffer_to_buffer(&self.times, 0, &self.times_back, 0, None);
    }

    /// Adds the times of the last batch's stages to `times`.
    pub(super) async fn add_times(&self, gpu: &Gpu, times: &mut [StageTime]) -> Result<(), GpuError> {
        let bytes = gpu.read(&self.times_back).await?;
        let ticks: Vec<u64> = bytes.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect();
        for (time, [start, end]) in times.iter_mut().zip(ticks.as_chunks::<2>().0) {
            time.milliseconds += 1e-6 * f64::from(gpu.queue.get_timestamp_period()) * end.saturating_sub(*start) as f64;
        }
        Ok(())
    }
}

fn blocks_for(rays: u32) -> u32 {
    (rays * BLOCKS_PER_RAY).max(MIN_BLOCKS)
}

//! Bytes of parameters in files and memory, and the time of a step: figures fitted to the runs in `docs/experiments/`.

use super::scale::ScalePlan;
use crate::TrainConfig;
use crate::initial::initial_decoder;
use strivec_format::model::DecoderMode;

/// Bytes of a parameter in a file of 16-bit floating point with zstd. Appearance factors compress as little as random
/// numbers, and so do density factors at the start of a run; towards the presets' 30 000 steps density factors become
/// sparse.
const RANDOM_BYTES: f64 = 1.863;
const SPARSE_BYTES: f64 = 1.38;
const SPARSE_STEPS: f64 = 30_000.0;
/// Bits of a parameter in a file that is trained for its size: with fewer, more parameters give hardly better pictures, or worse
/// ones in short trainings.
const SIZED_BITS: f64 = 3.0;
/// Bytes of the placement per tensor, and of the occupancy per file.
const TENSOR_BYTES: f64 = 2.0;
const FILE_BYTES: f64 = 50_000.0;

/// Bytes of the file of `scales` and `shared` parameters of network and sky; within 2 % of the measured files.
pub(super) fn file_bytes(config: &TrainConfig, scales: &[ScalePlan], shared: u64) -> u64 {
    let sparse = (config.schedule.steps as f64 / SPARSE_STEPS).min(1.0).powf(1.5);
    let density_bytes = RANDOM_BYTES + sparse * (SPARSE_BYTES - RANDOM_BYTES);
    let of_scale = |s: &ScalePlan| {
        let [density, appearance] = [s.density_rank, s.appearance_rank].map(f64::from);
        let mean = (density * density_bytes + appearance * RANDOM_BYTES) / (density + appearance);
        s.parameters as f64 * mean + s.tensors as f64 * TENSOR_BYTES
    };
    let network = shared as f64 * size_of::<f32>() as f64;
    (scales.iter().map(of_scale).sum::<f64>() + network + FILE_BYTES) as u64
}

/// Bytes of a file of a training for its size, of `tensors` without components, with `shared` parameters of network and sky,
/// which are integers of 8 bits.
pub(super) fn bytes_besides_factors(tensors: u64, shared: u64) -> u64 {
    (shared as f64 + tensors as f64 * TENSOR_BYTES + FILE_BYTES) as u64
}

/// The number of factors that `bytes` hold after a training for that size.
pub(super) fn factors_in(bytes: u64) -> u64 {
    (8.0 * bytes as f64 / SIZED_BITS) as u64
}

/// The form of photographs in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhotographMemory {
    /// 8 bits per channel: 8-bit files at full size.
    Bytes,
    /// 32 bits per channel: all others.
    Floats,
}

impl PhotographMemory {
    fn pixel_bytes(self) -> u64 {
        match self {
            Self::Bytes => 4,
            Self::Floats => 16,
        }
    }
}

/// Bytes per parameter at the peak, at an upsampling or a checkpoint: the factor, both moments, and copies.
const PARAMETER_BYTES: f64 = 25.0;
/// Bytes per pixel of the list of active rays: 4 for each of about half of the pixels, and twice that while it is
/// built.
const DRAWN_BYTES: u64 = 7;
/// Bytes of the program and of a batch.
const WORKING_BYTES: u64 = 40_000_000;

/// Bytes of the training process at its peak. Short runs of preset 48 at 800×800 held 1.46 GB at most, of
/// `quarter.toml` 0.26.
pub(super) fn memory_bytes(parameters: u64, pixels: u64, photographs: PhotographMemory) -> u64 {
    (parameters as f64 * PARAMETER_BYTES) as u64 + pixels * (photographs.pixel_bytes() + DRAWN_BYTES) + WORKING_BYTES
}

/// The speed of a machine at the two kinds of work in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineSpeed {
    /// Threads that train.
    pub threads: usize,
    /// FLOP/s per thread in matrix products, with all threads at work.
    pub product_flops: f64,
    /// Numbers per second that a thread gathers from random rows in its cache and adds, with all threads at work.
    pub gathered: f64,
}

impl MachineSpeed {
    /// The machine that the figures below were measured on: two cores of a Xeon (Sapphire Rapids). `gathered` is that
    /// of two cores of a Zen 4, whose other figures are within a tenth of it.
    pub const REFERENCE: Self = Self { threads: 2, product_flops: 105e9, gathered: 25e9 };
}

/// Seconds of a reference thread per ray, for drawing, marching and compositing.
const RAY: f64 = 9.0e-6;
/// Seconds per sample and scale, for finding neighbors.
const NEIGHBORS: f64 = 0.093e-6;
/// Seconds per component of a neighbor, for gathering it and for its gradient. Density gradients are thinned by Russian
/// roulette.
const DENSITY_COMPONENT: f64 = 2.0e-9;
const APPEARANCE_COMPONENT: f64 = 3.95e-9;
/// Seconds per encoded feature.
const ENCODED_FEATURE: f64 = 20e-9;
/// Seconds per FLOP of the network, and of the appearance matrices, whose products are small.
const NETWORK_FLOP: f64 = 1.0 / 79e9;
const MATRIX_FLOP: f64 = 1.0 / 51e9;
/// Seconds per parameter, for the optimizer.
const PARAMETER: f64 = 0.93e-9;
/// Products of a step for each forward product: two more are backward.
const PASSES: f64 = 3.0;

/// Samples on a ray that meets an occupied cell, with steps of half a cell.
const SAMPLES: f64 = 29.0;
/// Number of these that are shaded without Russian roulette.
const SHADED: f64 = 14.8;
/// Share of drawn rays that meet an occupied cell after the first occupancy, if rays are not filtered again.
const MEETING: f64 = 0.67;
/// Tensors that cover a point of a surface, relative to the mean over space.
const COVERED: f64 = 0.85;

/// Minutes of all steps of `config` with `scales` on `machine`.
pub(super) fn minutes(config: &TrainConfig, scales: &[ScalePlan], machine: &MachineSpeed) -> f64 {
    let first_occupancy =
        config.schedule.occupancy_at.first().map_or(config.schedule.steps, |&at| at.min(config.schedule.steps));
    let later = if config.sampling.refilter_rays { 1.0 } else { MEETING };
    let seconds = first_occupancy as f64 * step_seconds(config, scales, machine, 1.0)
        + (config.schedule.steps - first_occupancy) as f64 * step_seconds(config, scales, machine, later);
    seconds / 60.0
}

/// Seconds of a step in which the share `meeting` of the rays meets an occupied cell.
fn step_seconds(config: &TrainConfig, scales: &[ScalePlan], machine: &MachineSpeed, meeting: f64) -> f64 {
    let rays = config.sampling.batch_rays as f64;
    let samples = rays * meeting * SAMPLES * (0.5 / config.model.step).sqrt();
    let shaded = rays * meeting * SHADED * shaded_share(config.sampling.color_roulette);
    let [mut density, mut appearance, mut components] = [0.0; 3];
    for (scale, settings) in scales.iter().zip(&config.scales) {
        let covering: f64 = [0, 1, 2].map(|a| settings.edge[a] / settings.pitch[a]).iter().product();
        let neighbors = (COVERED * covering).clamp(1.0, f64::from(scale.top_k.max(1)));
        density += neighbors * f64::from(scale.density_rank);
        appearance += neighbors * f64::from(scale.appearance_rank);
        components += f64::from(scale.appearance_rank);
    }
    let parameters: u64 = scales.iter().map(|s| s.parameters).sum();
    let features = f64::from(config.decoder.features);
    let (decoded, own) = match config.decoder.mode {
        DecoderMode::PerSample => (shaded, 0.0),
        DecoderMode::PerRay => (rays, 0.0),
        DecoderMode::Residual => (rays, shaded),
    };
    let in_caches = rays * RAY
        + samples * (scales.len() as f64 * NEIGHBORS + density * DENSITY_COMPONENT)
        + shaded * appearance * APPEARANCE_COMPONENT
        + decoded * features * ENCODED_FEATURE
        + parameters as f64 * PARAMETER;
    let matrices = PASSES * 2.0 * components * (decoded * features + own * 3.0);
    let products = decoded * PASSES * network_flop(config) * NETWORK_FLOP + matrices * MATRIX_FLOP;
    let reference = MachineSpeed::REFERENCE;
    let core_seconds =
        in_caches * reference.gathered / machine.gathered + products * reference.product_flops / machine.product_flops;
    core_seconds / machine.threads.max(1) as f64
}

/// Share of the samples that Russian roulette below the weight `below` shades.
fn shaded_share(below: f64) -> f64 {
    1.0 / (1.0 + (below / 0.005).powf(0.6))
}

/// FLOP of one call of the network.
fn network_flop(config: &TrainConfig) -> f64 {
    let decoder = initial_decoder(config);
    decoder.layers.iter().map(|l| 2.0 * f64::from(l.inputs) * f64::from(l.outputs)).sum()
}

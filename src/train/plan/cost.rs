//! What parameters weigh in files and memory, and what a step takes: figures fitted to the runs in `docs/measurements.md`.

use super::ScalePlan;
use crate::model::DecoderMode;
use crate::train::TrainConfig;

/// Bytes of a parameter in a file of 16-bit floating point with zstd. Appearance factors, and density factors of a run
/// that has hardly begun, stay as good as random; towards the presets' 30 000 steps density factors become sparse.
const RANDOM_BYTES: f64 = 1.863;
const SPARSE_BYTES: f64 = 1.38;
const SPARSE_STEPS: f64 = 30_000.0;
/// Tensors' places and the occupancy: bytes a tensor, and once.
const TENSOR_BYTES: f64 = 2.0;
const FILE_BYTES: f64 = 50_000.0;

/// Of the file of `scales` and a network of `decoder_parameters`, within 2 % on what was measured.
pub(super) fn file_bytes(config: &TrainConfig, scales: &[ScalePlan], decoder_parameters: u64) -> u64 {
    let sparse = (config.steps as f64 / SPARSE_STEPS).min(1.0).powf(1.5);
    let density_bytes = RANDOM_BYTES + sparse * (SPARSE_BYTES - RANDOM_BYTES);
    let of_scale = |s: &ScalePlan| {
        let [density, appearance] = [s.density_rank, s.appearance_rank].map(f64::from);
        let mean = (density * density_bytes + appearance * RANDOM_BYTES) / (density + appearance);
        s.parameters as f64 * mean + s.tensors as f64 * TENSOR_BYTES
    };
    let network = decoder_parameters as f64 * size_of::<f32>() as f64;
    (scales.iter().map(of_scale).sum::<f64>() + network + FILE_BYTES) as u64
}

/// How photographs are held in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhotographMemory {
    /// 8 bits a channel, as 8-bit files at full size are.
    Bytes,
    /// 32 bits a channel: everything else.
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

/// Bytes a parameter at the peak, when factors are resampled or a checkpoint is written: the factors, both moments, and
/// copies.
const PARAMETER_BYTES: f64 = 25.0;
/// Bytes a pixel for numbers of those that are drawn: 4 for each, of about half of them, and twice while they are sought.
const DRAWN_BYTES: u64 = 7;
/// The program and a batch in flight.
const WORKING_BYTES: u64 = 40_000_000;

/// Of the training process at its peak. Short runs of preset 48 at 800×800 held 1.46 GB at most, of `quarter.toml` 0.26.
pub(super) fn memory_bytes(parameters: u64, pixels: u64, photographs: PhotographMemory) -> u64 {
    (parameters as f64 * PARAMETER_BYTES) as u64 + pixels * (photographs.pixel_bytes() + DRAWN_BYTES) + WORKING_BYTES
}

/// How fast a machine does the two kinds of work that a step consists of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineSpeed {
    /// That compute.
    pub threads: usize,
    /// FLOP/s of a thread in matrix products, while all threads work.
    pub product_flops: f64,
    /// Numbers that a thread gathers and adds up a second from rows at random places in its cache, while all threads work.
    pub gathered: f64,
}

impl MachineSpeed {
    /// What the figures below were measured on: two cores of a Xeon of the Sapphire Rapids generation. How fast it gathers
    /// is taken from two cores of a Zen 4, whose other figures are the same within a tenth.
    pub const REFERENCE: Self = Self { threads: 2, product_flops: 105e9, gathered: 25e9 };
}

/// Of the reference's threads: seconds a ray for drawing, marching and compositing it.
const RAY: f64 = 9.0e-6;
/// A sample and scale, for finding neighbors.
const NEIGHBORS: f64 = 0.093e-6;
/// A component of a sample's neighbor, gathered and given its gradient. Samples that hardly matter are left out of
/// density's.
const DENSITY_COMPONENT: f64 = 2.0e-9;
const APPEARANCE_COMPONENT: f64 = 3.95e-9;
/// A feature that is encoded and decoded.
const ENCODED_FEATURE: f64 = 20e-9;
/// A FLOP of the network, and of the appearance matrices, whose products are small.
const NETWORK_FLOP: f64 = 1.0 / 79e9;
const MATRIX_FLOP: f64 = 1.0 / 51e9;
/// A parameter, for the optimizer.
const PARAMETER: f64 = 0.93e-9;
/// A product forward is two more backward.
const PASSES: f64 = 3.0;

/// Samples that are evaluated on a ray that meets something, with steps of half a cell.
const SAMPLES: f64 = 29.0;
/// How many of these get a color where none is left out.
const COLORED: f64 = 14.8;
/// The share of drawn rays that meet something, once the occupancy is known, where rays are not drawn anew.
const MEETING: f64 = 0.67;
/// The share of the covering tensors' mean number that a place on a surface has.
const COVERED: f64 = 0.85;

/// Of all steps of `config` with `scales` on `machine`.
pub(super) fn minutes(config: &TrainConfig, scales: &[ScalePlan], machine: &MachineSpeed) -> f64 {
    let first_occupancy = config.occupancy_at.first().map_or(config.steps, |&at| at.min(config.steps));
    let later = if config.refilter_rays { 1.0 } else { MEETING };
    let seconds = first_occupancy as f64 * step_seconds(config, scales, machine, 1.0)
        + (config.steps - first_occupancy) as f64 * step_seconds(config, scales, machine, later);
    seconds / 60.0
}

/// Of a step of which `meeting` of the rays meet something.
fn step_seconds(config: &TrainConfig, scales: &[ScalePlan], machine: &MachineSpeed, meeting: f64) -> f64 {
    let rays = config.batch_rays as f64;
    let samples = rays * meeting * SAMPLES * (0.5 / config.field.step_cells).sqrt();
    let colored = rays * meeting * COLORED * left_by_thinning(config.color_roulette);
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
        DecoderMode::PerSample => (colored, 0.0),
        DecoderMode::PerRay => (rays, 0.0),
        DecoderMode::Residual => (rays, colored),
    };
    let in_caches = rays * RAY
        + samples * (scales.len() as f64 * NEIGHBORS + density * DENSITY_COMPONENT)
        + colored * appearance * APPEARANCE_COMPONENT
        + decoded * features * ENCODED_FEATURE
        + parameters as f64 * PARAMETER;
    let matrices = PASSES * 2.0 * components * (decoded * features + own * 3.0);
    let products = decoded * PASSES * network_flop(config) * NETWORK_FLOP + matrices * MATRIX_FLOP;
    let reference = MachineSpeed::REFERENCE;
    let core_seconds =
        in_caches * reference.gathered / machine.gathered + products * reference.product_flops / machine.product_flops;
    core_seconds / machine.threads.max(1) as f64
}

/// The share of samples' colors that is kept where those of less weight than `below` are left out at random.
fn left_by_thinning(below: f64) -> f64 {
    1.0 / (1.0 + (below / 0.005).powf(0.6))
}

/// FLOP of calling the network once.
fn network_flop(config: &TrainConfig) -> f64 {
    let decoder = super::initial_decoder(config);
    decoder.layers.iter().map(|l| 2.0 * f64::from(l.inputs) * f64::from(l.outputs)).sum()
}

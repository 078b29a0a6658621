//! Settings that stay within a number of parameters or bytes.

use super::{
    cells_of, cost, ending_in, last, listed, scale_plans, shared_parameters, tensor_counts, total,
    without_idle_upsamplings,
};
use crate::{ConfigError, PrepareError, ScaleConfig, TrainConfig};
use strivec_capture::prior::VoxelBoxes;
use strivec_format::{Invalid, Place};

/// Number of steps of each kind of reduction.
const STEPS: u32 = 64;
/// Minimum remaining share of the cells along an edge (cells of 1.3 pixels then have 2 pixels), of the appearance
/// components and of the density components.
const MIN_CELLS: f64 = 0.65;
const MIN_APPEARANCE: f64 = 0.25;
const MIN_DENSITY: f64 = 0.5;
/// Reduced ranks are multiples of this if possible: kernels work in registers of at least this many numbers.
const LANES: u32 = 4;

/// A training that gives up components begins with at most this many times the parameters that are left in the end.
const START: u64 = 10;

/// Bounds on the size of a scene; `None` is no bound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Budget {
    /// The most trained parameters.
    pub parameters: Option<u64>,
    /// The most bytes of the file: as [`super::Plan::file_bytes`] estimates it if training keeps all components, else
    /// [`ScheduleConfig::max_file_bytes`](crate::ScheduleConfig::max_file_bytes).
    pub file_bytes: Option<u64>,
}

/// `config` with which tensors on `occupied` (in the dataset's space) stay within `budget`, and a line of reason for each
/// reduction. It is unchanged if it fits.
///
/// A training that gives up components goes on until the scene fits. If it would begin with more than ten times as many
/// parameters, or if training keeps all components, the settings are reduced in this order, each once the one before is
/// used up, and only as far as needed: resolution, down to 0.65 of the cells along an edge; appearance components, down to
/// a quarter; density components, down to half; the finest scale. Without that scale, all others start again from their
/// full size.
///
/// # Errors
///
/// If even the coarsest scale alone, with all reductions, is too large, or the weights that all tensors share; the error
/// names the size.
pub fn fit_to_budget(
    config: &TrainConfig,
    occupied: &VoxelBoxes,
    budget: Budget,
) -> Result<(TrainConfig, Vec<String>), PrepareError> {
    if budget == Budget::default() {
        return Ok((config.clone(), Vec::new()));
    }
    let size = Size { tensors: tensor_counts(config, occupied)?, shared: shared_parameters(config) };
    let fit = if config.lean.is_on() { given_up_to } else { reduced_to };
    fit(config, &size, budget)
}

/// `config` reduced to stay within `budget`.
fn reduced_to(config: &TrainConfig, size: &Size, budget: Budget) -> Result<(TrainConfig, Vec<String>), PrepareError> {
    if budget.allows(size.of(config)) {
        return Ok((config.clone(), Vec::new()));
    }
    for scales in (1..=config.scales.len()).rev() {
        let reduced = |step| reduced(config, scales, step);
        // Each step has at most the parameters of the one before.
        let steps: Vec<u32> = (0..=3 * STEPS).collect();
        let at = steps.partition_point(|&step| !budget.allows(size.of(&reduced(step))));
        if let Some(&step) = steps.get(at) {
            let mut fitted = reduced(step);
            let reductions = reductions(config, &fitted);
            without_idle_upsamplings(&mut fitted);
            fitted.check()?;
            return Ok((fitted, reductions));
        }
    }
    Err(budget.too_small(size.of(&reduced(config, 1, 3 * STEPS)), "the smallest size of this scene"))
}

/// `config` of a training that gives up components until the scene is within `budget`, and that begins with at most
/// [`START`] times as many parameters.
fn given_up_to(config: &TrainConfig, size: &Size, budget: Budget) -> Result<(TrainConfig, Vec<String>), PrepareError> {
    let shared = size.shared;
    let matrices = |s: &ScaleConfig| u64::from(s.appearance_rank) * u64::from(config.decoder.features);
    let least = shared + config.scales.iter().map(matrices).sum::<u64>();
    let least_bytes = cost::bytes_besides_factors(size.tensors.iter().sum(), shared);
    if !budget.allows([least, least_bytes]) {
        return Err(budget.too_small([least, least_bytes], "those that all tensors share"));
    }
    let in_bytes = budget.file_bytes.map(|bytes| shared + cost::factors_in(bytes - least_bytes));
    let most = budget.parameters.into_iter().chain(in_bytes).min().unwrap_or(u64::MAX);
    let start = Budget { parameters: Some(most.saturating_mul(START)), file_bytes: None };
    let (mut config, reasons) = reduced_to(config, size, start)?;
    config.schedule.max_file_bytes = budget.file_bytes;
    config.lean.max_parameters = Some(config.lean.max_parameters.map_or(most, |already| already.min(most)));
    Ok((config, reasons))
}

impl Budget {
    /// True if `[parameters, bytes]` are within the budget.
    fn allows(self, [parameters, bytes]: [u64; 2]) -> bool {
        self.parameters.is_none_or(|most| parameters <= most) && self.file_bytes.is_none_or(|most| bytes <= most)
    }

    /// The error of a budget that does not allow `[parameters, bytes]`, of which `what` is the name.
    fn too_small(self, [parameters, bytes]: [u64; 2], what: &str) -> PrepareError {
        let expected = format!("at least {parameters} parameters and {bytes} bytes, {what}");
        let part = |value: Option<u64>, unit: &str| value.map(|v| format!("{v} {unit}"));
        let found: Vec<_> =
            [part(self.parameters, "parameters"), part(self.file_bytes, "bytes")].into_iter().flatten().collect();
        ConfigError::from(Invalid::new(Place::option("budget"), expected, listed(&found))).into()
    }
}

/// The sizes that do not change with reductions.
struct Size {
    /// \[scale\] number of tensors.
    tensors: Vec<u64>,
    /// Weights and biases of the network.
    shared: u64,
}

impl Size {
    /// Parameters and bytes of `config`.
    fn of(&self, config: &TrainConfig) -> [u64; 2] {
        let scales = scale_plans(config, &self.tensors);
        [total(&scales, self.shared), cost::file_bytes(config, &scales, self.shared)]
    }
}

/// The first `scales` scales of `config`, after `step` of 3·`STEPS` steps of reduction.
fn reduced(config: &TrainConfig, scales: usize, step: u32) -> TrainConfig {
    let left = |stage: u32, least: f64| {
        let done = f64::from(step.saturating_sub(stage * STEPS).min(STEPS)) / f64::from(STEPS);
        1.0 - done * (1.0 - least)
    };
    let (cells, appearance, density) = (left(0, MIN_CELLS), left(1, MIN_APPEARANCE), left(2, MIN_DENSITY));
    let scale = |s: &ScaleConfig| {
        let end = last(s).map(|d| ((f64::from(d) * cells).round() as u32).max(1));
        ScaleConfig {
            resolutions: ending_in(&s.resolutions, end),
            density_rank: fewer(s.density_rank, density),
            appearance_rank: fewer(s.appearance_rank, appearance),
            ..s.clone()
        }
    };
    TrainConfig { scales: config.scales[..scales].iter().map(scale).collect(), ..config.clone() }
}

/// About `share` of `rank`, rounded down to whole registers.
fn fewer(rank: u32, share: f64) -> u32 {
    if share == 1.0 {
        return rank;
    }
    let left = (f64::from(rank) * share) as u32;
    if left >= LANES { left / LANES * LANES } else { left.max(1) }
}

/// A line for each kind of reduction from `before` to `after`.
fn reductions(before: &TrainConfig, after: &TrainConfig) -> Vec<String> {
    let mut lines = Vec::new();
    let dropped = before.scales.len() - after.scales.len();
    if dropped > 0 {
        lines.push(format!("removed the finest {} of {} scales", dropped, before.scales.len()));
    }
    let mut compare = |what: &str, of: &dyn Fn(&ScaleConfig) -> String| {
        let all = |config: &TrainConfig| {
            let each: Vec<_> = config.scales[..after.scales.len()].iter().map(of).collect();
            if each.windows(2).all(|w| w[0] == w[1]) { each[0].clone() } else { listed(&each) }
        };
        let (old, new) = (all(before), all(after));
        if old != new {
            lines.push(format!("reduced {what}: {new} instead of {old}"));
        }
    };
    compare("cells per tensor", &|s| cells_of(last(s)));
    compare("appearance components", &|s| s.appearance_rank.to_string());
    compare("density components", &|s| s.density_rank.to_string());
    lines
}

//! Estimates before a run: parameters, file, memory, time; and settings that fit photographs or a budget.
//!
//! In: settings, cameras and occupied cells in the dataset's space. Out: a [`Plan`], or changed settings and a line of
//! reason for each change. Tensors are placed as in training, so parameters are exact; the rest is estimated from
//! measured runs (`cost`). No random factors are drawn and no pixel is read.

mod budget;
mod cost;
mod footprint;
mod photographs;
mod scale;
#[cfg(test)]
mod tests;

use strivec_capture::prior;
use strivec_capture::prior::{ScaleShape, VoxelBoxes};
use strivec_format::geometry::Camera;
use strivec_format::model::Form;

pub use budget::{Budget, fit_to_budget};
pub use cost::{MachineSpeed, PhotographMemory};
pub use photographs::{PIXELS_APART, fit_to_photographs};
pub use scale::ScalePlan;

use super::initial::initial_decoder;
use super::{PrepareError, ScaleConfig, TrainConfig};
use footprint::Footprints;

/// The expected size and time of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Coarsest first.
    pub scales: Vec<ScalePlan>,
    /// Weights and biases of the network.
    pub decoder_parameters: u64,
    /// All trained parameters, at the last resolution; the most that may be left, if training gives some up.
    pub parameters: u64,
    /// Bytes of the file in 16-bit floating point with zstd, with as many parameters.
    pub file_bytes: u64,
    /// Bytes of the training process at its peak.
    pub memory_bytes: u64,
    /// Minutes of the steps, without the prior, evaluations and files.
    pub minutes: f64,
    /// Remarks on the settings from the cameras, one line each.
    pub reasons: Vec<String>,
}

/// The expected size and time of training with `config` on `occupied`, seen by `cameras`, on `machine`. Cameras and
/// cells are in the dataset's space; `photographs` is the form of the photographs in memory.
///
/// # Errors
///
/// If there is no cell to place tensors on.
pub fn plan(
    config: &TrainConfig,
    cameras: &[Camera],
    photographs: PhotographMemory,
    occupied: &VoxelBoxes,
    machine: &MachineSpeed,
) -> Result<Plan, PrepareError> {
    let scales = scale_plans(config, &tensor_counts(config, occupied)?);
    let decoder_parameters = initial_decoder(config).parameter_count();
    let shared = shared_parameters(config);
    let all = total(&scales, shared);
    let parameters = config.lean.max_parameters.map_or(all, |most| most.min(all));
    let pixels = cameras.iter().map(|c| u64::from(c.width) * u64::from(c.height)).sum();
    Ok(Plan {
        file_bytes: (cost::file_bytes(config, &scales, shared) as f64 * parameters as f64 / all as f64) as u64,
        memory_bytes: cost::memory_bytes(all, pixels, photographs),
        minutes: cost::minutes(config, &scales, machine),
        reasons: observations(config, cameras, occupied)?,
        scales,
        decoder_parameters,
        parameters,
    })
}

/// The plans of `config`'s scales with \[scale\] these numbers of tensors.
fn scale_plans(config: &TrainConfig, tensors: &[u64]) -> Vec<ScalePlan> {
    let of_scale = |(scale, &tensors): (&ScaleConfig, &u64)| {
        let of_tensor = |(form, rank): &(Form, u32)| form.rows(last(scale)) as u64 * u64::from(*rank);
        let factors = tensors.saturating_mul(scale.forms().iter().flatten().map(of_tensor).sum());
        let matrix = u64::from(config.decoder.features) * u64::from(scale.appearance_rank);
        ScalePlan {
            tensors,
            edge: scale.edge,
            resolution: last(scale),
            factors: scale.factors,
            density_rank: scale.density_rank,
            appearance_rank: scale.appearance_rank,
            top_k: scale.top_k,
            parameters: factors.saturating_add(matrix),
        }
    };
    config.scales.iter().zip(tensors).map(of_scale).collect()
}

/// \[scale\] tensors on `occupied`, in the dataset's space.
fn tensor_counts(config: &TrainConfig, occupied: &VoxelBoxes) -> Result<Vec<u64>, PrepareError> {
    let boxes = occupied.mapped(&config.model_from_prior(&occupied.bounds())?);
    let count = |s: &ScaleConfig| {
        let shape = ScaleShape { pitch: s.pitch, edge: s.edge, resolution: [1; 3] };
        prior::place_on_boxes(&boxes, &shape).map(|cloud| cloud.len() as u64)
    };
    Ok(config.scales.iter().map(count).collect::<Result<_, _>>()?)
}

/// Parameters that no scale has: those of the network and of the sky.
fn shared_parameters(config: &TrainConfig) -> u64 {
    initial_decoder(config).parameter_count() + config.sky().map_or(0, |sky| sky.coefficients.len() as u64)
}

/// Parameters of all `scales`, and the `shared` ones.
fn total(scales: &[ScalePlan], shared: u64) -> u64 {
    scales.iter().fold(shared, |sum, s| sum.saturating_add(s.parameters))
}

/// The cells of a tensor after the last upsampling.
fn last(scale: &ScaleConfig) -> [u32; 3] {
    scale.resolutions.last().copied().unwrap_or([1; 3])
}

/// The edges of a tensor's cells after the last upsampling: the smallest over all scales and axes.
fn finest_cell(config: &TrainConfig) -> f64 {
    let cells = |s: &ScaleConfig| [0, 1, 2].map(|a| s.edge[a] / f64::from(last(s)[a]));
    config.scales.iter().flat_map(cells).fold(f64::INFINITY, f64::min)
}

/// Remarks on `config`'s cells and on `occupied`, from the cameras.
fn observations(config: &TrainConfig, cameras: &[Camera], occupied: &VoxelBoxes) -> Result<Vec<String>, PrepareError> {
    let map = config.model_from_prior(&occupied.bounds())?;
    let footprints = Footprints::of(config, cameras, occupied);
    let unseen = occupied.cells.len() - footprints.seen();
    let mut lines = Vec::new();
    if let Some(pixel) = footprints.near_pixel() {
        let (pixel, cell) = (pixel * map.scale, finest_cell(config));
        lines.push(format!(
            "cells of {}: {:.1} pixels, as a pixel is {} model units wide at the nearest cells",
            rounded(cell),
            cell / pixel,
            rounded(pixel)
        ));
    }
    if unseen > 0 {
        lines.push(format!("{unseen} of {} occupied cells are in no photograph", occupied.cells.len()));
    }
    Ok(lines)
}

/// `value` with three significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// `resolution` as text: one number if all axes are equal.
fn cells_of(resolution: [u32; 3]) -> String {
    match resolution {
        [x, y, z] if x == y && y == z => x.to_string(),
        [x, y, z] => format!("{x}x{y}x{z}"),
    }
}

/// "121, 61 and 31".
fn listed(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., end] => format!("{} and {end}", first.join(", ")),
    }
}

/// `resolutions` (first to last) with another last one: each keeps its relative place, in the logarithm, between the
/// first and the last. None is finer than the last.
fn ending_in(resolutions: &[[u32; 3]], end: [u32; 3]) -> Vec<[u32; 3]> {
    let ([first, .., old_end] | [first @ old_end]) = resolutions else { return Vec::new() };
    let on_axis = |resolution: &[u32; 3], a: usize| {
        let along = |r: u32| (f64::from(r) / f64::from(first[a])).ln();
        let share = if old_end[a] > first[a] { along(resolution[a]) / along(old_end[a]) } else { 1.0 };
        let begin = f64::from(first[a].min(end[a]));
        let cells = begin * (f64::from(end[a]) / begin).powf(share);
        (cells.round() as u32).clamp(1, end[a])
    };
    let mut ending: Vec<_> = resolutions.iter().map(|r| [0, 1, 2].map(|a| on_axis(r, a))).collect();
    if let Some(last) = ending.last_mut() {
        *last = end;
    }
    ending
}

/// Removes upsamplings that change no scale: each would only restart the optimizer.
fn without_idle_upsamplings(config: &mut TrainConfig) {
    for stage in (1..=config.schedule.upsample_at.len()).rev() {
        if config.scales.iter().all(|s| s.resolutions[stage] == s.resolutions[stage - 1]) {
            config.schedule.upsample_at.remove(stage - 1);
            config.scales.iter_mut().for_each(|s| _ = s.resolutions.remove(stage));
        }
    }
}

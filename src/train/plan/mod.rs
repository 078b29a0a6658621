//! What a run will come to before it begins: parameters, file, memory, time; and settings that fit photographs or a
//! budget.
//!
//! In: settings, cameras and occupied cells in the dataset's space. Out: a [`Plan`], or changed settings and a line of
//! reason for each change. Tensors are placed as training will place them, so parameters are exact; the rest is estimated
//! from measured runs (`cost`). Nothing here draws random numbers for factors or looks at a pixel.

mod budget;
mod cost;
mod footprint;
mod photographs;
#[cfg(test)]
mod tests;

use crate::geometry::Camera;
use crate::model::Factors;
use crate::prior::{self, ScaleShape, VoxelBoxes, canonical_map};

pub use budget::{Budget, fit_to_budget};
pub use cost::{MachineSpeed, PhotographMemory};
pub use photographs::{PIXELS_APART, fit_to_photographs};

use super::initial::initial_decoder;
use super::{PrepareError, ScaleConfig, TrainConfig};
use footprint::Footprints;

/// What training with some settings will come to.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Coarsest first.
    pub scales: Vec<ScalePlan>,
    /// Weights and biases of the network.
    pub decoder_parameters: u64,
    /// Of everything that is trained, at the last resolution.
    pub parameters: u64,
    /// Of the file in 16-bit floating point with zstd.
    pub file_bytes: u64,
    /// Of the training process at its peak.
    pub memory_bytes: u64,
    /// Of the steps, without the prior, evaluations and files.
    pub minutes: f64,
    /// What the cameras say about the settings, one line each.
    pub reasons: Vec<String>,
}

/// One scale of a [`Plan`].
#[derive(Clone, Debug, PartialEq)]
pub struct ScalePlan {
    /// How many.
    pub tensors: u64,
    /// What a tensor covers, per axis, in model units.
    pub edge: [f64; 3],
    /// Cells of a tensor after the last upsampling.
    pub resolution: [u32; 3],
    /// Density components.
    pub density_rank: u32,
    /// Appearance components.
    pub appearance_rank: u32,
    /// Neighbors that a point aggregates.
    pub top_k: u32,
    /// Factors and appearance matrix.
    pub parameters: u64,
}

impl ScalePlan {
    /// In memory, as 32-bit floating point.
    pub fn bytes(&self) -> u64 {
        4 * self.parameters
    }
}

/// What training with `config` on `occupied`, seen by `cameras`, will come to on `machine`. Cameras and cells are in the
/// dataset's space; `photographs` says how the pictures are held in memory.
///
/// # Errors
///
/// Where [`super::place_scene`] would have nothing to place tensors on.
pub fn plan(
    config: &TrainConfig,
    cameras: &[Camera],
    photographs: PhotographMemory,
    occupied: &VoxelBoxes,
    machine: &MachineSpeed,
) -> Result<Plan, PrepareError> {
    let scales = scale_plans(config, &tensor_counts(config, occupied)?);
    let decoder_parameters = initial_decoder(config).parameter_count();
    let parameters = total(&scales, decoder_parameters);
    let pixels = cameras.iter().map(|c| u64::from(c.width) * u64::from(c.height)).sum();
    Ok(Plan {
        file_bytes: cost::file_bytes(config, &scales, decoder_parameters),
        memory_bytes: cost::memory_bytes(parameters, pixels, photographs),
        minutes: cost::minutes(config, &scales, machine),
        reasons: observations(config, cameras, occupied)?,
        scales,
        decoder_parameters,
        parameters,
    })
}

/// What `config`'s scales come to with so many tensors each.
fn scale_plans(config: &TrainConfig, tensors: &[u64]) -> Vec<ScalePlan> {
    let of_scale = |(scale, &tensors): (&ScaleConfig, &u64)| {
        let rank = u64::from(scale.density_rank) + u64::from(scale.appearance_rank);
        let factors = tensors.saturating_mul(Factors::rows(last(scale)) as u64).saturating_mul(rank);
        let matrix = u64::from(config.decoder.features) * u64::from(scale.appearance_rank);
        ScalePlan {
            tensors,
            edge: scale.edge,
            resolution: last(scale),
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
    let boxes = occupied.mapped(&canonical_map(&occupied.bounds(), config.half_extent)?);
    let count = |s: &ScaleConfig| {
        let shape = ScaleShape { pitch: s.pitch, edge: s.edge, resolution: [1; 3] };
        prior::place_on_boxes(&boxes, &shape).map(|cloud| cloud.len() as u64)
    };
    Ok(config.scales.iter().map(count).collect::<Result<_, _>>()?)
}

/// Parameters of all `scales` and of the network.
fn total(scales: &[ScalePlan], decoder_parameters: u64) -> u64 {
    scales.iter().fold(decoder_parameters, |sum, s| sum.saturating_add(s.parameters))
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

/// What the cameras say about `config`'s cells and about `occupied`.
fn observations(config: &TrainConfig, cameras: &[Camera], occupied: &VoxelBoxes) -> Result<Vec<String>, PrepareError> {
    let map = canonical_map(&occupied.bounds(), config.half_extent)?;
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

/// `resolution` for people: one number where all axes have it.
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

/// `resolutions` (first to last) with another end: each keeps its place, in proportions, between the first and the last.
/// None is finer than the end.
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

/// Leaves out upsamplings that change no scale: each would restart the optimizer for nothing.
fn without_idle_upsamplings(config: &mut TrainConfig) {
    for stage in (1..=config.upsample_at.len()).rev() {
        if config.scales.iter().all(|s| s.resolutions[stage] == s.resolutions[stage - 1]) {
            config.upsample_at.remove(stage - 1);
            config.scales.iter_mut().for_each(|s| _ = s.resolutions.remove(stage));
        }
    }
}

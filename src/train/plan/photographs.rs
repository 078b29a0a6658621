//! Settings whose resolution matches that of the photographs.

use super::footprint::Footprints;
use super::{cells_of, ending_in, finest_cell, last, listed, rounded, without_idle_upsamplings};
use crate::{PrepareError, ScaleConfig, TrainConfig};
use strivec_capture::prior;
use strivec_capture::prior::VoxelBoxes;
use strivec_format::geometry::Camera;

/// Edge of a tensor's cell in pixels at the nearest occupied cells, as in `docs/configs/quarter.toml`, where it was
/// found by hand.
pub const PIXELS_APART: f64 = 1.3;
/// Maximum ratio of a tensor's cells to those of the given settings, per axis; larger ratios were not measured.
const MAX_TIMES: u32 = 2;
/// A finer scale whose tensors have fewer cells on every axis adds hardly any detail to the scale before it.
const MIN_CELLS: u32 = 4;
/// Ratios to the scene's extent are rounded to multiples of 1 divided by this, far below the tolerance of placing
/// tensors.
const EXTENT_DIGITS: f64 = 1e9;

/// Fits `config` to a scene. Returns the settings, the occupied cells that any of `cameras` sees, and a line of reason
/// for each choice. Cells and cameras are in the dataset's space.
///
/// `config`'s lengths count as those for a scene of the presets' extent and are scaled to this one's. Cells of all
/// scales are [`PIXELS_APART`] pixels wide at the cells with the smallest pixels, but a tensor has at most twice as
/// many as in `config`. The ratios between resolutions, the ranks and the neighbors stay, with three exceptions: a
/// scale is left out if its tensors would have fewer than 4 cells per axis, density components are limited to the size
/// of a dense grid, and upsamplings that change nothing are removed.
///
/// Scenes that differ only in their unit get the same tensors.
///
/// # Errors
///
/// If no camera sees any cell, or the seen cells have no extent.
pub fn fit_to_photographs(
    config: &TrainConfig,
    cameras: &[Camera],
    occupied: &VoxelBoxes,
) -> Result<(TrainConfig, VoxelBoxes, Vec<String>), PrepareError> {
    let footprints = Footprints::of(config, cameras, occupied);
    let pixel =
        footprints.near_pixel().ok_or(prior::Error::NothingToPlace { what: "occupied cell that a camera sees" })?;
    let cells = (occupied.cells.iter().enumerate()).filter(|(n, _)| footprints.is_seen(*n)).map(|(_, &c)| c).collect();
    let seen = VoxelBoxes { lattice: occupied.lattice, cells };
    let mut reasons = Vec::new();
    let unseen = occupied.cells.len() - seen.cells.len();
    if unseen > 0 {
        reasons.push(format!("{unseen} of {} occupied cells left out: no photograph shows them", occupied.cells.len()));
    }

    let bounds = seen.bounds();
    let map = config.model_from_prior(&bounds)?;
    let half = 0.5 * bounds.size().max_element() * map.scale;
    let stretch = (half / config.space.half_extent * EXTENT_DIGITS).round() / EXTENT_DIGITS;
    let mut config = config.clone();
    for scale in &mut config.scales {
        scale.pitch = scale.pitch.map(|v| v * stretch);
        scale.edge = scale.edge.map(|v| v * stretch);
    }
    let coarsest = &config.scales[0];
    reasons.push(format!(
        "tensors {} apart: {} along the scene's {} model units, as in the settings",
        rounded(coarsest.pitch[0]),
        rounded(2.0 * half / coarsest.pitch[0]),
        rounded(2.0 * half)
    ));

    let pixel = pixel * map.scale;
    let cell = PIXELS_APART * pixel;
    let mut limited = false;
    for scale in &mut config.scales {
        let most = last(scale).map(|d| d.saturating_mul(MAX_TIMES));
        let end = [0, 1, 2].map(|a| cells_along(scale.edge[a], cell));
        limited |= (0..3).any(|a| end[a] > most[a]);
        scale.resolutions = ending_in(&scale.resolutions, [0, 1, 2].map(|a| end[a].min(most[a])));
    }
    let cell = if limited { finest_cell(&config) } else { cell };
    reasons.push(format!(
        "cells of {}: a pixel is {} at the nearest cells, so they are {:.1} pixels wide{}",
        rounded(cell),
        rounded(pixel),
        cell / pixel,
        if limited { ", as tensors have at most twice the settings' cells" } else { "" }
    ));
    leave_out_fine_scales(&mut config, cell, &mut reasons);
    limit_ranks(&mut config, &mut reasons);
    let steps = config.schedule.upsample_at.len();
    without_idle_upsamplings(&mut config);
    let ends: Vec<_> = config.scales.iter().map(|s| cells_of(last(s))).collect();
    reasons.push(format!(
        "{} cells per tensor, after {} of {steps} upsamplings; the others would change nothing",
        listed(&ends),
        config.schedule.upsample_at.len()
    ));
    config.check()?;
    Ok((config, seen, reasons))
}

/// Number of cells of about `cell` along an edge.
fn cells_along(edge: f64, cell: f64) -> u32 {
    // The rounding of halves must not depend on the last bit of a length.
    const FUZZ: f64 = 1e-6;
    ((edge / cell + FUZZ).round() as u32).max(1)
}

fn leave_out_fine_scales(config: &mut TrainConfig, cell: f64, reasons: &mut Vec<String>) {
    let is_too_coarse = |scale: &ScaleConfig| last(scale).iter().all(|&d| d < MIN_CELLS);
    while config.scales.len() > 1
        && let Some(scale) = config.scales.pop_if(|scale| is_too_coarse(scale))
    {
        reasons.push(format!(
            "scale {} left out: tensors of edge {} have fewer than {MIN_CELLS} cells of {} per axis",
            config.scales.len(),
            rounded(scale.edge[0]),
            rounded(cell)
        ));
    }
}

/// A dense grid of a tensor's (D + 1)³ vertices has as many numbers as (D + 1)²/3 components.
fn limit_ranks(config: &mut TrainConfig, reasons: &mut Vec<String>) {
    for (n, scale) in config.scales.iter_mut().enumerate() {
        let vertices = last(scale).map(|d| d.saturating_add(1));
        let dense = vertices.iter().map(|&v| u64::from(v)).product::<u64>();
        let row = vertices.iter().map(|&v| u64::from(v)).sum::<u64>();
        let most = (dense / row).clamp(1, u64::from(u32::MAX)) as u32;
        if scale.density_rank > most {
            reasons.push(format!(
                "{most} density components instead of {} at scale {n}: more would exceed a dense grid of its {} cells",
                scale.density_rank,
                cells_of(last(scale)),
            ));
            scale.density_rank = most;
        }
    }
}

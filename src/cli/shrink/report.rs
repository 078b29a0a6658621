//! The result of shrinking.

use std::path::Path;

use serde::Serialize;

use super::cells::CellKind;
use crate::table::Table;
use strivec_format::digits::grouped;
use strivec_format::escape::escaped_path;
use strivec_format::model::{Block, Scale};

/// The result, as `--json` prints it.
#[derive(Serialize)]
pub(super) struct Report<'a> {
    pub(super) file: &'a Path,
    pub(super) bytes: u64,
    /// Number of parameters before and after.
    pub(super) parameters: [u64; 2],
    /// dB on training rays, before and after.
    pub(super) psnr: [f64; 2],
    pub(super) scales: Vec<[ScaleUse; 2]>,
    /// Cells of space, grouped by the colors that the photographs show there.
    pub(super) cells: Vec<CellKind>,
    pub(super) seconds: f64,
    /// Why the scene is the one before, if it is.
    pub(super) unchanged: Option<&'static str>,
}

/// Tensors, ranks and parameters of a scale.
#[derive(Clone, Copy, Serialize)]
pub(super) struct ScaleUse {
    tensors: u64,
    /// Tensors without any component left.
    tensors_of_rank_0: u64,
    resolution: [u32; 3],
    /// Largest rank of a tensor.
    density_rank: u32,
    appearance_rank: u32,
    /// Mean rank over tensors.
    mean_density_rank: f64,
    mean_appearance_rank: f64,
    parameters: u64,
}

impl ScaleUse {
    pub(super) fn of(scale: &Scale) -> Self {
        let ranks = |blocks: &[Block]| -> Vec<usize> {
            let mut of_tensors = vec![0; scale.cloud.len()];
            for block in blocks {
                let held = block.nonzero_components(scale.cloud.resolution);
                for (sum, held) in of_tensors.iter_mut().zip(held.chunks_exact(block.rank as usize)) {
                    *sum += held.iter().filter(|h| **h).count();
                }
            }
            of_tensors
        };
        let [density, appearance] = [&scale.factors.density, &scale.factors.appearance].map(|blocks| ranks(blocks));
        let mean = |ranks: &[usize]| ranks.iter().sum::<usize>() as f64 / ranks.len().max(1) as f64;
        let most = |ranks: &[usize]| ranks.iter().copied().max().unwrap_or(0) as u32;
        Self {
            tensors: scale.cloud.len() as u64,
            tensors_of_rank_0: density.iter().zip(&appearance).filter(|(d, a)| **d + **a == 0).count() as u64,
            resolution: scale.cloud.resolution,
            density_rank: most(&density),
            appearance_rank: most(&appearance),
            mean_density_rank: mean(&density),
            mean_appearance_rank: mean(&appearance),
            parameters: scale.nonzero_parameter_count(),
        }
    }

    fn row(&self, name: String) -> [String; 7] {
        let [x, y, z] = self.resolution;
        [
            name,
            grouped(self.tensors),
            grouped(self.tensors_of_rank_0),
            if x == y && y == z { x.to_string() } else { format!("{x}x{y}x{z}") },
            format!("{:.1} of {}", self.mean_density_rank, self.density_rank),
            format!("{:.1} of {}", self.mean_appearance_rank, self.appearance_rank),
            grouped(self.parameters),
        ]
    }
}

impl Report<'_> {
    pub(super) fn text(&self) -> String {
        let mut scales = Table::new(["scale", "tensors", "of rank 0", "cells", "density", "appearance", "parameters"]);
        for (n, [before, after]) in self.scales.iter().enumerate() {
            scales.row(before.row(format!("{n} before")));
            scales.row(after.row(format!("{n} after")));
        }
        let mut cells =
            Table::new(["cells with", "cells", "weight", "parameters before", "after", "error before", "after"]);
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        for kind in &self.cells {
            cells.row([
                kind.name.to_owned(),
                grouped(kind.cells as u64),
                percent(kind.share_of_weight),
                grouped(kind.parameters[0].round() as u64),
                grouped(kind.parameters[1].round() as u64),
                percent(kind.share_of_error[0]),
                percent(kind.share_of_error[1]),
            ]);
        }
        let ([before, after], [psnr_before, psnr_after]) = (self.parameters, self.psnr);
        let unchanged =
            self.unchanged.map_or_else(String::new, |reason| format!("{reason}: it is written unchanged\n"));
        format!(
            "{}{}{unchanged}{}: {:.2} MB, {} parameters ({} before), {psnr_after:.3} dB on training rays ({psnr_before:.3} dB before), {:.1} min\n",
            scales.text(),
            cells.text(),
            escaped_path(self.file),
            self.bytes as f64 / 1e6,
            grouped(after),
            grouped(before),
            self.seconds / 60.0
        )
    }
}

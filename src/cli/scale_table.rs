//! The table of what a scene is made of, a row per scale.

use serde::Serialize;

use super::table::{Table, short};
use strivec_format::digits::grouped;
use strivec_format::model::{FactorKind, Placement, Scale, Scene};
use strivec_train::{Plan, ScalePlan};

/// One scale.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
#[schemars(rename = "ScaleInfo")]
pub(super) struct ScaleRow {
    pub(super) tensors: u64,
    /// `lattice` or `explicit`.
    pub(super) placement: &'static str,
    /// Per axis, in model units.
    pub(super) edges: [f64; 3],
    /// Cells per axis.
    pub(super) resolution: [u32; 3],
    /// `cp` or `vm`.
    pub(super) factors: &'static str,
    pub(super) density_rank: u32,
    pub(super) appearance_rank: u32,
    pub(super) top_k: u32,
    /// Factors that are not zero, and appearance matrix.
    pub(super) parameters: u64,
    /// Bytes of the parameters in memory, as 32-bit floating point.
    pub(super) bytes: u64,
}

/// One row per scale, coarsest first.
pub(super) fn rows(scene: &Scene) -> Vec<ScaleRow> {
    let row = |scale: &Scale| ScaleRow {
        tensors: scale.cloud.len() as u64,
        placement: match scale.cloud.placement {
            Placement::Lattice { .. } => "lattice",
            Placement::Explicit { .. } => "explicit",
        },
        edges: (2.0 * scale.cloud.half_edge).to_array(),
        resolution: scale.cloud.resolution,
        factors: name(scale.factors.kind()),
        density_rank: scale.factors.density_rank(),
        appearance_rank: scale.factors.appearance_rank(),
        top_k: scale.top_k,
        parameters: scale.nonzero_parameter_count(),
        bytes: 4 * scale.nonzero_parameter_count(),
    };
    scene.scales.iter().map(row).collect()
}

/// The rows of a planned scene after its last upsampling.
pub(super) fn planned(plan: &Plan) -> Vec<ScaleRow> {
    let row = |scale: &ScalePlan| ScaleRow {
        tensors: scale.tensors,
        placement: "lattice",
        edges: scale.edge,
        resolution: scale.resolution,
        factors: name(scale.factors),
        density_rank: scale.density_rank,
        appearance_rank: scale.appearance_rank,
        top_k: scale.top_k,
        parameters: scale.parameters,
        bytes: scale.bytes(),
    };
    plan.scales.iter().map(row).collect()
}

/// `rows` as text.
pub(super) fn text(rows: &[ScaleRow]) -> String {
    let mut table =
        Table::new(["scale", "tensors", "placement", "edges", "resolution", "factors", "ranks", "parameters", "bytes"]);
    for (n, row) in rows.iter().enumerate() {
        table.row([
            n.to_string(),
            grouped(row.tensors),
            row.placement.to_owned(),
            per_axis(row.edges.map(short)),
            per_axis(row.resolution),
            row.factors.to_owned(),
            format!("{}+{}", row.density_rank, row.appearance_rank),
            grouped(row.parameters),
            grouped(row.bytes),
        ]);
    }
    table.text()
}

fn name(kind: FactorKind) -> &'static str {
    match kind {
        FactorKind::Cp => "cp",
        FactorKind::Vm => "vm",
    }
}

/// One number if all axes are equal, else three.
fn per_axis<T: PartialEq + ToString>(values: [T; 3]) -> String {
    if values.iter().all(|v| *v == values[0]) {
        return values[0].to_string();
    }
    values.map(|v| v.to_string()).join("x")
}

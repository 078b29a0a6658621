//! TensoRF's checkpoints (Chen et al., ECCV 2022) as scenes: `TensorVMSplit` and `TensorCP`, one tensor over the scene's box.
//!
//! Both programs march with the same step, thresholds and decoder, so the pictures are the same but for rounding. TensoRF's
//! planes and lines have their vertices at both ends, as factors have. What its code computes and a scene cannot express is
//! refused by name: shading by spherical harmonics, by colors, or from positions, and densities by a rectifier.

use glam::DVec3;

use super::family::{MAX_CELLS, MAX_RANK, SceneOptions, bounds, by_row, decoder, frame, occupancy, rules};
use super::state::{CheckpointArray, CheckpointState};
use crate::torch::TorchFile;
use strivec_format::container::Limits;
use strivec_format::model::{
    AppearanceMatrix, Block, Factors, Form, MemoryLimit, Placement, Provenance, Scale, Scene, TensorCloud,
};
use strivec_import::{Fault, Input};

/// Reads the scene of the checkpoint `input`.
///
/// # Errors
///
/// If the file is damaged, or computes what a scene cannot express.
pub fn read(input: &mut Input<'_>, options: &SceneOptions) -> Result<Scene, Fault> {
    let mut state = CheckpointState::new(TorchFile::open(input)?)?;
    let bounds = bounds(&mut state)?;
    let grid: [f64; 3] = state.setting("gridSize")?;
    if grid.iter().any(|n| n.fract() != 0.0 || !(2.0..=MAX_CELLS as f64 + 1.0).contains(n)) {
        let expected = format!("whole numbers from 2 to {}", MAX_CELLS + 1);
        return Err(Fault::malformed("kwargs gridSize", expected, format!("{grid:?}")));
    }
    let vertices = grid.map(|n| n as usize);
    let rules = rules(&mut state, bounds.size() / (DVec3::from_array(grid) - 1.0))?;
    let has_planes = state.has("density_plane.0");
    let density = blocks(&mut state, "density", vertices, has_planes)?;
    let appearance = blocks(&mut state, "app", vertices, has_planes)?;
    let factors = Factors { density, appearance };
    let appearance_matrix = matrix(&mut state, &factors)?;
    let decoder = decoder(&mut state, appearance_matrix.features)?;
    let cloud = TensorCloud {
        placement: Placement::Explicit { centers: vec![bounds.center()] },
        half_edge: 0.5 * bounds.size(),
        resolution: vertices.map(|n| n as u32 - 1),
    };
    let scene = Scene {
        frame: frame(&mut state, options)?,
        bounds,
        rules,
        scales: vec![Scale { cloud, top_k: 1, factors, appearance_matrix }],
        decoder,
        occupancy: occupancy(&mut state)?,
        provenance: Provenance {
            dataset: options.dataset.clone(),
            preset: if has_planes { "tensorf-vm" } else { "tensorf-cp" }.into(),
            steps: 0,
            seed: 0,
            tool: "TensoRF".into(),
        },
        memory: MemoryLimit(Limits::default().memory),
    };
    scene.check()?;
    Ok(scene)
}

/// The numbers of TensoRF's lines and planes belong to axes in the reverse order: line i lies along axis 2 − i, plane i is over
/// the other two.
fn blocks(
    state: &mut CheckpointState<'_, '_>,
    part: &str,
    vertices: [usize; 3],
    has_planes: bool,
) -> Result<Vec<Block>, Fault> {
    let mut lines = Vec::new();
    for axis in 0..3 {
        let name = format!("{part}_line.{}", 2 - axis);
        let line = state.parameter(&name, &[Some(1), None, Some(vertices[axis]), Some(1)])?;
        Fault::unless_within(&format!("components of state_dict {name}"), MAX_RANK, line.shape[1] as u64)?;
        lines.push(line);
    }
    let block = |form, factors: &[&CheckpointArray]| {
        let rank = factors[0].shape[1];
        let mut values = Vec::new();
        factors.iter().for_each(|factor| values.extend(by_row(&factor.values, rank)));
        Block { form, rank: rank as u32, values }
    };
    if !has_planes {
        let ranks = [0, 1, 2].map(|axis: usize| lines[axis].shape[1]);
        if ranks[1] != ranks[0] || ranks[2] != ranks[0] {
            let place = format!("state_dict {part}_line");
            return Err(Fault::malformed(place, "as many components along all axes", format!("{ranks:?}")));
        }
        return Ok(vec![block(Form::Cp, &[&lines[0], &lines[1], &lines[2]])]);
    }
    let mut blocks = Vec::new();
    for (axis, line) in lines.iter().enumerate() {
        let [first, second] = Form::matrix_axes(axis).map(|axis| Some(vertices[axis]));
        let name = format!("{part}_plane.{}", 2 - axis);
        let plane = state.parameter(&name, &[Some(1), Some(line.shape[1]), second, first])?;
        if line.shape[1] > 0 {
            blocks.push(block(Form::Vm(axis), &[line, &plane]));
        }
    }
    Ok(blocks)
}

/// `basis_mat`, whose columns are the components of line 0, then those of line 1 and of line 2; of a CP model, all components.
fn matrix(state: &mut CheckpointState<'_, '_>, factors: &Factors) -> Result<AppearanceMatrix, Fault> {
    let ranks: Vec<usize> = factors.appearance.iter().map(|block| block.rank as usize).collect();
    let rank: usize = ranks.iter().sum();
    let CheckpointArray { shape, values } = state.parameter("basis_mat.weight", &[None, Some(rank)])?;
    let mut weights = Vec::with_capacity(values.len());
    for row in values.chunks_exact(rank.max(1)) {
        let mut end = rank;
        for rank in &ranks {
            weights.extend_from_slice(&row[end - rank..end]);
            end -= rank;
        }
    }
    Ok(AppearanceMatrix { features: shape[0] as u32, rank: rank as u32, weights })
}

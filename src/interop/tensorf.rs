//! TensoRF's checkpoints (Chen et al., ECCV 2022) as scenes: `TensorVMSplit` and `TensorCP`, one tensor over the scene's box.
//!
//! Both programs march with the same step, thresholds and decoder, so the pictures are the same but for rounding. TensoRF's
//! planes and lines have their vertices at both ends, as factors have. What its code computes and a scene cannot express is
//! refused by name: shading by spherical harmonics, by colors, or from positions, and densities by a rectifier.

use glam::{DVec3, UVec3};

use super::state::{Array, State, whole};
use crate::geometry::{Aabb, Similarity};
use crate::import::torch::Checkpoint;
use crate::import::{Fault, Input};
use crate::model::{
    Aggregation, AppearanceMatrix, Block, ColorSpace, Coverage, Decoder, DecoderMode, Factors, Form, Frame, Linear,
    Occupancy, Placement, Provenance, Reduction, Rules, Scale, Scene, TensorCloud, UpAxis,
};

/// What a checkpoint does not say.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneOptions {
    /// The color behind the scene, in \[0, 1\].
    pub background: [f32; 3],
    /// Up in the dataset's space.
    pub up: UpAxis,
    /// The dataset's name.
    pub dataset: String,
}

/// The most cells along an axis, and components of density or appearance, of a scene (spec 5).
const MAX_CELLS: f64 = 1024.0;
const MAX_RANK: usize = 512;

/// Reads the scene of the checkpoint `input`.
///
/// # Errors
///
/// If the file is damaged, or computes what a scene cannot express.
pub fn read(input: &mut Input<'_>, options: &SceneOptions) -> Result<Scene, Fault> {
    let mut state = State::new(Checkpoint::open(input)?)?;
    let corners: [f64; 6] = state.setting("aabb")?;
    let bounds = Aabb { min: DVec3::from_slice(&corners[..3]), max: DVec3::from_slice(&corners[3..]) };
    if !bounds.is_solid() {
        return Err(Fault::malformed("kwargs aabb", "a minimum and a larger maximum", format!("{corners:?}")));
    }
    let grid: [f64; 3] = state.setting("gridSize")?;
    if grid.iter().any(|n| n.fract() != 0.0 || !(2.0..=MAX_CELLS + 1.0).contains(n)) {
        let expected = format!("whole numbers from 2 to {}", MAX_CELLS + 1.0);
        return Err(Fault::malformed("kwargs gridSize", expected, format!("{grid:?}")));
    }
    let vertices = grid.map(|n| n as usize);
    let rules = rules(&mut state, &bounds, grid)?;
    let has_planes = state.has("density_plane.0");
    let density = blocks(&mut state, "density", vertices, has_planes)?;
    let appearance = blocks(&mut state, "app", vertices, has_planes)?;
    let factors = Factors { density, appearance };
    let appearance_matrix = matrix(&mut state, &factors)?;
    let decoder = decoder(&mut state, appearance_matrix.features)?;
    let [near, far] = state.setting("near_far")?;
    let cloud = TensorCloud {
        placement: Placement::Explicit { centers: vec![bounds.center()] },
        half_edge: 0.5 * bounds.size(),
        resolution: vertices.map(|n| n as u32 - 1),
    };
    let scene = Scene {
        frame: Frame {
            model_from_dataset: Similarity::IDENTITY,
            up: options.up,
            meters_per_unit: None,
            near,
            far,
            background: options.background,
            color_space: ColorSpace::Srgb,
        },
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
    };
    scene.check().map_err(|e| Fault::malformed(e.place, e.expected, e.found))?;
    Ok(scene)
}

fn rules(state: &mut State<'_, '_>, bounds: &Aabb, grid: [f64; 3]) -> Result<Rules, Fault> {
    let activation = state.text("fea2denseAct")?;
    if activation != "softplus" {
        let instead = "train with fea2denseAct = softplus";
        return Err(Fault::unsupported(format!("the density activation {activation:?}"), instead));
    }
    let cell = bounds.size() / (DVec3::from_array(grid) - 1.0);
    let ([step_ratio], [density_shift], [distance_scale], [min_weight]) = (
        state.setting("step_ratio")?,
        state.setting("density_shift")?,
        state.setting("distance_scale")?,
        state.setting("rayMarch_weight_thres")?,
    );
    Ok(Rules {
        coverage: Coverage::All,
        aggregation: Aggregation::Normalized,
        density_reduction: Reduction::Sum,
        appearance_reduction: Reduction::Sum,
        density_shift,
        distance_scale,
        step: step_ratio * cell.element_sum() / 3.0,
        min_transmittance: 0.0,
        min_weight,
        contraction: None,
        sky: None,
    })
}

/// The numbers of TensoRF's lines and planes belong to axes in the reverse order: line i lies along axis 2 − i, plane i is over
/// the other two.
fn blocks(state: &mut State<'_, '_>, part: &str, vertices: [usize; 3], has_planes: bool) -> Result<Vec<Block>, Fault> {
    let mut lines = Vec::new();
    for axis in 0..3 {
        let name = format!("{part}_line.{}", 2 - axis);
        let line = state.parameter(&name, &[Some(1), None, Some(vertices[axis]), Some(1)])?;
        Fault::unless_within(&format!("components of state_dict {name}"), MAX_RANK as u64, line.shape[1] as u64)?;
        lines.push(line);
    }
    let block = |form, factors: &[&Array]| {
        // [component][row] as [row][component].
        let rank = factors[0].shape[1];
        let mut values = Vec::new();
        for Array { values: numbers, .. } in factors {
            let rows = numbers.len() / rank.max(1);
            values.extend((0..rows).flat_map(|row| (0..rank).map(move |c| numbers[c * rows + row])));
        }
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
fn matrix(state: &mut State<'_, '_>, factors: &Factors) -> Result<AppearanceMatrix, Fault> {
    let ranks: Vec<usize> = factors.appearance.iter().map(|block| block.rank as usize).collect();
    let rank: usize = ranks.iter().sum();
    let Array { shape, values } = state.parameter("basis_mat.weight", &[None, Some(rank)])?;
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

/// The network of the shading modes `MLP_Fea` and `MLP`, whose input is features, direction and their encodings.
fn decoder(state: &mut State<'_, '_>, features: u32) -> Result<Decoder, Fault> {
    let mode = state.text("shadingMode")?;
    let feature_frequencies = match mode.as_str() {
        "MLP_Fea" => state.count("fea_pe")?,
        "MLP" => 0,
        other => {
            let what = format!("the shading mode {}", other.escape_debug());
            return Err(Fault::unsupported(what, "train with shadingMode = MLP_Fea"));
        }
    };
    let mut decoder = Decoder {
        mode: DecoderMode::PerSample,
        feature_frequencies,
        direction_frequencies: state.count("view_pe")?,
        layers: Vec::new(),
    };
    let mut inputs = decoder.input_len(features) as usize;
    // Rectifiers are the layers between.
    for layer in (0..).step_by(2) {
        let name = |part| format!("renderModule.mlp.{layer}.{part}");
        if !state.has(&name("weight")) {
            break;
        }
        let weights = state.parameter(&name("weight"), &[None, Some(inputs)])?;
        let outputs = weights.shape[0];
        let bias = state.parameter(&name("bias"), &[Some(outputs)])?.values;
        decoder.layers.push(Linear { inputs: inputs as u32, outputs: outputs as u32, weights: weights.values, bias });
        inputs = outputs;
    }
    if decoder.layers.is_empty() {
        return Err(Fault::malformed("the keys of state_dict", "renderModule.mlp.0.weight", state.parameter_names()));
    }
    Ok(decoder)
}

/// The alpha mask: a bit for each vertex, most significant first, x fastest. TensoRF samples where its interpolation is positive.
fn occupancy(state: &mut State<'_, '_>) -> Result<Option<Occupancy>, Fault> {
    let Some(mask) = state.at_root("alphaMask.mask") else { return Ok(None) };
    let part = |state: &State<'_, '_>, name: &str| {
        state.at_root(name).ok_or_else(|| Fault::malformed("the keys of the checkpoint", name, "alphaMask.mask alone"))
    };
    let (shape, corners) = (part(state, "alphaMask.shape")?, part(state, "alphaMask.aabb")?);
    let corners: [f64; 6] = state.numbers(corners, "alphaMask.aabb")?;
    let [.., z, y, x] = state.numbers::<5>(shape, "alphaMask.shape")?;
    let [x, y, z] = [whole("alphaMask.shape", x)?, whole("alphaMask.shape", y)?, whole("alphaMask.shape", z)?];
    let bounds = Aabb { min: DVec3::from_slice(&corners[..3]), max: DVec3::from_slice(&corners[3..]) };
    let bytes = state.bytes(mask, "alphaMask.mask")?;
    let count = u64::from(x).checked_mul(y.into()).and_then(|n| n.checked_mul(z.into()));
    if count.map(|count| count.div_ceil(8)) != Some(bytes.len() as u64) {
        let expected = format!("one bit for each of {x} x {y} x {z} vertices");
        return Err(Fault::malformed("alphaMask.mask", expected, format!("{} bytes", bytes.len())));
    }
    let mut occupancy = Occupancy::empty(bounds, UVec3::new(x, y, z));
    for n in 0..count.unwrap_or(0) as usize {
        if bytes[n / 8] >> (7 - n % 8) & 1 == 1 {
            occupancy.words[n / 64] |= 1 << (n % 64);
        }
    }
    Ok(Some(occupancy))
}

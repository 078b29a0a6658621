//! The parts that the checkpoints of TensoRF's family share: box, rules, decoder, alpha mask.

use glam::{DVec3, UVec3};

use super::state::{CheckpointState, whole};
use strivec_format::geometry::{Aabb, Similarity};
use strivec_format::model::{
    Aggregation, ColorSpace, Coverage, Decoder, DecoderMode, Frame, Linear, Occupancy, Reduction, Rules, UpAxis,
};
use strivec_import::Fault;

/// The parts of a scene that a checkpoint of TensoRF's family does not hold.
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
pub(super) const MAX_CELLS: usize = 1024;
pub(super) const MAX_RANK: u64 = 512;

/// The box that rays march through.
pub(super) fn bounds(state: &mut CheckpointState<'_, '_>) -> Result<Aabb, Fault> {
    let corners: [f64; 6] = state.setting("aabb")?;
    let bounds = Aabb { min: DVec3::from_slice(&corners[..3]), max: DVec3::from_slice(&corners[3..]) };
    if bounds.is_solid() {
        return Ok(bounds);
    }
    Err(Fault::malformed("kwargs aabb", "a minimum and a larger maximum", format!("{corners:?}")))
}

/// The dataset's space is the model's.
pub(super) fn frame(state: &mut CheckpointState<'_, '_>, options: &SceneOptions) -> Result<Frame, Fault> {
    let [near, far] = state.setting("near_far")?;
    Ok(Frame {
        model_from_dataset: Similarity::IDENTITY,
        up: options.up,
        meters_per_unit: None,
        near,
        far,
        background: options.background,
        color_space: ColorSpace::Srgb,
    })
}

/// The rules of TensoRF's march. A step is `step_ratio` times the mean edge of `cell`.
pub(super) fn rules(state: &mut CheckpointState<'_, '_>, cell: DVec3) -> Result<Rules, Fault> {
    let activation = state.text("fea2denseAct")?;
    if activation != "softplus" {
        let instead = "train with fea2denseAct = softplus";
        return Err(Fault::unsupported(format!("the density activation {activation:?}"), instead));
    }
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

/// \[component\]\[row\] as \[row\]\[component\], for `rank` components.
pub(super) fn by_row(numbers: &[f32], rank: usize) -> impl Iterator<Item = f32> + '_ {
    let rows = numbers.len() / rank.max(1);
    (0..rows).flat_map(move |row| (0..rank).map(move |c| numbers[c * rows + row]))
}

/// The network of the shading modes `MLP_Fea` and `MLP`, whose input is features, direction and their encodings.
pub(super) fn decoder(state: &mut CheckpointState<'_, '_>, features: u32) -> Result<Decoder, Fault> {
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
pub(super) fn occupancy(state: &mut CheckpointState<'_, '_>) -> Result<Option<Occupancy>, Fault> {
    let Some(mask) = state.at_root("alphaMask.mask") else { return Ok(None) };
    let part = |state: &CheckpointState<'_, '_>, name: &str| {
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

//! The parts that the checkpoints of TensoRF's family share, of a scene: the inverse of `family.rs`.

use glam::DVec3;

use super::{Error, Value};
use strivec_format::geometry::Aabb;
use strivec_format::model::{DecoderMode, Occupancy, Scene};

/// TensoRF's own thresholds and frequencies for what a scene does not have.
const ALPHA_THRESHOLD: f64 = 1e-4;
const POSITION_FREQUENCIES: i64 = 6;

/// The parts that the programs of the family have in layouts of their own.
pub(super) struct Parts {
    /// Bounds of the scene, in model space.
    pub(super) bounds: Aabb,
    pub(super) grid: [i64; 3],
    pub(super) density_ranks: Value<'static>,
    pub(super) appearance_ranks: Value<'static>,
    pub(super) features: Value<'static>,
    pub(super) step_ratio: f64,
    /// All but the decoder's.
    pub(super) parameters: Vec<(String, Value<'static>)>,
}

/// Fails if `scene` has what no program of the family has.
pub(super) fn check_expressible(scene: &Scene) -> Result<(), Error> {
    let widths: Vec<u32> = scene.decoder.layers.iter().map(|layer| layer.outputs).collect();
    let rotation = scene.frame.model_from_dataset.rotation;
    Error::unless_expressible([
        (scene.rules.contraction.is_none(), "a bounded scene", "an unbounded one".into()),
        (scene.rules.sky.is_none(), "a background", "a sky".into()),
        (scene.decoder.mode == DecoderMode::PerSample, "a decoder per sample", scene.decoder.mode.name().into()),
        (matches!(widths[..], [a, b, 3] if a == b), "a decoder of layers n, n and 3", format!("{widths:?}")),
        (rotation.is_near_identity(), "no rotation from dataset to model", format!("{rotation}")),
    ])
}

/// The content of the checkpoint of `scene` with `parts`.
pub(super) fn checkpoint(scene: &Scene, parts: Parts) -> Value<'static> {
    let map = &scene.frame.model_from_dataset;
    let Parts { bounds, grid, density_ranks, appearance_ranks, features, step_ratio, mut parameters } = parts;
    let (rules, decoder) = (&scene.rules, &scene.decoder);
    let kwargs = [
        ("aabb", of_box(scene, &bounds)),
        ("gridSize", Value::List(grid.map(Value::Int).to_vec())),
        ("density_n_comp", density_ranks),
        ("appearance_n_comp", appearance_ranks),
        ("app_dim", features),
        ("density_shift", Value::Float(rules.density_shift)),
        ("alphaMask_thres", Value::Float(ALPHA_THRESHOLD)),
        ("distance_scale", Value::Float(rules.distance_scale * map.scale)),
        ("rayMarch_weight_thres", Value::Float(rules.min_weight)),
        ("fea2denseAct", Value::text("softplus")),
        ("near_far", Value::List([scene.frame.near, scene.frame.far].map(|t| Value::Float(t / map.scale)).to_vec())),
        ("step_ratio", Value::Float(step_ratio)),
        ("shadingMode", Value::text(shading_mode(scene))),
        ("pos_pe", Value::Int(POSITION_FREQUENCIES)),
        ("view_pe", Value::Int(decoder.direction_frequencies.into())),
        ("fea_pe", Value::Int(decoder.feature_frequencies.into())),
        ("featureC", Value::Int(decoder.layers[0].outputs.into())),
    ];
    for (n, layer) in decoder.layers.iter().enumerate() {
        let name = |part| format!("renderModule.mlp.{}.{part}", 2 * n);
        let [outputs, inputs] = [layer.outputs as usize, layer.inputs as usize];
        parameters.push((name("weight"), Value::tensor([outputs, inputs], layer.weights.clone())));
        parameters.push((name("bias"), Value::tensor([outputs], layer.bias.clone())));
    }
    let kwargs = kwargs.map(|(key, value)| (key.into(), value)).to_vec();
    let parameters = parameters.into_iter().map(|(key, value)| (key.into(), value)).collect();
    let mut root = vec![("kwargs".into(), Value::Dict(kwargs)), ("state_dict".into(), Value::OrderedDict(parameters))];
    root.extend(alpha_mask(scene).into_iter().map(|(key, value)| (key.into(), value)));
    Value::Dict(root)
}

/// The decoder's kind: with or without an encoding of features.
pub(super) fn shading_mode(scene: &Scene) -> &'static str {
    if scene.decoder.feature_frequencies > 0 { "MLP_Fea" } else { "MLP" }
}

/// The entries of the alpha mask: none if there is no occupancy.
pub(super) fn alpha_mask(scene: &Scene) -> Vec<(&'static str, Value<'static>)> {
    let Some(occupancy) = &scene.occupancy else { return Vec::new() };
    let [x, y, z] = occupancy.vertices.to_array().map(i64::from);
    vec![
        ("alphaMask.shape", Value::Tuple([1, 1, z, y, x].map(Value::Int).to_vec())),
        ("alphaMask.mask", mask(occupancy)),
        ("alphaMask.aabb", of_box(scene, &occupancy.bounds)),
    ]
}

/// The ratio of a step to the mean edge of `cell` that gives this step when it is read; and whether it gives exactly this one.
pub(super) fn step_ratio(step: f64, cell: DVec3) -> (f64, bool) {
    let sum = cell.element_sum();
    let ratio = 3.0 * step / sum;
    let short = format!("{ratio:.9e}").parse().unwrap_or(ratio);
    let candidates = [short, ratio, ratio.next_up(), ratio.next_down()];
    let exact = candidates.into_iter().find(|ratio| ratio * sum / 3.0 == step);
    (exact.unwrap_or(ratio), exact.is_some())
}

/// The corners of a box of model space, in dataset space.
fn of_box(scene: &Scene, bounds: &Aabb) -> Value<'static> {
    let to_dataset = scene.frame.model_from_dataset.inverse();
    let corners = [bounds.min, bounds.max].map(|corner| to_dataset.point(corner).to_array());
    Value::tensor([2, 3], corners.concat().into_iter().map(|v| v as f32).collect::<Vec<f32>>())
}

/// A bit for each vertex, most significant first.
fn mask(occupancy: &Occupancy) -> Value<'static> {
    let count = occupancy.vertices.as_u64vec3().element_product() as usize;
    let mut bytes = vec![0u8; count.div_ceil(8)];
    for n in (0..count).filter(|n| occupancy.words[n / 64] >> (n % 64) & 1 == 1) {
        bytes[n / 8] |= 1 << (7 - n % 8);
    }
    Value::array([bytes.len()], bytes)
}

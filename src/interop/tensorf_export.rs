//! Scenes of one tensor as checkpoints of TensoRF: the inverse of `tensorf.rs`.

use glam::DVec3;

use super::{Error, Value};
use crate::geometry::Aabb;
use crate::model::{Block, DecoderMode, FactorKind, Form, Occupancy, Scale, Scene};

/// TensoRF's own thresholds and frequencies for what a scene does not have.
const ALPHA_THRESHOLD: f64 = 1e-4;
const POSITION_FREQUENCIES: i64 = 6;

/// The content of a TensoRF checkpoint of `scene`, which must have passed [`Scene::check`], for [`super::write_checkpoint`]: a
/// `TensorVMSplit` or a `TensorCP`. Its pictures are the scene's, if the scene's bounds are those of its tensor; else samples
/// lie elsewhere on a ray. Read again by [`super::tensorf::read`], a scene that was read from a checkpoint is the same scene.
///
/// # Errors
///
/// If the scene has what TensoRF's code has not: more than one tensor, a contraction, a sky, a decoder per ray, another
/// decoder than three layers of which the first two are equally wide, or a rotation between dataset and model.
pub fn tensorf_checkpoint(scene: &Scene) -> Result<Value<'static>, Error> {
    let scale = checked(scene)?;
    let map = &scene.frame.model_from_dataset;
    let to_dataset = map.inverse();
    let tensor = Aabb::around(scale.cloud.center(0), scale.cloud.half_edge);
    let is_whole = |a: f64, b: f64| (a - b).abs() <= 1e-9 * tensor.size().max_element();
    let corners = |bounds: &Aabb| [bounds.min, bounds.max].map(|corner| corner.to_array()).concat();
    let fits = corners(&tensor).iter().zip(corners(&scene.bounds)).all(|(&a, b)| is_whole(a, b));
    // Of a scene that was read from a checkpoint, the very numbers of it.
    let bounds = if fits { scene.bounds } else { tensor };
    let of_box = |bounds: &Aabb| {
        let corners = [bounds.min, bounds.max].map(|corner| to_dataset.point(corner).to_array());
        Value::tensor([2, 3], corners.concat().into_iter().map(|v| v as f32).collect::<Vec<f32>>())
    };
    let vertices = scale.cloud.resolution.map(|cells| i64::from(cells) + 1);
    let integers = |values: [i64; 3]| Value::List(values.map(Value::Int).to_vec());
    let is_cp = scale.factors.kind() == FactorKind::Cp;
    let rules = &scene.rules;
    let decoder = &scene.decoder;
    let kwargs = [
        ("aabb", of_box(&bounds)),
        ("gridSize", integers(vertices)),
        ("density_n_comp", ranks(&scale.factors.density)),
        ("appearance_n_comp", ranks(&scale.factors.appearance)),
        ("app_dim", Value::Int(scene.features().into())),
        ("density_shift", Value::Float(rules.density_shift)),
        ("alphaMask_thres", Value::Float(ALPHA_THRESHOLD)),
        ("distance_scale", Value::Float(rules.distance_scale * map.scale)),
        ("rayMarch_weight_thres", Value::Float(rules.min_weight)),
        ("fea2denseAct", Value::text("softplus")),
        ("near_far", Value::List([scene.frame.near, scene.frame.far].map(|t| Value::Float(t / map.scale)).to_vec())),
        ("step_ratio", Value::Float(step_ratio(rules.step, &bounds, vertices))),
        ("shadingMode", Value::text(if decoder.feature_frequencies > 0 { "MLP_Fea" } else { "MLP" })),
        ("pos_pe", Value::Int(POSITION_FREQUENCIES)),
        ("view_pe", Value::Int(decoder.direction_frequencies.into())),
        ("fea_pe", Value::Int(decoder.feature_frequencies.into())),
        ("featureC", Value::Int(decoder.layers[0].outputs.into())),
    ];
    let mut state = Vec::new();
    for (part, blocks) in [("density", &scale.factors.density), ("app", &scale.factors.appearance)] {
        if !is_cp {
            state.extend((0..3).map(|i| (format!("{part}_plane.{i}"), plane(blocks, 2 - i, scale.cloud.resolution))));
        }
        state.extend((0..3).map(|i| (format!("{part}_line.{i}"), line(blocks, 2 - i, scale.cloud.resolution))));
    }
    let rank = scale.factors.appearance_rank() as usize;
    state.push(("basis_mat.weight".into(), Value::tensor([scene.features() as usize, rank], basis(scale))));
    for (n, layer) in decoder.layers.iter().enumerate() {
        let name = |part| format!("renderModule.mlp.{}.{part}", 2 * n);
        let [outputs, inputs] = [layer.outputs as usize, layer.inputs as usize];
        state.push((name("weight"), Value::tensor([outputs, inputs], layer.weights.clone())));
        state.push((name("bias"), Value::tensor([outputs], layer.bias.clone())));
    }
    let pairs =
        |pairs: Vec<(String, Value<'static>)>| pairs.into_iter().map(|(key, value)| (key.into(), value)).collect();
    let kwargs = kwargs.map(|(key, value)| (key.into(), value)).to_vec();
    let mut root =
        vec![("kwargs".into(), Value::Dict(kwargs)), ("state_dict".into(), Value::OrderedDict(pairs(state)))];
    if let Some(occupancy) = &scene.occupancy {
        let [x, y, z] = occupancy.vertices.to_array().map(i64::from);
        root.push(("alphaMask.shape".into(), Value::Tuple([1, 1, z, y, x].map(Value::Int).to_vec())));
        root.push(("alphaMask.mask".into(), mask(occupancy)));
        root.push(("alphaMask.aabb".into(), of_box(&occupancy.bounds)));
    }
    Ok(Value::Dict(root))
}

/// The scale of a scene that TensoRF's code expresses.
fn checked(scene: &Scene) -> Result<&Scale, Error> {
    let tensors: usize = scene.scales.iter().map(|scale| scale.cloud.len()).sum();
    let widths: Vec<u32> = scene.decoder.layers.iter().map(|layer| layer.outputs).collect();
    let rotation = scene.frame.model_from_dataset.rotation;
    for (is_met, expected, found) in [
        (tensors == 1, "one tensor", format!("{tensors}")),
        (scene.rules.contraction.is_none(), "a bounded scene", "an unbounded one".into()),
        (scene.rules.sky.is_none(), "a background", "a sky".into()),
        (scene.decoder.mode == DecoderMode::PerSample, "a decoder per sample", scene.decoder.mode.name().into()),
        (matches!(widths[..], [a, b, 3] if a == b), "a decoder of layers n, n and 3", format!("{widths:?}")),
        (rotation.is_near_identity(), "no rotation from dataset to model", format!("{rotation}")),
    ] {
        if !is_met {
            return Err(Error::NotExpressible { expected, found });
        }
    }
    Ok(&scene.scales[0])
}

/// The ratio of a step to a cell that gives exactly this step when it is read.
fn step_ratio(step: f64, bounds: &Aabb, vertices: [i64; 3]) -> f64 {
    let sum = (bounds.size() / DVec3::from_array(vertices.map(|n| (n - 1) as f64))).element_sum();
    let ratio = 3.0 * step / sum;
    let short = format!("{ratio:.9e}").parse().unwrap_or(ratio);
    let candidates = [short, ratio, ratio.next_up(), ratio.next_down()];
    candidates.into_iter().find(|ratio| ratio * sum / 3.0 == step).unwrap_or(ratio)
}

/// Components of line and plane 0, 1 and 2, which belong to the axes z, y and x; of a CP model, one number.
fn ranks(blocks: &[Block]) -> Value<'static> {
    let rank = |axis| blocks.iter().filter(|block| belongs(block, axis)).map(|block| i64::from(block.rank)).sum();
    let axes: &[usize] = if blocks.iter().any(|block| block.form == Form::Cp) { &[2] } else { &[2, 1, 0] };
    Value::List(axes.iter().map(|&axis| Value::Int(rank(axis))).collect())
}

/// True if a factor of `block` is line 2 − `axis`.
fn belongs(block: &Block, axis: usize) -> bool {
    block.form == Form::Cp || block.form == Form::Vm(axis)
}

/// A vector along `axis`, \[1\]\[component\]\[vertex\]\[1\].
fn line(blocks: &[Block], axis: usize, resolution: [u32; 3]) -> Value<'static> {
    let vertices = resolution[axis] as usize + 1;
    let Some(block) = blocks.iter().find(|block| belongs(block, axis)) else {
        return Value::tensor([1, 0, vertices, 1], Vec::<f32>::new());
    };
    let factor = if block.form == Form::Cp { axis } else { 0 };
    Value::tensor([1, block.rank as usize, vertices, 1], numbers(block, factor, resolution))
}

/// The matrix beside the vector along `axis`, \[1\]\[component\]\[second axis\]\[first axis\].
fn plane(blocks: &[Block], axis: usize, resolution: [u32; 3]) -> Value<'static> {
    let [first, second] = Form::matrix_axes(axis).map(|axis| resolution[axis] as usize + 1);
    match blocks.iter().find(|block| block.form == Form::Vm(axis)) {
        Some(block) => Value::tensor([1, block.rank as usize, second, first], numbers(block, 1, resolution)),
        None => Value::tensor([1, 0, second, first], Vec::<f32>::new()),
    }
}

/// \[component\]\[row\] the numbers of a factor of the one tensor of `block`.
fn numbers(block: &Block, factor: usize, resolution: [u32; 3]) -> Vec<f32> {
    let (rank, rows) = (block.rank as usize, block.form.factors(resolution)[factor].clone());
    (0..rank).flat_map(|c| rows.clone().map(move |row| block.values[row * rank + c])).collect()
}

/// \[feature\]\[component\] the appearance matrix, with the components of line 0 first.
fn basis(scale: &Scale) -> Vec<f32> {
    let matrix = &scale.appearance_matrix;
    let mut weights = Vec::with_capacity(matrix.weights.len());
    for row in matrix.weights.chunks_exact(matrix.rank as usize) {
        let mut end = row.len();
        for block in scale.factors.appearance.iter().rev() {
            weights.extend_from_slice(&row[end - block.rank as usize..end]);
            end -= block.rank as usize;
        }
    }
    weights
}

/// A bit for each vertex, most significant first.
fn mask(occupancy: &Occupancy) -> Value<'static> {
    let count = occupancy.vertices.as_usizevec3().element_product();
    let mut bytes = vec![0u8; count.div_ceil(8)];
    for n in (0..count).filter(|n| occupancy.words[n / 64] >> (n % 64) & 1 == 1) {
        bytes[n / 8] |= 1 << (7 - n % 8);
    }
    Value::Array { shape: vec![bytes.len()], bytes: bytes.into() }
}

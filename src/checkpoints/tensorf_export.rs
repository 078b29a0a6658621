//! Scenes of one tensor as checkpoints of TensoRF: the inverse of `tensorf.rs`.

use glam::DVec3;

use super::family_export::{Parts, check_expressible, checkpoint, step_ratio};
use super::{Error, Value};
use strivec_format::geometry::Aabb;
use strivec_format::model::{Block, FactorKind, Form, Scale, Scene};

/// The content of a TensoRF checkpoint of `scene`, which must have passed [`Scene::check`], for [`super::write_checkpoint`]: a
/// `TensorVMSplit` or a `TensorCP`. Its pictures are the scene's, if the scene's bounds are those of its tensor; else samples
/// lie elsewhere on a ray. Read again by [`super::tensorf::read`], a scene that was read from a checkpoint is the same scene.
///
/// # Errors
///
/// If the scene has what TensoRF's code has not: more than one tensor, a contraction, a sky, a decoder per ray, another
/// decoder than three layers of which the first two are equally wide, or a rotation between dataset and model.
pub fn tensorf_checkpoint(scene: &Scene) -> Result<Value<'static>, Error> {
    check_expressible(scene)?;
    let tensors: usize = scene.scales.iter().map(|scale| scale.cloud.len()).sum();
    Error::unless_expressible([(tensors == 1, "one tensor", format!("{tensors}"))])?;
    let scale = &scene.scales[0];
    let resolution = scale.cloud.resolution;
    let tensor = Aabb::around(scale.cloud.center(0), scale.cloud.half_edge);
    let is_whole = |a: f64, b: f64| (a - b).abs() <= 1e-9 * tensor.size().max_element();
    let corners = |bounds: &Aabb| [bounds.min, bounds.max].map(|corner| corner.to_array()).concat();
    let fits = corners(&tensor).iter().zip(corners(&scene.bounds)).all(|(&a, b)| is_whole(a, b));
    // Of a scene that was read from a checkpoint, the very numbers of it.
    let bounds = if fits { scene.bounds } else { tensor };
    let mut parameters = Vec::new();
    for (part, blocks) in [("density", &scale.factors.density), ("app", &scale.factors.appearance)] {
        if scale.factors.kind() == FactorKind::Vm {
            parameters.extend((0..3).map(|i| (format!("{part}_plane.{i}"), plane(blocks, 2 - i, resolution))));
        }
        parameters.extend((0..3).map(|i| (format!("{part}_line.{i}"), line(blocks, 2 - i, resolution))));
    }
    let rank = scale.factors.appearance_rank() as usize;
    parameters.push(("basis_mat.weight".into(), Value::tensor([scene.features() as usize, rank], basis(scale))));
    let cells = DVec3::from_array(resolution.map(f64::from));
    let parts = Parts {
        bounds,
        grid: resolution.map(|cells| i64::from(cells) + 1),
        density_ranks: ranks(&scale.factors.density),
        appearance_ranks: ranks(&scale.factors.appearance),
        features: Value::Int(scene.features().into()),
        step_ratio: step_ratio(scene.rules.step, bounds.size() / cells).0,
        parameters,
    };
    Ok(checkpoint(scene, parts))
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

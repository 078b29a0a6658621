//! Scenes as checkpoints of the authors' program, with the files that hold the rest.

use std::fmt::Write as _;

use glam::{DVec3, Vec3};

use crate::Error;
use crate::Value;
use crate::family_export::{Parts, alpha_mask, check_expressible, checkpoint, shading_mode, step_ratio};
use crate::pickle_writer::write_pickle;
use strivec_format::model::{Aggregation, Block, Coverage, FactorKind, Form, Reduction, Scale, Scene};

/// The most neighbors that the program's search holds.
const MAX_TOP_K: u32 = 8;

/// A checkpoint and the files beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct AuthorsFiles {
    /// The content of `NAME.th`, for [`crate::write_checkpoint`].
    pub checkpoint: Value<'static>,
    /// The files beside it: the end of their names after `NAME`, and their bytes. `.txt` is the configuration; `_centers_S.txt`
    /// holds the centers of scale S, a line `x;y;z` each, or `_meta.pkl` centers and half edges of all scales.
    pub beside: Vec<(String, Vec<u8>)>,
}

/// `scene`, which must have passed [`Scene::check`], as a checkpoint of a `StrivecCP_hier` or a `Strivec_DBase`, in dataset space.
/// Centers and half edges are rounded to 32 bits. Read again by [`super::read`], a scene that was read from a checkpoint is the same.
///
/// The program's march ends at a transmittance of 0.001, whatever the scene's rules are, and its weights of neighbors
/// differ by up to 2e-6 from those of [`Aggregation::Normalized`]. Components of the three axes of a `Strivec_DBase`
/// share a matrix: here each component has a vector that is not zero along one axis alone.
///
/// # Errors
///
/// If the scene has what the program has not: products of three vectors beside products with matrices, matrices of unequal axes,
/// more than eight neighbors, and what TensoRF's programs have not either ([`crate::tensorf_checkpoint`]).
pub fn authors_files(scene: &Scene) -> Result<AuthorsFiles, Error> {
    check(scene)?;
    let map = &scene.frame.model_from_dataset;
    let to_dataset = map.inverse();
    let is_vm = scene.scales[0].factors.kind() == FactorKind::Vm;
    let half_edges: Vec<Vec3> = scene.scales.iter().map(|s| (s.cloud.half_edge / map.scale).as_vec3()).collect();
    let mut parameters = Vec::new();
    for (part, blocks) in [("density", density as fn(&Scale) -> &[Block]), ("app", appearance)] {
        for (l, scale) in scene.scales.iter().enumerate() {
            let name = |axis| format!("{part}_line.{}", 3 * l + axis);
            parameters.extend((0..3).map(|axis| (name(axis), line(scale, blocks(scale), axis))));
            if is_vm {
                parameters.push((format!("{part}_plane.{l}"), plane(scale, blocks(scale))));
            }
        }
    }
    for (l, scale) in scene.scales.iter().enumerate() {
        let matrix = &scale.appearance_matrix;
        let shape = [matrix.features as usize, matrix.rank as usize];
        parameters.push((format!("basis_mat.{l}.weight"), Value::tensor(shape, matrix.weights.clone())));
    }
    // The first scale whose cells give exactly the same step when they are read again.
    let cell = |l: usize| {
        let cells = DVec3::from_array(scene.scales[l].cloud.resolution.map(f64::from));
        2.0 * half_edges[l].as_dvec3() / cells
    };
    let step = scene.rules.step / map.scale;
    let exact = (0..half_edges.len()).find(|&l| step_ratio(step, cell(l)).1);
    let step_scale = exact.unwrap_or(0);
    let ranks = |blocks: fn(&Scale) -> &[Block]| {
        let rank = |scale| blocks(scale).iter().map(|block| i64::from(block.rank)).sum();
        Value::List(scene.scales.iter().map(|scale| Value::List(vec![Value::Int(rank(scale))])).collect())
    };
    let grid = scene.bounds.size() / map.scale / cell(step_scale);
    let parts = Parts {
        bounds: scene.bounds,
        grid: grid.ceil().to_array().map(|n| n as i64),
        density_ranks: ranks(density),
        appearance_ranks: ranks(appearance),
        features: Value::List(vec![Value::Int(scene.features().into()); half_edges.len()]),
        step_ratio: step_ratio(step, cell(step_scale)).0,
        parameters,
    };
    let step_ratio = parts.step_ratio;
    let checkpoint = checkpoint(scene, parts);
    let centers = |scale: &Scale| -> Vec<Vec3> {
        scale.cloud.centers().map(|center| to_dataset.point(center).as_vec3()).collect()
    };
    let mut beside = vec![(".txt".to_owned(), config(scene, &half_edges, step_scale, step_ratio).into_bytes())];
    if is_vm {
        beside.push(("_meta.pkl".into(), meta(scene, &half_edges, centers)?));
    } else {
        for (l, scale) in scene.scales.iter().enumerate() {
            let lines = centers(scale).into_iter().map(|Vec3 { x, y, z }| format!("{x};{y};{z}\n"));
            beside.push((format!("_centers_{l}.txt"), lines.collect::<String>().into_bytes()));
        }
    }
    Ok(AuthorsFiles { checkpoint, beside })
}

fn density(scale: &Scale) -> &[Block] {
    &scale.factors.density
}

fn appearance(scale: &Scale) -> &[Block] {
    &scale.factors.appearance
}

/// Fails if `scene` has what the program has not.
fn check(scene: &Scene) -> Result<(), Error> {
    check_expressible(scene)?;
    let map_scale = scene.frame.model_from_dataset.scale;
    let kinds = scene.scales.iter().map(|scale| scale.factors.kind());
    let is_one_kind = kinds.clone().all(|kind| kind == scene.scales[0].factors.kind());
    Error::unless_expressible([(is_one_kind, "factors of one kind in all scales", "both kinds".into())])?;
    for scale in &scene.scales {
        let resolution = scale.cloud.resolution;
        let is_cube = resolution.iter().all(|&cells| cells == resolution[0]) || scale.factors.kind() == FactorKind::Cp;
        let reach = scale.cloud.half_edge.length() / map_scale;
        // Below a distance of 1 the sum of weights is at least 1, which the program's weights need to be normalized. Its clamped
        // weights depend on the unit.
        let (has_weights, expected, found) = match scene.rules.aggregation {
            Aggregation::Normalized => {
                (reach < 1.0, "boxes whose half diagonal is below 1 in the dataset's units", reach.to_string())
            }
            Aggregation::Clamped => {
                (map_scale == 1.0, "clamped weights in the dataset's units", format!("units {map_scale} times as many"))
            }
        };
        Error::unless_expressible([
            (scale.top_k <= MAX_TOP_K, "at most 8 neighbors", scale.top_k.to_string()),
            (is_cube, "matrices of equal axes", format!("{resolution:?} cells")),
            (has_weights, expected, found),
        ])?;
    }
    Ok(())
}

/// \[tensor\]\[component\]\[vertex\] the vectors along `axis`. Components with a vector along another one have zeros.
fn line(scale: &Scale, blocks: &[Block], axis: usize) -> Value<'static> {
    let (tensors, resolution) = (scale.cloud.len(), scale.cloud.resolution);
    let vertices = resolution[axis] as usize + 1;
    let mut numbers = Vec::new();
    for tensor in 0..tensors {
        for block in blocks {
            match block.form {
                Form::Vm(other) if other != axis => numbers.extend(vec![0.0; block.rank as usize * vertices]),
                Form::Vm(_) => numbers.extend(factor(block, tensor, 0, resolution)),
                Form::Cp => numbers.extend(factor(block, tensor, axis, resolution)),
            }
        }
    }
    Value::tensor([tensors, numbers.len() / (tensors * vertices), vertices], numbers)
}

/// \[tensor\]\[component\]\[first axis\]\[second axis\] the matrices.
fn plane(scale: &Scale, blocks: &[Block]) -> Value<'static> {
    let (tensors, resolution) = (scale.cloud.len(), scale.cloud.resolution);
    let n = resolution[0] as usize + 1;
    let mut numbers: Vec<f32> = Vec::new();
    for tensor in 0..tensors {
        for block in blocks {
            // [second axis][first axis], as a scene has them.
            let matrices: Vec<f32> = factor(block, tensor, 1, resolution).collect();
            for matrix in matrices.chunks_exact(n * n) {
                numbers.extend((0..n * n).map(|at| matrix[at % n * n + at / n]));
            }
        }
    }
    Value::tensor([tensors, numbers.len() / (tensors * n * n), n, n], numbers)
}

/// \[component\]\[row\] the numbers of a factor of `tensor`.
fn factor(block: &Block, tensor: usize, factor: usize, resolution: [u32; 3]) -> impl Iterator<Item = f32> + '_ {
    let (rank, rows) = (block.rank as usize, block.form.factors(resolution)[factor].clone());
    let values = &block.values[tensor * block.tensor_len(resolution)..];
    (0..rank).flat_map(move |c| rows.clone().map(move |row| values[row * rank + c]))
}

/// The configuration, which [`super::Config`] reads, with the settings that the program needs to load the checkpoint.
fn config(scene: &Scene, half_edges: &[Vec3], step_scale: usize, step_ratio: f64) -> String {
    fn list<T: ToString>(values: impl IntoIterator<Item = T>) -> String {
        format!("[{}]", values.into_iter().map(|value| value.to_string()).collect::<Vec<_>>().join(", "))
    }
    let scales = &scene.scales;
    let is_vm = scales[0].factors.kind() == FactorKind::Vm;
    let rank = |blocks: fn(&Scale) -> &[Block]| {
        list(scales.iter().map(move |scale| blocks(scale).iter().map(|block| block.rank).sum::<u32>()))
    };
    let dims = list(scales.iter().flat_map(|scale| scale.cloud.resolution));
    let flag = |is_set: bool| u8::from(is_set).to_string();
    let (rules, decoder) = (&scene.rules, &scene.decoder);
    let mut settings = vec![
        ("model_name", if is_vm { "Strivec_DBase" } else { "StrivecCP_hier" }.into()),
        ("local_range", list(half_edges.iter().flat_map(|edge| edge.to_array()))),
        ("local_dims_init", dims.clone()),
        ("local_dims_final", dims),
        ("unit_lvl", step_scale.to_string()),
        ("step_ratio", step_ratio.to_string()),
        ("max_tensoRF", list(scales.iter().map(|scale| scale.top_k))),
        ("filterall", flag(rules.coverage == Coverage::All)),
        ("radiance_add", "1".into()),
        ("den_lvl_norm", flag(rules.density_reduction == Reduction::Mean)),
        ("rad_lvl_norm", flag(rules.appearance_reduction == Reduction::Mean)),
        ("n_lamb_sigma", rank(density)),
        ("n_lamb_sh", rank(appearance)),
        ("data_dim_color", list(vec![scene.features(); scales.len()])),
        ("shadingMode", shading_mode(scene).into()),
        ("fea2denseAct", "softplus".into()),
        ("view_pe", decoder.direction_frequencies.to_string()),
        ("fea_pe", decoder.feature_frequencies.to_string()),
        ("featureC", decoder.layers[0].outputs.to_string()),
        ("ray_type", "2".into()),
    ];
    if is_vm {
        settings.extend([("vm_agg_mode", "1".into()), ("vm_sep_mat", "2".into())]);
    }
    settings.into_iter().fold(String::new(), |mut text, (name, value)| {
        let _ = writeln!(text, "{name} = {value}");
        text
    })
}

/// The side file of a `Strivec_DBase`.
fn meta(scene: &Scene, half_edges: &[Vec3], centers: impl Fn(&Scale) -> Vec<Vec3>) -> Result<Vec<u8>, Error> {
    let numbers = |points: &[Vec3]| points.iter().flat_map(|point| point.to_array()).collect::<Vec<f32>>();
    let of_scales = |array: &dyn Fn(usize, &Scale) -> Value<'static>| {
        Value::List(scene.scales.iter().enumerate().map(|(l, scale)| array(l, scale)).collect())
    };
    let mut root: Vec<_> = alpha_mask(scene)
        .into_iter()
        .map(|(key, value)| (key, if let Value::Tensor(tensor) = value { Value::Array(tensor) } else { value }))
        .collect();
    root.extend([
        ("geo_xyz", of_scales(&|_, scale| Value::array([scale.cloud.len(), 3], numbers(&centers(scale))))),
        ("local_range", of_scales(&|l, _| Value::array([3], half_edges[l].to_array().to_vec()))),
        ("local_dims", of_scales(&|_, scale| Value::array([3], scale.cloud.resolution.map(i64::from).to_vec()))),
    ]);
    let root = Value::Dict(root.into_iter().map(|(key, value)| (key.into(), value)).collect());
    let mut bytes = Vec::new();
    write_pickle(&mut bytes, &root)?;
    Ok(bytes)
}

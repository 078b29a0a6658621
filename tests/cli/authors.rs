//! Checkpoints of the Strivec authors' layouts: the field and the pictures that their arrays give, computed here from the arrays
//! alone, are those of the imported scene, and planted differences show.

use crate::command::{code, run, strivec, text};
use crate::scenes;

use std::collections::HashMap;
use std::io::Cursor;

use glam::DVec3;
use strivec_checkpoints::authors::{AuthorsFiles, Config, Model, Places, authors_files, model, read};
use strivec_checkpoints::{Numbers, SceneOptions, Value, write_checkpoint, write_pickle};
use strivec_export::write_factors;
use strivec_field::render::ReferenceRenderer;
use strivec_format::container::{EncodeOptions, encode};
use strivec_format::geometry::{Aabb, Ray, Similarity};
use strivec_format::model::{
    Aggregation, Coverage, Decoder, DecoderMode, FactorKind, Form, Reduction, ReferenceField, Scene, UpAxis,
};
use strivec_format::random::Random;
use strivec_import::npy::Header;
use strivec_import::{Fault, Input};

/// The largest difference of a feature, relative to the mean of all.
const LARGEST: f64 = 1e-9;
const POINTS: u64 = 4000;

fn options() -> SceneOptions {
    SceneOptions { background: [1.0; 3], up: UpAxis::Z, dataset: "made".into() }
}

/// A made checkpoint and what is beside it.
struct Made {
    root: Value<'static>,
    config: String,
    places: Places,
}

/// What a made checkpoint is like.
#[derive(Clone, Copy, Debug)]
struct Kind {
    is_vm: bool,
    /// `vm_sep_mat`: a matrix for all, for each axis, or for each tensor.
    sharing: usize,
    /// `vm_agg_mode` 1.
    sums_axes: bool,
    adds_features: bool,
    means: bool,
}

const CP: Kind = Kind { is_vm: false, sharing: 0, sums_axes: false, adds_features: true, means: false };

/// Every class and way to share matrices.
const KINDS: [Kind; 6] = [
    CP,
    Kind { adds_features: false, ..CP },
    Kind { means: true, ..CP },
    Kind { is_vm: true, sharing: 0, sums_axes: true, ..CP },
    Kind { is_vm: true, sharing: 1, sums_axes: false, means: true, ..CP },
    Kind { is_vm: true, sharing: 2, sums_axes: true, ..CP },
];

const HALF_EDGES: [[f32; 3]; 2] = [[0.6, 0.7, 0.65], [0.3, 0.35, 0.4]];
const TENSORS: [usize; 2] = [7, 29];
const RANKS: [[usize; 2]; 2] = [[4, 5], [3, 6]];

/// A checkpoint of `kind` with random numbers, in the layout that the program writes.
fn made(kind: Kind) -> Made {
    let random = Random::new(11, "authors");
    let mut counter = 0;
    let mut numbers = |count: usize, size: f32| -> Vec<f32> {
        let range = counter..counter + count as u64;
        counter = range.end;
        range.map(|n| (2.0 * random.uniform(n) as f32 - 1.0) * size).collect()
    };
    let dims = |l: usize| if kind.is_vm { [[6; 3], [4; 3]][l] } else { [[6, 5, 7], [4, 3, 5]][l] };
    let mut state: Vec<(String, Value<'static>)> = Vec::new();
    for (part, which) in [("density", 0), ("app", 1)] {
        for l in 0..2 {
            for axis in 0..3 {
                let shape = [TENSORS[l], RANKS[l][which], dims(l)[axis] + 1];
                let name = format!("{part}_line.{}", 3 * l + axis);
                state.push((name, Value::tensor(shape, numbers(shape.iter().product(), 1.5))));
            }
        }
        for l in (0..2).filter(|_| kind.is_vm) {
            let shape = [[1, 3, TENSORS[l]][kind.sharing], RANKS[l][which], dims(l)[0] + 1, dims(l)[1] + 1];
            state.push((format!("{part}_plane.{l}"), Value::tensor(shape, numbers(shape.iter().product(), 1.5))));
        }
    }
    let features = if kind.adds_features { [3, 3] } else { [3, 2] };
    for l in 0..2 {
        let columns = RANKS[l][1] * if kind.is_vm && !kind.sums_axes { 3 } else { 1 };
        let shape = [features[l], columns];
        state.push((format!("basis_mat.{l}.weight"), Value::tensor(shape, numbers(shape.iter().product(), 1.0))));
    }
    let all = if kind.adds_features { 3 } else { 5 };
    let widths = [(all + 3) * 3, 8, 8, 3];
    for (n, pair) in widths.windows(2).enumerate() {
        let name = |part| format!("renderModule.mlp.{}.{part}", 2 * n);
        state.push((name("weight"), Value::tensor([pair[1], pair[0]], numbers(pair[0] * pair[1], 0.5))));
        state.push((name("bias"), Value::tensor([pair[1]], numbers(pair[1], 0.5))));
    }
    let list = |values: &[i64]| Value::List(values.iter().map(|&v| Value::Int(v)).collect());
    let kwargs = vec![
        ("aabb".into(), Value::tensor([2, 3], vec![-1.0_f32, -0.9, -1.1, 1.0, 0.95, 1.05])),
        ("gridSize".into(), list(&[20, 20, 20])),
        ("density_shift".into(), Value::Float(-1.0)),
        ("distance_scale".into(), Value::Float(4.0)),
        ("rayMarch_weight_thres".into(), Value::Float(1e-4)),
        ("fea2denseAct".into(), Value::text("softplus")),
        ("near_far".into(), Value::List(vec![Value::Float(0.5), Value::Float(6.0)])),
        ("step_ratio".into(), Value::Float(0.5)),
        ("shadingMode".into(), Value::text("MLP_Fea")),
        ("view_pe".into(), Value::Int(1)),
        ("fea_pe".into(), Value::Int(1)),
    ];
    // Vertices z, y, x: all but a corner.
    let vertices = [5, 6, 7];
    let bits: Vec<bool> = (0..210).map(|n| n / 42 + n % 42 / 7 + n % 7 > 4).collect();
    let packed: Vec<u8> =
        bits.chunks(8).map(|c| c.iter().enumerate().fold(0, |all, (n, &bit)| all | u8::from(bit) << (7 - n))).collect();
    let shape = Value::Tuple([1, 1, vertices[0], vertices[1], vertices[2]].map(Value::Int).to_vec());
    let root = Value::Dict(vec![
        ("kwargs".into(), Value::Dict(kwargs)),
        ("state_dict".into(), Value::OrderedDict(state.into_iter().map(|(key, value)| (key.into(), value)).collect())),
        ("alphaMask.shape".into(), shape),
        ("alphaMask.mask".into(), Value::array([packed.len()], packed)),
        ("alphaMask.aabb".into(), Value::tensor([2, 3], vec![-1.0_f32, -1.0, -1.1, 1.0, 1.0, 1.1])),
    ]);
    let flag = u8::from;
    let config = format!(
        "local_range = [0.6, 0.7, 0.65, 0.3, 0.35, 0.4]\nmax_tensoRF = [3, 4]\nunit_lvl = 1 # the finer one\nfilterall = 1\n\
        radiance_add = {}\nden_lvl_norm = {}\nrad_lvl_norm = {}\nvm_sep_mat = {}\n",
        flag(kind.adds_features),
        flag(kind.means),
        flag(kind.means && kind.adds_features),
        kind.sharing
    );
    let mut centers = |l: usize| -> Vec<DVec3> {
        let numbers = numbers(3 * TENSORS[l], 0.7);
        numbers.chunks_exact(3).map(|c| DVec3::new(c[0].into(), c[1].into(), c[2].into())).collect()
    };
    let centers = vec![centers(0), centers(1)];
    let places = if kind.is_vm {
        let of_numbers = |numbers: Vec<f32>| Value::array([numbers.len() / 3, 3], numbers);
        let flat = |points: &Vec<DVec3>| points.iter().flat_map(|p| p.as_vec3().to_array()).collect();
        let meta = Value::Dict(vec![
            ("geo_xyz".into(), Value::List(centers.iter().map(flat).map(of_numbers).collect())),
            ("local_range".into(), Value::List(HALF_EDGES.map(|edge| Value::array([3], edge.to_vec())).to_vec())),
        ]);
        let mut bytes = Vec::new();
        write_pickle(&mut bytes, &meta).unwrap();
        Places::from_meta(&mut Input::from_bytes(&bytes)).unwrap()
    } else {
        Places::Points(centers)
    };
    Made { root, config, places }
}

fn bytes_of(root: &Value<'_>) -> Vec<u8> {
    write_checkpoint(Cursor::new(Vec::new()), root).unwrap().into_inner()
}

fn config_of(text: &str) -> Config {
    Config::read(&mut Input::from_bytes(text.as_bytes())).unwrap()
}

fn imported(made: &Made) -> Result<Scene, Fault> {
    read(&mut Input::from_bytes(&bytes_of(&made.root)), &config_of(&made.config), &made.places, &options())
}

/// The value at `path` of nested dictionaries.
fn entry<'v>(root: &'v Value<'static>, path: &[&str]) -> &'v Value<'static> {
    path.iter().fold(root, |value, &name| match value {
        Value::Dict(pairs) | Value::OrderedDict(pairs) => &pairs.iter().find(|(key, _)| key == name).expect(name).1,
        _ => panic!("{name} is in no dictionary"),
    })
}

fn entry_mut<'v>(root: &'v mut Value<'static>, path: &[&str]) -> &'v mut Value<'static> {
    path.iter().fold(root, |value, &name| match value {
        Value::Dict(pairs) | Value::OrderedDict(pairs) => {
            &mut pairs.iter_mut().find(|(key, _)| key == name).expect(name).1
        }
        _ => panic!("{name} is in no dictionary"),
    })
}

fn float(root: &Value<'static>, name: &str) -> f64 {
    match entry(root, &["kwargs", name]) {
        Value::Float(value) => *value,
        Value::Int(value) => *value as f64,
        other => panic!("{name}: {other:?}"),
    }
}

/// The program's field, from the arrays of a checkpoint: in 64 bits, and with neighbors chosen for each sample.
struct Program {
    arrays: HashMap<String, (Vec<usize>, Vec<f64>)>,
    scales: Vec<(Vec<DVec3>, DVec3)>,
    config: Config,
    sums_axes: bool,
    root: Value<'static>,
}

/// A tensor's weight, its number and the offset from its center.
type Near = (f64, usize, DVec3);

impl Program {
    fn new(made: &Made, sums_axes: bool) -> Self {
        let config = config_of(&made.config);
        let scales = match &made.places {
            Places::Boxes(boxes) => boxes.clone(),
            Places::Points(points) => points.iter().cloned().zip(config.half_edges.clone()).collect(),
        };
        let Value::OrderedDict(state) = entry(&made.root, &["state_dict"]) else { panic!("no parameters") };
        let array = |value: &Value<'static>| match value {
            Value::Tensor(tensor) => match &tensor.numbers {
                Numbers::F32(numbers) => (tensor.shape.clone(), numbers.iter().map(|&n| n.into()).collect()),
                other => panic!("{other:?}"),
            },
            other => panic!("{other:?}"),
        };
        let arrays = state.iter().map(|(name, value)| (name.to_string(), array(value))).collect();
        Self { arrays, scales, config, sums_axes, root: made.root.clone() }
    }

    /// The nearest tensors of a scale whose boxes hold `point`.
    fn near(&self, scale: usize, point: DVec3) -> Vec<Near> {
        let (centers, half_edge) = &self.scales[scale];
        let offsets = centers.iter().enumerate().map(|(n, &center)| (n, point - center));
        let mut near: Vec<Near> = offsets
            .filter(|(_, offset)| offset.abs().cmple(*half_edge).all())
            .map(|(n, offset)| (1.0 / (offset.length() + 1e-6), n, offset))
            .collect();
        near.sort_by(|a, b| b.0.total_cmp(&a.0));
        near.truncate(self.config.top_k[scale] as usize);
        let sum: f64 = near.iter().map(|n| n.0).sum();
        near.into_iter().map(|(weight, n, offset)| (weight / sum.max(1.0), n, offset)).collect()
    }

    /// The tensors of a scale that the program itself chooses: those nearest to the middle of the cell of `point`, of a grid with cells of
    /// this `unit`, of all whose boxes meet the cell.
    fn near_to_cell(&self, scale: usize, point: DVec3, unit: DVec3) -> Vec<usize> {
        let (centers, half_edge) = &self.scales[scale];
        let middle = ((point / unit).floor() + 0.5) * unit;
        let meets = |center: DVec3| (center - middle).abs().cmplt(*half_edge + 0.5 * unit).all();
        let mut near: Vec<usize> = (0..centers.len()).filter(|&n| meets(centers[n])).collect();
        near.sort_by(|&a, &b| centers[a].distance(middle).total_cmp(&centers[b].distance(middle)));
        near.truncate(self.config.top_k[scale] as usize);
        near.sort_unstable();
        near
    }

    /// The lower vertex and the fraction along an axis of `vertices`.
    fn at(&self, scale: usize, axis: usize, vertices: usize, offset: DVec3) -> (usize, f64) {
        let half = self.scales[scale].1[axis];
        let at = (offset[axis] + half) / (2.0 * half / (vertices - 1) as f64);
        let lower = (at.max(0.0) as usize).min(vertices - 2);
        (lower, at - lower as f64)
    }

    /// The components of a tensor, as the columns of `basis_mat` take them.
    fn components(&self, part: &str, scale: usize, tensor: usize, offset: DVec3) -> Vec<f64> {
        let line = |axis: usize| -> Vec<f64> {
            let (shape, values) = &self.arrays[&format!("{part}_line.{}", 3 * scale + axis)];
            let (lower, fraction) = self.at(scale, axis, shape[2], offset);
            let number = |c: usize, v: usize| values[(tensor * shape[1] + c) * shape[2] + v];
            (0..shape[1]).map(|c| (1.0 - fraction) * number(c, lower) + fraction * number(c, lower + 1)).collect()
        };
        let lines = [line(0), line(1), line(2)];
        let Some((shape, values)) = self.arrays.get(&format!("{part}_plane.{scale}")) else {
            return (0..lines[0].len()).map(|c| lines[0][c] * lines[1][c] * lines[2][c]).collect();
        };
        let products = |axis: usize| -> Vec<f64> {
            let [a, b] = [[1, 2], [0, 2], [0, 1]][axis];
            let plane = [0, axis, tensor][self.config.matrix_sharing as usize];
            let ((i, u), (j, v)) = (self.at(scale, a, shape[2], offset), self.at(scale, b, shape[3], offset));
            let number = |c: usize, i: usize, j: usize| values[((plane * shape[1] + c) * shape[2] + i) * shape[3] + j];
            let mixed = |c: usize| {
                (1.0 - u) * ((1.0 - v) * number(c, i, j) + v * number(c, i, j + 1))
                    + u * ((1.0 - v) * number(c, i + 1, j) + v * number(c, i + 1, j + 1))
            };
            (0..shape[1]).map(|c| mixed(c) * lines[axis][c]).collect()
        };
        let products = [products(0), products(1), products(2)];
        if self.sums_axes {
            return (0..shape[1]).map(|c| products.iter().map(|product| product[c]).sum()).collect();
        }
        products.concat()
    }

    /// The components of density or appearance of a scale, weighted; and whether a tensor is near.
    fn weighted(&self, part: &str, scale: usize, point: DVec3) -> Option<Vec<f64>> {
        let near = self.near(scale, point);
        let of = |&(weight, n, offset): &Near| -> Vec<f64> {
            self.components(part, scale, n, offset).into_iter().map(|value| weight * value).collect()
        };
        let sum = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(b).map(|(a, b)| a + b).collect();
        near.iter().map(of).reduce(sum)
    }

    /// The density feature and the appearance features at `point`, if all scales cover it.
    fn features(&self, point: DVec3) -> Option<(f64, Vec<f64>)> {
        let (mut density, mut appearance) = (0.0, Vec::new());
        for scale in 0..self.scales.len() {
            density += self.weighted("density", scale, point)?.iter().sum::<f64>();
            let components = self.weighted("app", scale, point)?;
            let (shape, weights) = &self.arrays[&format!("basis_mat.{scale}.weight")];
            let rows = weights.chunks_exact(shape[1]);
            let features: Vec<f64> = rows.map(|row| row.iter().zip(&components).map(|(w, c)| w * c).sum()).collect();
            if self.config.adds_features && scale > 0 {
                appearance.iter_mut().zip(features).for_each(|(all, feature): (&mut f64, _)| *all += feature);
            } else {
                appearance.extend(features);
            }
        }
        let count = self.scales.len() as f64;
        let divided = |reduction| if reduction == Reduction::Mean { count } else { 1.0 };
        appearance.iter_mut().for_each(|f| *f /= divided(self.config.appearance_reduction));
        Some((density / divided(self.config.density_reduction), appearance))
    }

    /// The alpha mask, interpolated between vertices \[z\]\[y\]\[x\], is positive.
    fn is_masked_in(&self, point: DVec3) -> bool {
        let (Value::Array(mask), Value::Tensor(corners), Value::Tuple(shape)) = (
            entry(&self.root, &["alphaMask.mask"]),
            entry(&self.root, &["alphaMask.aabb"]),
            entry(&self.root, &["alphaMask.shape"]),
        ) else {
            panic!("no mask")
        };
        let (Numbers::U8(bytes), Numbers::F32(corners)) = (&mask.numbers, &corners.numbers) else { panic!("types") };
        let length = |axis: usize| if let Value::Int(n) = shape[4 - axis] { n as usize } else { panic!("a length") };
        let mut sum = 0.0;
        for corner in 0..8 {
            let (mut weight, mut at) = (1.0, [0; 3]);
            for axis in 0..3 {
                let [min, max] = [corners[axis], corners[3 + axis]].map(f64::from);
                let position = (point[axis] - min) / (max - min) * (length(axis) - 1) as f64;
                let lower = position.floor();
                let upper = corner >> axis & 1 == 1;
                weight *= if upper { position - lower } else { 1.0 - (position - lower) };
                let index = lower as i64 + i64::from(upper);
                if index < 0 || index >= length(axis) as i64 {
                    weight = 0.0;
                }
                at[axis] = index.max(0) as usize;
            }
            let bit = (at[2] * length(1) + at[1]) * length(0) + at[0];
            if weight > 0.0 && bytes[bit / 8] >> (7 - bit % 8) & 1 == 1 {
                sum += weight;
            }
        }
        sum > 0.0
    }

    /// The color of the network at a sample.
    fn color(&self, features: &[f64], direction: DVec3) -> [f64; 3] {
        let direction = direction.to_array();
        let encoded = |values: &[f64], frequencies: u32| -> Vec<f64> {
            let angles = || values.iter().flat_map(move |v| (0..frequencies).map(move |f| v * 2.0_f64.powi(f as i32)));
            angles().map(f64::sin).chain(angles().map(f64::cos)).collect()
        };
        let frequencies = ["fea_pe", "view_pe"].map(|name| float(&self.root, name) as u32);
        let mut values =
            [features, &direction, &encoded(features, frequencies[0]), &encoded(&direction, frequencies[1])].concat();
        for layer in [0, 2, 4] {
            let (shape, weights) = &self.arrays[&format!("renderModule.mlp.{layer}.weight")];
            let bias = &self.arrays[&format!("renderModule.mlp.{layer}.bias")].1;
            let rows = weights.chunks_exact(shape[1]).zip(bias);
            let outputs = rows.map(|(row, bias)| bias + row.iter().zip(&values).map(|(w, v)| w * v).sum::<f64>());
            values = outputs.map(|v| if layer < 4 { v.max(0.0) } else { 1.0 / (1.0 + (-v).exp()) }).collect();
        }
        [values[0], values[1], values[2]]
    }

    /// The color of a ray on white.
    fn trace(&self, ray: &Ray) -> [f64; 3] {
        let (Value::Tensor(corners), Value::List(near_far)) =
            (entry(&self.root, &["kwargs", "aabb"]), entry(&self.root, &["kwargs", "near_far"]))
        else {
            panic!("no box")
        };
        let Numbers::F32(corners) = &corners.numbers else { panic!("types") };
        let [near, far] = [0, 1].map(|n| if let Value::Float(t) = near_far[n] { t } else { panic!("a distance") });
        let (mut start, mut end) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let [a, b] = [0, 3].map(|c| (f64::from(corners[c + axis]) - ray.origin[axis]) / ray.direction[axis]);
            (start, end) = (start.max(a.min(b)), end.min(a.max(b)));
        }
        let (start, end) = (start.clamp(near, far), end.clamp(near, far));
        let half = self.scales[self.config.step_scale].1;
        let vertices = |axis| self.arrays[&format!("density_line.{}", 3 * self.config.step_scale + axis)].0[2];
        let cell = (0..3).map(|axis| 2.0 * half[axis] / (vertices(axis) - 1) as f64).sum::<f64>() / 3.0;
        let step = cell * float(&self.root, "step_ratio");
        let (mut transmittance, mut color) = (1.0, [0.0; 3]);
        for n in 0..((end - start) / step).ceil() as usize {
            let point = ray.origin + (start + n as f64 * step) * ray.direction;
            let Some((density, features)) = self.features(point).filter(|_| self.is_masked_in(point)) else { continue };
            let sigma = (density + float(&self.root, "density_shift")).exp().ln_1p();
            let alpha = 1.0 - (-sigma * step * float(&self.root, "distance_scale")).exp();
            let weight = transmittance * alpha;
            if weight > float(&self.root, "rayMarch_weight_thres") {
                let shaded = self.color(&features, ray.direction);
                (0..3).for_each(|c| color[c] += weight * shaded[c]);
            }
            transmittance *= 1.0 - alpha;
            if transmittance < 1e-3 {
                break;
            }
        }
        color.map(|c| c + transmittance)
    }
}

/// The largest differences of density features and of appearance features between `program` and the field of `scene`, at the points
/// that both cover, relative to their means; and the number of these points. Points near a decision of the scene are left out.
fn differences(program: &Program, scene: &Scene) -> ([f64; 2], usize) {
    let field = ReferenceField::new(scene);
    let map = scene.frame.model_from_dataset;
    let random = Random::new(12, "points");
    let (mut largest, mut means, mut count) = ([0.0_f64; 2], [0.0; 2], 0);
    for n in 0..POINTS {
        let share = DVec3::from_array([0, 1, 2].map(|axis| random.uniform(3 * n + axis)));
        let point = scene.bounds.min + share * scene.bounds.size();
        let located = field.locate(point);
        let near = map.inverse().point(point);
        let (true, true, Some((density, features))) = (located.covered, located.margin > 1e-5, program.features(near))
        else {
            continue;
        };
        let found = (field.density_feature(&located).feature, field.appearance_features(&located));
        assert_eq!(found.1.len(), features.len(), "features");
        largest[0] = largest[0].max((found.0 - density).abs());
        means[0] += density.abs();
        for (found, feature) in found.1.iter().zip(&features) {
            largest[1] = largest[1].max((found - feature).abs());
            means[1] += feature.abs() / features.len() as f64;
        }
        count += 1;
    }
    ([0, 1].map(|which| largest[which] * count as f64 / means[which]), count)
}

#[test]
fn the_imported_field_is_that_of_the_checkpoints_arrays() {
    for kind in KINDS {
        let made = made(kind);
        let scene = imported(&made).unwrap();
        let (found, count) = differences(&Program::new(&made, kind.sums_axes), &scene);
        println!("{kind:?}: {found:?} at {count} points");
        assert!(count > 300 && found.iter().all(|&d| d < LARGEST), "{kind:?}: {found:?} at {count} points");
        assert_eq!(scene.scales[0].factors.kind(), if kind.is_vm { FactorKind::Vm } else { FactorKind::Cp });
        let expected = if kind.is_vm { Model::Vm } else { Model::Cp };
        assert_eq!(model(&mut Input::from_bytes(&bytes_of(&made.root))).unwrap(), Some(expected));
    }
}

#[test]
fn neighbors_are_the_programs_but_for_the_cells_that_it_chooses_them_for() {
    let made = made(CP);
    let scene = imported(&made).unwrap();
    let program = Program::new(&made, false);
    let random = Random::new(14, "neighbors");
    let unit = scene.scales[program.config.step_scale].cloud.cell_size();
    let share_of_others = |unit: DVec3| {
        let (mut others, mut all) = (0, 0);
        for n in 0..POINTS {
            let point = DVec3::from_array([0, 1, 2].map(|axis| 2.0 * random.uniform(3 * n + axis) - 1.0));
            for scale in 0..program.scales.len() {
                let mut near: Vec<usize> = program.near(scale, point).into_iter().map(|n| n.1).collect();
                near.sort_unstable();
                others += u32::from(near != program.near_to_cell(scale, point, unit));
                all += 1;
            }
        }
        f64::from(others) / f64::from(all)
    };
    // The smaller the cells, the fewer points have other neighbors.
    let shares = [1.0, 0.1, 0.01].map(|part| share_of_others(part * unit));
    println!("points with other neighbors: {shares:?}");
    assert!(shares[0] > 0.1 && shares[1] < 0.3 * shares[0] && shares[2] < 0.02, "{shares:?}");
}

/// Exchanges two parameters.
fn exchange(root: &mut Value<'static>, a: &str, b: &str) {
    let first = entry(root, &["state_dict", a]).clone();
    let second = std::mem::replace(entry_mut(root, &["state_dict", b]), first);
    *entry_mut(root, &["state_dict", a]) = second;
}

/// Changes the numbers of a parameter, given its shape.
fn change(root: &mut Value<'static>, name: &str, change: impl Fn(&[usize], &mut Vec<f32>)) {
    let Value::Tensor(tensor) = entry_mut(root, &["state_dict", name]) else { panic!("{name} is no tensor") };
    let Numbers::F32(numbers) = &mut tensor.numbers else { panic!("{name} has other numbers") };
    change(&tensor.shape, numbers.to_mut());
}

#[test]
fn planted_differences_of_the_field_show() {
    let swap_columns = |shape: &[usize], numbers: &mut Vec<f32>| {
        numbers.chunks_exact_mut(shape[1]).for_each(|row| row.swap(0, 1));
    };
    let swap_tensors = |shape: &[usize], numbers: &mut Vec<f32>| {
        let len = numbers.len() / shape[0];
        (0..len).for_each(|n| numbers.swap(n, len + n));
    };
    let transpose = |shape: &[usize], numbers: &mut Vec<f32>| {
        let n = shape[2];
        for matrix in numbers.chunks_exact_mut(n * n) {
            (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).for_each(|(i, j)| matrix.swap(i * n + j, j * n + i));
        }
    };
    // The difference shows in density, in appearance, or in both.
    type Plant<'p> = (&'p str, usize, [bool; 2], &'p dyn Fn(&mut Made));
    let plants: [Plant<'_>; 6] = [
        ("permuted axes", 3, [true, false], &|made| exchange(&mut made.root, "density_line.0", "density_line.1")),
        ("swapped columns", 0, [false, true], &|made| change(&mut made.root, "basis_mat.1.weight", swap_columns)),
        ("swapped columns of axes", 4, [false, true], &|made| {
            change(&mut made.root, "basis_mat.0.weight", swap_columns);
        }),
        ("swapped tensors", 0, [true, false], &|made| change(&mut made.root, "density_line.4", swap_tensors)),
        ("transposed matrices", 5, [false, true], &|made| change(&mut made.root, "app_plane.1", transpose)),
        ("swapped centers", 0, [true, true], &|made| {
            let Places::Points(points) = &mut made.places else { panic!("no points") };
            points[0].swap(0, 1);
        }),
    ];
    for (name, kind, expected, plant) in plants {
        let mut planted = made(KINDS[kind]);
        let scene = imported(&planted).unwrap();
        plant(&mut planted);
        let (found, _) = differences(&Program::new(&planted, KINDS[kind].sums_axes), &scene);
        println!("{name}: {found:?}");
        assert_eq!(found.map(|d| d > 1e-3), expected, "{name}: {found:?}");
    }
}

/// Rays through a scene around the origin.
fn rays() -> Vec<Ray> {
    let random = Random::new(13, "rays");
    let point = |n: u64, size: f64| DVec3::from_array([0, 1, 2].map(|axis| size * (random.uniform(n + axis) - 0.5)));
    (0..60)
        .map(|n| (6 * n, 3.0 * point(6 * n, 1.0).normalize()))
        .map(|(n, origin)| Ray { origin, direction: (point(n + 3, 0.8) - origin).normalize() })
        .collect()
}

/// The largest difference of a color on clear rays, and their number.
fn color_difference(program: &Program, scene: &Scene) -> (f64, usize) {
    let renderer = ReferenceRenderer::new(scene);
    let (mut largest, mut clear) = (0.0_f64, 0);
    for ray in rays() {
        let trace = renderer.trace_one(&ray);
        if trace.margin > 1e-8 && trace.opacity > 0.0 {
            let expected = program.trace(&ray);
            (0..3).for_each(|c| largest = largest.max((trace.color[c] - expected[c]).abs()));
            clear += 1;
        }
    }
    (largest, clear)
}

#[test]
fn pictures_are_those_of_the_programs_march_and_planted_differences_show() {
    for kind in [KINDS[1], KINDS[2], KINDS[5]] {
        let mut made = made(kind);
        let scene = imported(&made).unwrap();
        let (found, clear) = color_difference(&Program::new(&made, kind.sums_axes), &scene);
        println!("{kind:?}: {found} on {clear} rays");
        assert!(clear > 30 && found < 1e-9, "{kind:?}: {found} on {clear} rays");
        for (name, value) in [("density_shift", -1.001), ("distance_scale", 4.004), ("step_ratio", 0.5005)] {
            let before = std::mem::replace(entry_mut(&mut made.root, &["kwargs", name]), Value::Float(value));
            let (found, _) = color_difference(&Program::new(&made, kind.sums_axes), &scene);
            assert!(found > 1e-6, "{name} of {kind:?}: {found}");
            *entry_mut(&mut made.root, &["kwargs", name]) = before;
        }
        // Some rays pass the corner that the mask leaves out.
        let mut planted = scene.clone();
        planted.occupancy = None;
        let (found, _) = color_difference(&Program::new(&made, kind.sums_axes), &planted);
        assert!(found > 1e-6, "mask of {kind:?}: {found}");
    }
}

/// The files beside an exported checkpoint, as an import takes them.
fn beside(files: &AuthorsFiles) -> Made {
    let of = |end: &str| files.beside.iter().find(|(name, _)| name == end).map(|(_, bytes)| bytes.as_slice());
    let config = String::from_utf8(of(".txt").expect("a configuration").to_vec()).unwrap();
    let numbers = |line: &str| line.split(';').map(|n| n.parse().unwrap()).collect::<Vec<f64>>();
    let points = |bytes: &[u8]| -> Vec<DVec3> {
        std::str::from_utf8(bytes).unwrap().lines().map(|line| DVec3::from_slice(&numbers(line))).collect()
    };
    let rounded = |points: Vec<DVec3>| points.into_iter().map(|p| p.as_vec3().as_dvec3()).collect();
    let places = match of("_meta.pkl") {
        Some(meta) => Places::from_meta(&mut Input::from_bytes(meta)).unwrap(),
        None => {
            let files = (0..).map_while(|l| of(&format!("_centers_{l}.txt")));
            Places::Points(files.map(points).map(rounded).collect())
        }
    };
    Made { root: files.checkpoint.clone(), config, places }
}

#[test]
fn an_imported_scene_is_exported_and_imported_without_a_difference() {
    for kind in KINDS {
        let scene = imported(&made(kind)).unwrap();
        let files = authors_files(&scene).unwrap();
        let again = imported(&beside(&files)).unwrap();
        assert_eq!(again, scene, "{kind:?}");
        let encoded = |scene: &Scene| encode(scene, &EncodeOptions::lossless(scene)).unwrap();
        assert!(encoded(&again) == encoded(&scene), "{kind:?}");
        let files_again = authors_files(&again).unwrap();
        assert!(bytes_of(&files_again.checkpoint) == bytes_of(&files.checkpoint), "{kind:?}");
        assert_eq!(files_again.beside, files.beside, "{kind:?}");
    }
}

/// A trained kind of scene in units and a place of its own, with tensors below 1 in the dataset's units.
fn native(kinds: &[FactorKind], coverage: Coverage) -> Scene {
    let mut config = scenes::with_kinds(scenes::config(), kinds);
    config.model.coverage = coverage;
    config.model.aggregation = Aggregation::Normalized;
    for scale in &mut config.scales {
        let cells = scale.resolutions[0][0];
        scale.resolutions = vec![[cells; 3]];
    }
    let mut scene = scenes::scene(&config);
    let map = Similarity { scale: 1.5, translation: DVec3::new(0.3, -0.2, 0.1), ..Similarity::IDENTITY };
    scene.frame.model_from_dataset = map;
    let widths = [16, 16, 3];
    let mut inputs = scene.decoder.input_len(scene.features());
    scene.decoder = Decoder { mode: DecoderMode::PerSample, layers: Vec::new(), ..scene.decoder };
    for outputs in widths {
        let (weights, bias) = (vec![0.1; (inputs * outputs) as usize], vec![0.2; outputs as usize]);
        scene.decoder.layers.push(strivec_format::model::Linear { inputs, outputs, weights, bias });
        inputs = outputs;
    }
    scene.check().unwrap();
    scene
}

#[test]
fn exported_clouds_give_the_field_of_the_scene() {
    for kinds in [[FactorKind::Cp; 3], [FactorKind::Vm; 3]] {
        let scene = native(&kinds, Coverage::All);
        let files = beside(&authors_files(&scene).unwrap());
        let (found, count) = differences(&Program::new(&files, true), &scene);
        println!("{kinds:?}: {found:?} at {count} points");
        // Centers have 32 bits, and the program's weights another length.
        assert!(count > 200 && found.iter().all(|&d| d < 1e-3), "{kinds:?}: {found:?} at {count} points");
        let mut planted = scene.clone();
        planted.scales[0].appearance_matrix.weights.iter_mut().for_each(|w| *w *= 1.1);
        let (found, _) = differences(&Program::new(&files, true), &planted);
        assert!(found[1] > 1e-2, "a planted difference goes unnoticed: {found:?}");
        let again = imported(&files).unwrap();
        assert_eq!(authors_files(&again).unwrap().beside.len(), authors_files(&scene).unwrap().beside.len());
    }
}

#[test]
fn scenes_that_the_program_cannot_express_are_refused() {
    let refused = |change: &dyn Fn(&mut Scene)| {
        let mut scene = native(&[FactorKind::Cp; 3], Coverage::Any);
        change(&mut scene);
        authors_files(&scene).unwrap_err().to_string()
    };
    let many = refused(&|scene| scene.scales[1].top_k = 9);
    assert!(many.contains("at most 8 neighbors, found 9"), "{many}");
    let large = refused(&|scene| scene.scales[0].cloud.half_edge = DVec3::splat(2.0));
    assert!(large.contains("half diagonal is below 1 in the dataset's units"), "{large}");
    let mode = refused(&|scene| scene.decoder.mode = DecoderMode::PerRay);
    assert!(mode.contains("a decoder per sample, found per-ray"), "{mode}");
    let mixed = authors_files(&native(&[FactorKind::Cp, FactorKind::Vm, FactorKind::Vm], Coverage::All)).unwrap_err();
    assert!(mixed.to_string().contains("factors of one kind"), "{mixed}");
}

#[test]
fn centers_are_derived_from_the_priors_points() {
    // Three voxels along x and two along y: an odd number has a voxel in the middle, an even one a face.
    let points = [[0.0, 0.0, 0.0], [2.9, 1.9, 0.5], [1.5, 0.1, 0.2], [1.4, 0.2, 0.3]].map(DVec3::from_array);
    let expected = [[0.45, 0.45, 0.25], [1.45, 0.45, 0.25], [2.45, 1.45, 0.25]];
    let mut made = made(CP);
    made.config += "vox_range = [1, 1, 1, 1, 1, 1]\n";
    // As many tensors as voxels.
    for (name, value) in match entry_mut(&mut made.root, &["state_dict"]) {
        Value::OrderedDict(pairs) => pairs.iter_mut(),
        _ => panic!("no parameters"),
    } {
        if name.contains("_line") {
            let Value::Tensor(tensor) = value else { panic!("no tensor") };
            let Numbers::F32(numbers) = &mut tensor.numbers else { panic!("no numbers") };
            let count = 3 * tensor.shape[1] * tensor.shape[2];
            numbers.to_mut().truncate(count);
            tensor.shape[0] = 3;
        }
    }
    made.places = Places::Points(vec![points.to_vec()]);
    let scene = imported(&made).unwrap();
    for scale in &scene.scales {
        let mut centers: Vec<DVec3> = scale.cloud.centers().collect();
        centers.sort_by(|a, b| a.x.total_cmp(&b.x));
        for (center, expected) in centers.iter().zip(expected) {
            assert!((*center - DVec3::from_array(expected)).length() < 1e-6, "{center} is not {expected:?}");
        }
        assert_eq!(centers.len(), 3);
    }
    // The same centers in files, and points that are too many.
    let derived = imported(&made).unwrap();
    let own = expected.map(|center| DVec3::from_array(center).as_vec3().as_dvec3()).to_vec();
    made.places = Places::Points(vec![own.clone(), own]);
    let given = imported(&made).unwrap();
    let close = |a: &Scene, b: &Scene| (a.scales[0].cloud.center(0) - b.scales[0].cloud.center(0)).length() < 1e-6;
    assert!(close(&derived, &given) && derived.scales[0].factors == given.scales[0].factors, "the order of tensors");
    made.config = made.config.replace("vox_range", "vox_other");
    made.places = Places::Points(vec![points.to_vec()]);
    let error = imported(&made).unwrap_err().to_string();
    assert!(error.contains("give one file of centers for each scale"), "{error}");
}

#[test]
fn files_that_contradict_each_other_are_refused() {
    let refused = |kind: Kind, change: &dyn Fn(&mut Made)| {
        let mut made = made(kind);
        change(&mut made);
        imported(&made).unwrap_err().to_string()
    };
    let points = |made: &mut Made, change: &dyn Fn(&mut Vec<Vec<DVec3>>)| match &mut made.places {
        Places::Points(points) => change(points),
        Places::Boxes(_) => panic!("boxes"),
    };
    let fewer = refused(CP, &|made| points(made, &|points| points[1].truncate(28)));
    assert_eq!(fewer, "the centers of scale 1: expected 29, as many as the checkpoint has tensors, found 28");
    let three = refused(CP, &|made| points(made, &|points| points.push(Vec::new())));
    assert!(three.starts_with("the files of points: expected one file for each of 2 scales"), "{three}");
    let equal = refused(CP, &|made| points(made, &|points| points[0][1] = points[0][0]));
    assert!(equal.contains("ascending by (z, y, x)"), "{equal}");
    let infinite = refused(CP, &|made| points(made, &|points| points[0][1].z = f64::NAN));
    assert!(infinite.contains("center"), "{infinite}");
    let edges = refused(CP, &|made| made.config = made.config.replace("0.3, 0.35, 0.4]", "]").replace(", ]", "]"));
    assert_eq!(edges, "local_range of the configuration: expected half edges of 2 scales, found 1");
    let ranks = refused(CP, &|made| exchange(&mut made.root, "density_line.0", "app_line.0"));
    assert!(
        ranks.starts_with("state_dict density_line.1: expected an array of [7, 5, any], found [7, 4, 6]"),
        "{ranks}"
    );
    let level = refused(CP, &|made| made.config = made.config.replace("unit_lvl = 1", "unit_lvl = 2"));
    assert_eq!(level, "unit_lvl of the configuration: expected a number below 2, found 2");
    let sharing = refused(KINDS[5], &|made| made.config = made.config.replace("vm_sep_mat = 2", "vm_sep_mat = 1"));
    assert!(sharing.starts_with("state_dict density_plane.0: expected an array of [3, 4, 7, 7]"), "{sharing}");
    let columns = refused(KINDS[5], &|made| exchange(&mut made.root, "basis_mat.0.weight", "basis_mat.1.weight"));
    assert_eq!(columns, "state_dict basis_mat.0.weight: expected 5 or 15 columns, found 6");
    let activation = refused(CP, &|made| *entry_mut(&mut made.root, &["kwargs", "fea2denseAct"]) = Value::text("relu"));
    assert!(activation.contains("train with fea2denseAct = softplus"), "{activation}");
    // Declared lengths without numbers, which would be as much memory.
    let empty = refused(CP, &|made| {
        for n in 0..6 {
            let name = format!("density_line.{n}");
            *entry_mut(&mut made.root, &["state_dict", &name]) = Value::tensor([1 << 50, 0, 7], Vec::<f32>::new());
        }
    });
    assert!(empty.starts_with("state_dict density_line.0: expected tensors and components"), "{empty}");
    let features = refused(CP, &|made| {
        *entry_mut(&mut made.root, &["state_dict", "basis_mat.0.weight"]) =
            Value::tensor([1 << 50, 0], Vec::<f32>::new());
    });
    assert_eq!(features, "features: at most 256 are read, found 1125899906842624");
}

#[test]
fn damaged_files_neither_panic_nor_read_as_others() {
    let made = made(KINDS[3]);
    let config = config_of(&made.config);
    let bytes = bytes_of(&made.root);
    for n in 0..bytes.len() / 61 {
        let mut damaged = bytes.clone();
        damaged[61 * n] ^= 0x5a;
        // Numbers have checksums.
        let _ = read(&mut Input::from_bytes(&damaged), &config, &made.places, &options());
        let _ = read(&mut Input::from_bytes(&bytes[..61 * n]), &config, &made.places, &options()).unwrap_err();
    }
    let files = authors_files(&imported(&made).unwrap()).unwrap();
    let meta = &files.beside.iter().find(|(name, _)| name == "_meta.pkl").unwrap().1;
    for n in 0..meta.len() {
        let mut damaged = meta.clone();
        damaged[n] ^= 0x5a;
        let _ = Places::from_meta(&mut Input::from_bytes(&damaged));
        assert!(Places::from_meta(&mut Input::from_bytes(&meta[..n])).is_err(), "cut at {n}");
    }
    let command = b"\x80\x02cposix\nsystem\nX\x02\x00\x00\x00ls\x85R.";
    let error = Places::from_meta(&mut Input::from_bytes(command)).unwrap_err().to_string();
    assert!(error.contains("posix.system") && error.contains("never executed"), "{error}");
}

#[test]
fn bounds_are_the_checkpoints_box() {
    let scene = imported(&made(CP)).unwrap();
    let corners = [[-1.0, -0.9, -1.1], [1.0, 0.95, 1.05]].map(|c| DVec3::from_array(c.map(|v: f32| f64::from(v))));
    assert_eq!(scene.bounds, Aabb { min: corners[0], max: corners[1] });
    assert_eq!((scene.rules.aggregation, scene.rules.min_transmittance), (Aggregation::Clamped, 1e-3));
}

#[test]
fn the_commands_find_the_files_beside_a_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (kind, name) in [(CP, "cp"), (KINDS[5], "vm")] {
        let files = authors_files(&imported(&made(kind)).unwrap()).unwrap();
        std::fs::write(at(&format!("{name}.th")), bytes_of(&files.checkpoint)).unwrap();
        for (end, bytes) in &files.beside {
            std::fs::write(at(&format!("{name}{end}")), bytes).unwrap();
        }
        let of = |end: &str| format!("{name}{end}");
        let printed = run(folder.path(), &["import", &of(".th"), "-o", &of(".strivec")]);
        assert!(printed.contains("2 scales, 36 tensors"), "{printed}");
        run(folder.path(), &["export", &of(".strivec"), "-o", &of("2.th"), "--as", "authors"]);
        run(folder.path(), &["import", &of("2.th"), "-o", &of("2.strivec")]);
        let same = |a: String, b: String| std::fs::read(at(&a)).unwrap() == std::fs::read(at(&b)).unwrap();
        assert!(same(of(".strivec"), of("2.strivec")) && same(of(".th"), of("2.th")), "{name}");
    }
    let centers = ["cp_centers_0.txt", "cp_centers_1.txt"];
    let named =
        ["import", "cp.th", "-o", "3.strivec", "--config", "cp.txt", "--points", centers[0], "--points", centers[1]];
    run(folder.path(), &named);
    assert_eq!(std::fs::read(at("3.strivec")).unwrap(), std::fs::read(at("cp.strivec")).unwrap());
    let failed = |arguments: &[&str]| {
        let output = strivec(folder.path(), arguments);
        assert_eq!(code(&output), 1, "{arguments:?}");
        text(&output.stderr)
    };
    let other = failed(&["import", "cp.th", "-o", "4.strivec", "--meta", "vm_meta.pkl"]);
    assert!(other.contains("--meta is for a checkpoint of a Strivec_DBase"), "{other}");
    std::fs::remove_file(at("vm_meta.pkl")).unwrap();
    let error = failed(&["import", "vm.th", "-o", "4.strivec"]);
    assert!(error.contains("needs --meta; no file vm_meta.pkl"), "{error}");
}

#[test]
fn the_archive_of_factors_holds_the_scenes_arrays() {
    let scene = native(&[FactorKind::Cp, FactorKind::Vm, FactorKind::Vm], Coverage::All);
    let mut out = Cursor::new(Vec::new());
    write_factors(&scene, &mut out).unwrap();
    let mut archive = zip::ZipArchive::new(out).unwrap();
    let mut array = |name: &str| -> (Vec<u64>, Vec<f64>) {
        let mut entry = archive.by_name(&format!("{name}.npy")).expect(name);
        let header = Header::read(&mut entry).unwrap();
        (header.shape.clone(), header.numbers(&mut entry).unwrap())
    };
    for (s, scale) in scene.scales.iter().enumerate() {
        let (shape, centers) = array(&format!("scale{s}_centers"));
        assert_eq!(shape, [scale.cloud.len() as u64, 3]);
        assert!(scale.cloud.centers().zip(centers.chunks_exact(3)).all(|(a, b)| a.to_array() == b));
        for block in &scale.factors.density {
            let end = if let Form::Vm(axis) = block.form { ["_x", "_y", "_z"][axis] } else { "" };
            let (shape, values) = array(&format!("scale{s}_density{end}"));
            let rows = block.form.rows(scale.cloud.resolution);
            assert_eq!(shape, [scale.cloud.len(), rows, block.rank as usize].map(|n| n as u64));
            assert!(values.iter().zip(&block.values).all(|(&a, &b)| a == f64::from(b)), "scale {s}");
        }
        assert_eq!(array(&format!("scale{s}_half_edge")).1, scale.cloud.half_edge.to_array());
    }
    assert_eq!(array("bounds").0, [2, 3]);
    assert_eq!(array("step"), (Vec::new(), vec![scene.rules.step]));
}

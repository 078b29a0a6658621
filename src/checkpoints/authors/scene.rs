//! The scene of a checkpoint.

use std::cmp::Ordering;

use super::config::Config;
use super::places::Places;
use crate::family;
use crate::family::{MAX_CELLS, MAX_RANK, SceneOptions};
use crate::state::{CheckpointArray, CheckpointState};
use crate::torch::TorchFile;
use strivec_format::container::Limits;
use strivec_format::model::{
    Aggregation, AppearanceMatrix, Block, Factors, Form, MemoryLimit, Placement, Provenance, Rules, Scale, Scene,
    TensorCloud,
};
use strivec_import::{Fault, Input};

/// Scales of a scene (spec 5).
const MAX_SCALES: u64 = 16;
/// Numbers of the factors of a scene (4 GiB). Matrices that tensors share in a checkpoint are repeated in a scene.
const MAX_FACTORS: u64 = 1 << 30;

/// The transmittance below which the program's march ends.
const MIN_TRANSMITTANCE: f64 = 1e-3;
/// Features of a scene (spec 5).
const MAX_FEATURES: u64 = 256;

/// The classes whose checkpoints are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// `StrivecCP_hier`.
    Cp,
    /// `Strivec_DBase`.
    Vm,
}

/// The class of the checkpoint `input`; `None` if it is not one of the authors' program.
///
/// # Errors
///
/// If the file is not a checkpoint with settings and parameters.
pub fn model(input: &mut Input<'_>) -> Result<Option<Model>, Fault> {
    Ok(model_of(&CheckpointState::new(TorchFile::open(input)?)?))
}

fn model_of(state: &CheckpointState<'_, '_>) -> Option<Model> {
    state.has("basis_mat.0.weight").then(|| if state.has("density_plane.0") { Model::Vm } else { Model::Cp })
}

/// Reads the scene of the checkpoint `input`. Tensors are sorted as scenes have them; those of a scale are as many as their centers
/// in `places`.
///
/// # Errors
///
/// If a file is damaged, the files contradict each other, or they hold what a scene cannot express.
pub fn read(input: &mut Input<'_>, config: &Config, places: &Places, options: &SceneOptions) -> Result<Scene, Fault> {
    let mut state = CheckpointState::new(TorchFile::open(input)?)?;
    let names = || Fault::malformed("the keys of state_dict", "basis_mat.0.weight", state.parameter_names());
    let model = model_of(&state).ok_or_else(names)?;
    for (name, what) in
        [("theta_line.0", "vectors over directions"), ("pnt_rot", "rotated tensors"), ("pnt_rot.0", "rotated tensors")]
    {
        if state.has(name) {
            return Err(Fault::unsupported(what, "train with boxes along the axes and three local_dims a scale"));
        }
    }
    let bounds = family::bounds(&mut state)?;
    let scales = (0..).take_while(|l| state.has(&format!("basis_mat.{l}.weight"))).count();
    Fault::unless_within("scales", MAX_SCALES, scales as u64)?;
    let mut read_scales = Vec::new();
    let mut numbers = 0;
    for scale in 0..scales {
        read_scales.push(self::scale(&mut state, model, [scale, scales], config, places, &mut numbers)?);
    }
    place_features(&mut read_scales, config.adds_features);
    let step_scale = read_scales.get(config.step_scale).ok_or_else(|| {
        Fault::malformed("unit_lvl of the configuration", format!("a number below {scales}"), config.step_scale)
    })?;
    let rules = Rules {
        coverage: config.coverage,
        aggregation: Aggregation::Clamped,
        density_reduction: config.density_reduction,
        appearance_reduction: config.appearance_reduction,
        min_transmittance: MIN_TRANSMITTANCE,
        ..family::rules(&mut state, step_scale.cloud.cell_size())?
    };
    let decoder = family::decoder(&mut state, read_scales[0].appearance_matrix.features)?;
    let scene = Scene {
        frame: family::frame(&mut state, options)?,
        bounds,
        rules,
        scales: read_scales,
        decoder,
        occupancy: family::occupancy(&mut state)?,
        provenance: Provenance {
            dataset: options.dataset.clone(),
            preset: if model == Model::Cp { "strivec-cp" } else { "strivec-vm" }.into(),
            steps: 0,
            seed: 0,
            tool: "the Strivec authors' program".into(),
        },
        memory: MemoryLimit(Limits::default().memory),
    };
    scene.check()?;
    Ok(scene)
}

/// Reads scale number `scale` of `scales`, and adds the numbers of its factors to `numbers`.
fn scale(
    state: &mut CheckpointState<'_, '_>,
    model: Model,
    [scale, scales]: [usize; 2],
    config: &Config,
    places: &Places,
    numbers: &mut u64,
) -> Result<Scale, Fault> {
    let density = LineFactors::read(state, "density", scale, None)?;
    let appearance = LineFactors::read(state, "app", scale, Some((density.tensors, density.vertices)))?;
    let (tensors, vertices) = (density.tensors, density.vertices);
    let (centers, half_edge) = places.of_scale([scale, scales], tensors, config)?;
    let mut order: Vec<usize> = (0..tensors).collect();
    let key = |n: &usize| [centers[*n].z, centers[*n].y, centers[*n].x];
    order.sort_by(|a, b| {
        let mut axes = key(a).into_iter().zip(key(b)).map(|(a, b)| a.total_cmp(&b));
        axes.find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
    });
    let resolution = vertices.map(|n| n as u32 - 1);
    let weights = state.parameter(&format!("basis_mat.{scale}.weight"), &[None, None])?;
    let (density, appearance) = match model {
        Model::Cp => (density.cp(&order), Components::all(appearance.cp(&order))),
        Model::Vm => {
            let sharing = config.matrix_sharing;
            (
                density.vm(state, "density", scale, sharing, &order, numbers)?.blocks,
                appearance.vm(state, "app", scale, sharing, &order, numbers)?,
            )
        }
    };
    let appearance_matrix = appearance.matrix(&weights, &format!("state_dict basis_mat.{scale}.weight"))?;
    Ok(Scale {
        cloud: TensorCloud {
            placement: Placement::Explicit { centers: order.iter().map(|&n| centers[n]).collect() },
            half_edge,
            resolution,
        },
        top_k: config.top_k(scale)?,
        factors: Factors { density, appearance: appearance.blocks },
        appearance_matrix,
    })
}

/// The vectors of a scale, of density or appearance: those along x, y and z, \[tensor\]\[component\]\[vertex\].
struct LineFactors {
    arrays: [CheckpointArray; 3],
    tensors: usize,
    rank: usize,
    vertices: [usize; 3],
}

impl LineFactors {
    /// `expected` are the number of tensors and the vertices along each axis, where known.
    fn read(
        state: &mut CheckpointState<'_, '_>,
        part: &str,
        scale: usize,
        expected: Option<(usize, [usize; 3])>,
    ) -> Result<Self, Fault> {
        let mut arrays = Vec::new();
        let (mut tensors, mut rank) = (expected.map(|e| e.0), None);
        for axis in 0..3 {
            let name = format!("{part}_line.{}", 3 * scale + axis);
            let line = state.parameter(&name, &[tensors, rank, expected.map(|e| e.1[axis])])?;
            (tensors, rank) = (Some(line.shape[0]), Some(line.shape[1]));
            let place = format!("state_dict {name}");
            Fault::unless_within(&format!("components of {place}"), MAX_RANK, line.shape[1] as u64)?;
            if !(2..=MAX_CELLS + 1).contains(&line.shape[2]) || line.shape[0] == 0 || line.shape[1] == 0 {
                let expected = format!("tensors and components of 2 to {} vertices", MAX_CELLS + 1);
                return Err(Fault::malformed(place, expected, format!("{:?}", line.shape)));
            }
            arrays.push(line);
        }
        let arrays: [CheckpointArray; 3] = arrays.try_into().unwrap_or_else(|_| unreachable!("three axes were read"));
        let [tensors, rank, _] = [0, 1, 2].map(|axis| arrays[0].shape[axis]);
        let vertices = [0, 1, 2].map(|axis| arrays[axis].shape[2]);
        Ok(Self { arrays, tensors, rank, vertices })
    }

    /// \[component\]\[vertex\] the vectors along `axis` of `tensor`.
    fn of(&self, axis: usize, tensor: usize) -> &[f32] {
        let len = self.rank * self.vertices[axis];
        &self.arrays[axis].values[tensor * len..][..len]
    }

    /// Products of three vectors, of the tensors in `order`.
    fn cp(&self, order: &[usize]) -> Vec<Block> {
        let mut values = Vec::with_capacity(self.arrays.iter().map(|line| line.values.len()).sum());
        for &tensor in order {
            (0..3).for_each(|axis| values.extend(family::by_row(self.of(axis, tensor), self.rank)));
        }
        vec![Block::cp(self.rank as u32, values)]
    }

    /// Products of a vector and a matrix, of the tensors in `order`. Along each axis, components whose vectors are zero are left out.
    fn vm(
        &self,
        state: &mut CheckpointState<'_, '_>,
        part: &str,
        scale: usize,
        sharing: u32,
        order: &[usize],
        numbers: &mut u64,
    ) -> Result<Components, Fault> {
        let name = format!("{part}_plane.{scale}");
        let [n, rank] = [self.vertices[0], self.rank];
        if self.vertices != [n; 3] {
            let found = self.vertices.map(|n| n - 1);
            return Err(Fault::unsupported(
                format!("matrices of tensors of {found:?} cells"),
                "train with equal local_dims",
            ));
        }
        let matrices = match sharing {
            0 => 1,
            1 => 3,
            2 => self.tensors,
            _ => return Err(Fault::malformed("vm_sep_mat of the configuration", "0, 1 or 2", sharing)),
        };
        let plane = state.parameter(&name, &[Some(matrices), Some(rank), Some(n), Some(n)])?.values;
        let kept = [0, 1, 2].map(|axis| self.nonzero(axis));
        let all: u64 = kept.iter().map(|kept| kept.len() as u64).sum();
        *numbers = numbers.saturating_add((self.tensors as u64).saturating_mul(all).saturating_mul((n + n * n) as u64));
        Fault::unless_within("numbers of the factors of a scene", MAX_FACTORS, *numbers)?;
        let mut blocks = Vec::new();
        for (axis, kept) in kept.iter().enumerate().filter(|(_, kept)| !kept.is_empty()) {
            let mut values = Vec::with_capacity(self.tensors * kept.len() * (n + n * n));
            for &tensor in order {
                let line = self.of(axis, tensor);
                (0..n).for_each(|v| values.extend(kept.iter().map(|c| line[c * n + v])));
                let matrix = [0, axis, tensor][sharing as usize];
                let plane = &plane[matrix * rank * n * n..];
                // [component][first axis][second axis] as rows, the first axis fastest.
                for (first, second) in (0..n * n).map(|row| (row % n, row / n)) {
                    values.extend(kept.iter().map(|c| plane[(c * n + first) * n + second]));
                }
            }
            blocks.push(Block { form: Form::Vm(axis), rank: kept.len() as u32, values });
        }
        Ok(Components { blocks, kept: kept.to_vec(), rank })
    }

    /// The components with a vector along `axis` that is not zero.
    fn nonzero(&self, axis: usize) -> Vec<usize> {
        let n = self.vertices[axis];
        let mut nonzero = vec![false; self.rank];
        for tensor in self.arrays[axis].values.chunks_exact((self.rank * n).max(1)) {
            for (nonzero, vector) in nonzero.iter_mut().zip(tensor.chunks_exact(n)) {
                *nonzero |= vector.iter().any(|&v| v != 0.0);
            }
        }
        (0..self.rank).filter(|&c| nonzero[c]).collect()
    }
}

/// The components of appearance, with their places in the checkpoint.
struct Components {
    blocks: Vec<Block>,
    /// The checkpoint's components of each block along x, y and z; of products of three vectors, those of the one block.
    kept: Vec<Vec<usize>>,
    /// Components of a checkpoint's array.
    rank: usize,
}

impl Components {
    fn all(blocks: Vec<Block>) -> Self {
        let rank = blocks[0].rank as usize;
        Self { blocks, kept: vec![(0..rank).collect()], rank }
    }

    /// The appearance matrix. With products of a vector and a matrix, columns belong to the sums of a component over the axes, or
    /// to the components of x, then of y and of z, by their number.
    fn matrix(&self, weights: &CheckpointArray, place: &str) -> Result<AppearanceMatrix, Fault> {
        let [features, columns] = [weights.shape[0], weights.shape[1]];
        Fault::unless_within("features", MAX_FEATURES, features as u64)?;
        let stride = match columns {
            n if n == self.rank => 0,
            n if n == self.rank * self.kept.len() => self.rank,
            _ => {
                let expected = format!("{} or {} columns", self.rank, self.rank * self.kept.len());
                return Err(Fault::malformed(place, expected, columns));
            }
        };
        let places: Vec<usize> =
            self.kept.iter().enumerate().flat_map(|(axis, kept)| kept.iter().map(move |c| axis * stride + c)).collect();
        let rows = weights.values.chunks_exact(columns.max(1));
        let weights = rows.flat_map(|row| places.iter().map(|&column| row[column])).collect();
        Ok(AppearanceMatrix { features: features as u32, rank: places.len() as u32, weights })
    }
}

/// Unless the features of scales are added, they follow one another: each matrix has rows of zeros for those of the other scales.
fn place_features(scales: &mut [Scale], adds: bool) {
    if adds {
        return;
    }
    let all: u32 = scales.iter().map(|scale| scale.appearance_matrix.features).sum();
    let mut first = 0;
    for AppearanceMatrix { features, rank, weights } in scales.iter_mut().map(|scale| &mut scale.appearance_matrix) {
        let rank = *rank as usize;
        let mut placed = vec![0.0; all as usize * rank];
        placed[first * rank..][..weights.len()].copy_from_slice(weights);
        first += *features as usize;
        (*features, *weights) = (all, placed);
    }
}

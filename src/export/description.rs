//! A scene as named arrays and a description of the rest, and back.

use std::collections::BTreeMap;

use glam::{DVec3, UVec3};
use serde::{Deserialize, Serialize};

use super::factors::block_name;
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Limits, Metadata, SceneFile, TrainingCamera, Views};
use strivec_format::geometry::{Aabb, Lattice};
use strivec_format::model::{
    AppearanceMatrix, Block, Decoder, DecoderMode, FactorKind, Factors, Form, Frame, Linear, MemoryLimit, Occupancy,
    Placement, Provenance, Rules, Scale, Scene, TensorCloud,
};
use strivec_import::npy::Element;

/// The description's layout: raised when a reader of the last one would misread it.
const LAYOUT: u32 = 1;

/// All of a scene but the arrays that [`write_arrays`](super::write_arrays) passes on, and of the ancillary sections license, views,
/// cameras and notes.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneDescription {
    /// [`LAYOUT`].
    layout: u32,
    frame: Frame,
    bounds: Aabb,
    rules: Rules,
    scales: Vec<ScaleDescription>,
    decoder: DecoderDescription,
    /// Bounds of the grid.
    occupancy: Option<Aabb>,
    provenance: Provenance,
    license: Option<String>,
    views: Option<Views>,
    cameras: Vec<TrainingCamera>,
    notes: BTreeMap<String, String>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ScaleDescription {
    /// Half edges of the tensors.
    half: DVec3,
    resolution: [u32; 3],
    top_k: u32,
    factor_kind: FactorKind,
    /// The lattice; absent if centers are explicit.
    lattice: Option<Lattice>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DecoderDescription {
    mode: DecoderMode,
    feature_frequencies: u32,
    direction_frequencies: u32,
    layers: usize,
}

/// Gives the arrays that belong to a [`SceneDescription`], which are untrusted.
pub trait ArrayReader {
    /// Why there is no scene.
    type Error;

    /// True if there is an array `name`.
    fn has(&self, name: &str) -> bool;

    /// The shape and the numbers of the array `name`, in C order.
    ///
    /// # Errors
    ///
    /// If it is missing, has numbers of another type, or lengths other than those `expected`.
    fn read<T: Element, const N: usize>(
        &self,
        name: &str,
        expected: [Option<usize>; N],
    ) -> Result<([usize; N], Vec<T>), Self::Error>;

    /// The error of a description that cannot be used, for which `message` is the reason.
    fn refusal(&self, message: String) -> Self::Error;
}

impl SceneDescription {
    /// The description of a file's `scene` and `metadata`.
    pub fn of(scene: &Scene, metadata: &Metadata) -> Self {
        let scale = |scale: &Scale| ScaleDescription {
            half: scale.cloud.half_edge,
            resolution: scale.cloud.resolution,
            top_k: scale.top_k,
            factor_kind: scale.factors.kind(),
            lattice: match &scale.cloud.placement {
                Placement::Lattice { lattice, .. } => Some(*lattice),
                Placement::Explicit { .. } => None,
            },
        };
        let decoder = &scene.decoder;
        Self {
            layout: LAYOUT,
            frame: scene.frame.clone(),
            bounds: scene.bounds,
            rules: scene.rules.clone(),
            scales: scene.scales.iter().map(scale).collect(),
            decoder: DecoderDescription {
                mode: decoder.mode,
                feature_frequencies: decoder.feature_frequencies,
                direction_frequencies: decoder.direction_frequencies,
                layers: decoder.layers.len(),
            },
            occupancy: scene.occupancy.as_ref().map(|occupancy| occupancy.bounds),
            provenance: scene.provenance.clone(),
            license: metadata.license.clone(),
            views: metadata.views.clone(),
            cameras: metadata.cameras.clone(),
            notes: metadata.notes.clone(),
        }
    }

    /// The scene of this description and `arrays`, which passes [`Scene::check`]. Its numbers are written with 16 bits where that
    /// loses nothing, else with 32.
    ///
    /// # Errors
    ///
    /// The errors of `arrays`; its refusal if the description is of another layout or the scene breaks an invariant.
    pub fn scene<R: ArrayReader>(self, arrays: &R) -> Result<SceneFile, R::Error> {
        if self.layout != LAYOUT {
            return Err(arrays.refusal(format!("layout {} is not supported; expected {LAYOUT}", self.layout)));
        }
        let scales = self.scales.into_iter().enumerate().map(|(s, scale)| scale.scale(s, arrays));
        let scales = scales.collect::<Result<_, _>>()?;
        let layers = (0..self.decoder.layers).map(|l| layer(l, arrays)).collect::<Result<_, _>>()?;
        let decoder = Decoder {
            mode: self.decoder.mode,
            feature_frequencies: self.decoder.feature_frequencies,
            direction_frequencies: self.decoder.direction_frequencies,
            layers,
        };
        let occupancy = self.occupancy.map(|bounds| occupancy(bounds, arrays)).transpose()?;
        let Self { frame, bounds, rules, provenance, license, views, cameras, notes, .. } = self;
        let memory = MemoryLimit(Limits::default().memory);
        let scene = Scene { frame, bounds, rules, scales, decoder, occupancy, provenance, memory };
        scene.check().map_err(|e| arrays.refusal(e.to_string()))?;
        let encoding = EncodeOptions::lossless(&scene);
        Ok(SceneFile { scene, metadata: Metadata { license, views, cameras, notes, ..Metadata::default() }, encoding })
    }
}

impl ScaleDescription {
    /// Scale `s` of this description.
    fn scale<R: ArrayReader>(self, s: usize, arrays: &R) -> Result<Scale, R::Error> {
        let (placement, tensors) = match self.lattice {
            Some(lattice) => {
                let ([tensors, _], cells) = arrays.read::<u32, 2>(&format!("scale{s}_cells"), [None, Some(3)])?;
                let cells = cells.as_chunks::<3>().0.iter().map(|&cell| UVec3::from_array(cell)).collect();
                (Placement::Lattice { lattice, cells }, tensors)
            }
            None => {
                let ([tensors, _], centers) = arrays.read::<f64, 2>(&format!("scale{s}_centers"), [None, Some(3)])?;
                let centers = centers.as_chunks::<3>().0.iter().map(|&center| DVec3::from_array(center)).collect();
                (Placement::Explicit { centers }, tensors)
            }
        };
        let limit = container::limits::RESOLUTION;
        if let Some(cells) = self.resolution.into_iter().find(|&cells| !limit.contains(&u64::from(cells))) {
            return Err(arrays.refusal(format!("scale {s} has {cells} cells; expected 1 to {}", limit.end())));
        }
        let blocks = |part: &str| -> Result<Vec<Block>, R::Error> {
            let forms = match self.factor_kind {
                FactorKind::Cp => vec![Form::Cp],
                FactorKind::Vm => (0..3).map(Form::Vm).collect(),
            };
            let is_there = |form: &Form| *form == Form::Cp || arrays.has(&block_name(s, part, *form));
            let block = |form: Form| {
                let rows = form.rows(self.resolution);
                let name = block_name(s, part, form);
                let ([.., rank], values) = arrays.read::<f32, 3>(&name, [Some(tensors), Some(rows), None])?;
                Ok(Block { form, rank: count(rank, arrays)?, values })
            };
            forms.into_iter().filter(is_there).map(block).collect()
        };
        let factors = Factors { density: blocks("density")?, appearance: blocks("appearance")? };
        let columns = Some(factors.appearance_rank() as usize);
        let ([features, rank], weights) = arrays.read::<f32, 2>(&format!("scale{s}_matrix"), [None, columns])?;
        Ok(Scale {
            cloud: TensorCloud { placement, half_edge: self.half, resolution: self.resolution },
            top_k: self.top_k,
            factors,
            appearance_matrix: AppearanceMatrix {
                features: count(features, arrays)?,
                rank: count(rank, arrays)?,
                weights,
            },
        })
    }
}

/// Layer `l` of the decoder.
fn layer<R: ArrayReader>(l: usize, arrays: &R) -> Result<Linear, R::Error> {
    let ([outputs, inputs], weights) = arrays.read::<f32, 2>(&format!("decoder{l}_weights"), [None, None])?;
    let (_, bias) = arrays.read::<f32, 1>(&format!("decoder{l}_bias"), [Some(outputs)])?;
    Ok(Linear { inputs: count(inputs, arrays)?, outputs: count(outputs, arrays)?, weights, bias })
}

/// The occupancy in `bounds`.
fn occupancy<R: ArrayReader>(bounds: Aabb, arrays: &R) -> Result<Occupancy, R::Error> {
    let ([z, y, x], set) = arrays.read::<bool, 3>("occupancy", [None; 3])?;
    let vertices = UVec3::new(count(x, arrays)?, count(y, arrays)?, count(z, arrays)?);
    let mut occupancy = Occupancy::empty(bounds, vertices);
    for bit in (0..set.len()).filter(|&bit| set[bit]) {
        occupancy.words[bit / 64] |= 1 << (bit % 64);
    }
    Ok(occupancy)
}

/// `n` as the model's type of counts.
fn count<R: ArrayReader>(n: usize, arrays: &R) -> Result<u32, R::Error> {
    u32::try_from(n).map_err(|_| arrays.refusal(format!("{n} is too large; expected fewer than 2^32")))
}

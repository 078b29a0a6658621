//! `strivec-pack conform`: what this reader makes of files, for the conformance suite (`format-spec/conformance`).

use std::path::PathBuf;

use glam::DVec3;
use serde::Serialize;

use super::input::{Inputs, LimitArgs};
use crate::{Context, Error, scene_file};
use strivec_field::render::ReferenceRenderer;
use strivec_format::container;
use strivec_format::container::{Probe, SceneFile};
use strivec_format::escape::escaped_path;
use strivec_format::model::{Block, ReferenceField, Scale, Scene};
use strivec_measure::PROBE_MARGIN;

/// Rays of a file that are traced, at most.
const TRACED: usize = 4;

/// Arguments of `strivec-pack conform`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    inputs: Inputs,
}

/// The error or the numbers that a file has for this reader.
#[derive(Debug, Serialize, schemars::JsonSchema)]
#[schemars(rename = "ReadFile")]
pub(super) struct Row {
    file: PathBuf,
    /// The class of the error, as section 7 of the specification names it, if the file is refused.
    class: Option<&'static str>,
    /// The sections that the reader could not use, and the classes of their errors.
    skipped: Vec<[String; 2]>,
    /// The numbers of the scene, if the file is accepted.
    numbers: Option<Numbers>,
}

/// The numbers of a scene. Checksums are those of section 1, of little-endian numbers.
#[derive(Debug, Serialize, schemars::JsonSchema)]
struct Numbers {
    /// Smallest and largest corner.
    bounds: [[f64; 3]; 2],
    step: f64,
    scales: Vec<ScaleNumbers>,
    /// Checksum of the f32 weights, then the bias, layer after layer.
    decoder: u32,
    /// Checksum of the bits, packed as in section 3.6.
    occupancy: Option<u32>,
    /// The first probes with a margin that no reader's rounding reaches.
    probes: Vec<Traced>,
}

#[derive(Debug, Serialize, schemars::JsonSchema)]
struct ScaleNumbers {
    tensors: usize,
    resolution: [u32; 3],
    /// Ranks of density and appearance.
    ranks: [u32; 2],
    /// Checksum of the f64 centers, tensor after tensor.
    centers: u32,
    /// Checksum of the f32 density factors, `[block][tensor][row][component]`, 0 for components that are not stored.
    density: u32,
    /// Checksum of the appearance factors, laid out alike.
    appearance: u32,
    /// Checksum of the f32 matrix, \[feature\]\[component\].
    matrix: u32,
}

/// A ray as the reader traces it, and the density feature at the probe's point.
#[derive(Debug, Serialize, schemars::JsonSchema)]
struct Traced {
    probe: usize,
    color: [f64; 3],
    opacity: f64,
    depth: f64,
    feature: f64,
}

/// Prints what this reader makes of the files.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let rows: Result<Vec<Row>, Error> =
        args.inputs.paths()?.into_iter().map(|path| Row::read(path, args.inputs.limits)).collect();
    let rows = rows?;
    session.console.result(&rows, |rows| rows.iter().map(Row::text).collect())
}

impl Row {
    fn read(path: PathBuf, limits: LimitArgs) -> Result<Self, Error> {
        let bytes = scene_file::read_bytes(&path)?;
        let refused = |error: container::Error| match error.class() {
            Some(class) => Ok(class),
            None => Err(Error::container(&path, error)),
        };
        Ok(match container::decode_scene_file(&bytes, limits.of_file(bytes.len())) {
            Err(error) => Self { class: Some(refused(error)?), skipped: Vec::new(), numbers: None, file: path },
            Ok(SceneFile { scene, metadata, .. }) => {
                ReferenceField::check_memory(&scene).map_err(Error::memory(&path))?;
                let of_section =
                    |s: &container::SkippedSection| [s.name.clone(), s.error.class().unwrap_or_default().to_owned()];
                let probes = metadata.probes.as_ref().map_or(&[][..], |probes| &probes.probes);
                Self {
                    class: None,
                    skipped: metadata.skipped.iter().map(of_section).collect(),
                    numbers: Some(Numbers::of(&scene, probes)),
                    file: path,
                }
            }
        })
    }

    fn text(&self) -> String {
        let file = escaped_path(&self.file);
        match self.class {
            Some(class) => format!("{file}: refused, {class}\n"),
            None => format!("{file}: accepted, {} sections skipped\n", self.skipped.len()),
        }
    }
}

impl Numbers {
    fn of(scene: &Scene, probes: &[Probe]) -> Self {
        let (renderer, field) = (ReferenceRenderer::new(scene), ReferenceField::new(scene));
        let traced = |(n, probe): (usize, &Probe)| {
            let trace = renderer.trace_one(&probe.ray());
            let feature = field.density_feature(&field.locate(DVec3::from_array(probe.point))).feature;
            Traced { probe: n, color: trace.color, opacity: trace.opacity, depth: trace.depth, feature }
        };
        let clear = probes.iter().enumerate().filter(|(_, probe)| probe.margin > 100.0 * PROBE_MARGIN);
        let layers = scene.decoder.layers.iter().flat_map(|layer| [&layer.weights, &layer.bias]);
        Self {
            bounds: [scene.bounds.min, scene.bounds.max].map(|corner| corner.to_array()),
            step: scene.rules.step,
            scales: scene.scales.iter().map(ScaleNumbers::of).collect(),
            decoder: checksum(layers.flatten().map(|v| v.to_le_bytes())),
            occupancy: scene.occupancy.as_ref().map(|occupancy| crc32fast::hash(&occupancy.bytes())),
            probes: clear.take(TRACED).map(traced).collect(),
        }
    }
}

impl ScaleNumbers {
    fn of(scale: &Scale) -> Self {
        let of_numbers = |values: &[f32]| checksum(values.iter().map(|v| v.to_le_bytes()));
        let of_blocks =
            |blocks: &[Block]| checksum(blocks.iter().flat_map(|block| block.values.iter().map(|v| v.to_le_bytes())));
        let centers = (0..scale.cloud.len()).flat_map(|n| scale.cloud.center(n).to_array());
        Self {
            tensors: scale.cloud.len(),
            resolution: scale.cloud.resolution,
            ranks: [scale.factors.density_rank(), scale.factors.appearance_rank()],
            centers: checksum(centers.map(f64::to_le_bytes)),
            density: of_blocks(&scale.factors.density),
            appearance: of_blocks(&scale.factors.appearance),
            matrix: of_numbers(&scale.appearance_matrix.weights),
        }
    }
}

fn checksum<const N: usize>(numbers: impl Iterator<Item = [u8; N]>) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    numbers.for_each(|bytes| hasher.update(&bytes));
    hasher.finalize()
}
